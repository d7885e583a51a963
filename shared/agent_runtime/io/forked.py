"""Client of the fork server (fork_server.py): `fork` asks for a process; `Forked` watches and ends
it.

The variable ROCO_FORKS holds the path of the server's socket. Without an answer of a server, `fork`
returns None, and the caller starts the process itself. A new process waits for the caller's go, and
ends if the caller is gone.
"""

import json
import os
import select
import signal
import socket
import struct
import threading
import weakref
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

import msgspec

FORKS = "forks"
"""Name of the server among the processes of a fleet."""
FORKS_VARIABLE = "ROCO_FORKS"
"""The file of the server's socket."""
WITHIN_S = 2.0  # for an answer; estimate: a fork takes 10-40 ms on a loaded machine
NUMBER = struct.Struct("<q")
GO = b"go"
UNKNOWN = 1  # exit code of a process whose end nobody saw: its parent had died


class Asked(msgspec.Struct, frozen=True):
    """Run `python -m module arguments` in this folder and environment, in a session of its own if
    so asked.

    `places`: the number that each file handed over has in the new process.
    """

    module: str
    arguments: tuple[str, ...]
    folder: str
    environment: dict[str, str]
    session: bool
    places: tuple[int, ...]

    def encoded(self) -> bytes:
        """Return it as JSON; unlike msgspec's, this has a place for a variable that is not
        UTF-8.
        """
        return json.dumps(msgspec.structs.asdict(self)).encode()

    @classmethod
    def decoded(cls, data: bytes) -> "Asked":
        """Raise ValueError, RecursionError or msgspec.ValidationError."""
        return msgspec.convert(json.loads(data), cls)


class Handed(NamedTuple):
    """A file that is open here, and the number that it shall have there."""

    file: int
    place: int


class Other:
    """A process that is not a child of this one, by a handle: another one that gets its number
    later is not meant.

    Any thread may use it. The handle is closed with the object.
    """

    def __init__(self, pid: int) -> None:
        """Raise ProcessLookupError where there is none."""
        self.pid = pid
        self._handle = os.pidfd_open(pid)
        weakref.finalize(self, os.close, self._handle)

    def ended(self, within_s: float | None = 0.0) -> bool:
        """Whether it has ended, or does within this time [s]; None: wait until it has."""
        return bool(select.select([self._handle], [], [], within_s)[0])

    def terminate(self) -> None:
        self._signal(signal.SIGTERM)

    def kill(self) -> None:
        self._signal(signal.SIGKILL)

    def _signal(self, number: signal.Signals) -> None:
        with suppress(ProcessLookupError):
            signal.pidfd_send_signal(self._handle, number)


class Forked(Other):
    """A process that a fork server made; as much of subprocess.Popen as is needed."""

    def __init__(self, pid: int, line: socket.socket) -> None:
        """`line`: to the server, which tells the exit code. Raise ProcessLookupError."""
        super().__init__(pid)
        self.returncode: int | None = None
        self._line, self._lock = line, threading.Lock()

    def poll(self) -> int | None:
        """The exit code once it has ended, negative for a signal; else None."""
        with self._lock:
            if self.returncode is None and self.ended():
                self.returncode = self._code()
            return self.returncode

    def wait(self) -> int:
        """The exit code once it has ended."""
        while (code := self.poll()) is None:
            self.ended(None)
        return code

    def _code(self) -> int:
        """The exit code that the server tells; UNKNOWN where it does not."""
        with self._line as line:
            try:
                return int(NUMBER.unpack(line.recv(NUMBER.size))[0])
            except (OSError, struct.error):
                return UNKNOWN


def fork(
    module: str,
    *arguments: str,
    environment: Mapping[str, str],
    hand: Sequence[Handed],
    session: bool = False,
) -> Forked | None:
    """The process that runs this module, made by the server; None where the server does not make
    it.

    `environment`: of the new process; it names the server, too.
    """
    place = environment.get(FORKS_VARIABLE)
    if not place:
        return None
    asked = Asked(
        module,
        arguments,
        str(Path.cwd()),
        dict(environment),
        session,
        tuple(one.place for one in hand),
    )
    line = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    line.settimeout(WITHIN_S)
    try:
        with short(Path(place)) as address:
            line.connect(address)
        socket.send_fds(line, [asked.encoded()], [one.file for one in hand])
        made = Forked(NUMBER.unpack(line.recv(NUMBER.size))[0], line)
        line.send(GO)
    # the new process, if there is one, sees that nobody waits for it, and ends
    except (OSError, struct.error):
        line.close()
        return None
    return made


@contextmanager
def short(place: Path) -> Iterator[str]:
    """Yield an address of this socket that is short enough, however long the path is (107 bytes are
    allowed).
    """
    folder = os.open(place.parent, os.O_PATH | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        yield f"/proc/self/fd/{folder}/{place.name}"
    finally:
        os.close(folder)
