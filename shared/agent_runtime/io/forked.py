"""A process made by the fork server (fork_server.py): asked for, then watched and ended as a child of one's own.

The asking process has the address of the server in its environment. Where there is no server, or it cannot serve, the
answer is None, and the process is started in the usual way. Nobody runs what nobody waits for: the new process begins
only once it was told to, and ends where who asked has given up.
"""

import os
import select
import signal
import socket
import struct
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

import msgspec

FORKS_VARIABLE = "ROCO_FORKS"
"""The file of the server's socket."""
WITHIN_S = 2.0  # for an answer; estimate: a fork takes 10-40 ms on a loaded machine
NUMBER = struct.Struct("<q")
GO = b"go"
UNKNOWN = 1  # exit code of a process whose end nobody saw: its parent had died


class Asked(msgspec.Struct, frozen=True):
    """Run `python -m module arguments` in this folder and environment, in a session of its own if so asked.

    `places`: the number that each file handed over has in the new process.
    """

    module: str
    arguments: tuple[str, ...]
    folder: str
    environment: dict[str, str]
    session: bool
    places: tuple[int, ...]


class Handed(NamedTuple):
    """A file that is open here, and the number that it shall have there."""

    file: int
    place: int


class Forked:
    """A process that a fork server made; as much of subprocess.Popen as is needed. Any thread may use it."""

    def __init__(self, pid: int, handle: int, line: socket.socket) -> None:
        """`handle`: of the process itself, so that no other with its number is meant; `line`: to the server."""
        self.pid = pid
        self.returncode: int | None = None
        self._handle, self._line = handle, line
        self._lock = threading.Lock()

    def poll(self) -> int | None:
        """Return the exit code once it has ended, negative for a signal; else None."""
        with self._lock:
            if self.returncode is None and select.select([self._handle], [], [], 0.0)[0]:
                self._end()
            return self.returncode

    def wait(self) -> int:
        """Return the exit code once it has ended."""
        while (code := self.poll()) is None:
            select.select([self._handle], [], [])
        return code

    def terminate(self) -> None:
        """Send SIGTERM."""
        self._signal(signal.SIGTERM)

    def kill(self) -> None:
        """Send SIGKILL."""
        self._signal(signal.SIGKILL)

    def _signal(self, number: signal.Signals) -> None:
        with self._lock, suppress(ProcessLookupError):
            if self.returncode is None:
                signal.pidfd_send_signal(self._handle, number)

    def _end(self) -> None:
        """Note the exit code, which the server tells as soon as it sees the end."""
        code = b""
        with suppress(OSError):
            code = self._line.recv(NUMBER.size)
        self.returncode = NUMBER.unpack(code)[0] if len(code) == NUMBER.size else UNKNOWN
        self._line.close()
        os.close(self._handle)


def fork(
    module: str,
    *arguments: str,
    environment: Mapping[str, str],
    hand: Sequence[Handed],
    session: bool = False,
) -> Forked | None:
    """Return the process that runs this module, made by the server; None where the server does not make it.

    `environment`: of the new process; it names the server, too.
    """
    place = environment.get(FORKS_VARIABLE)
    if not place:
        return None
    asked = Asked(module, arguments, str(Path.cwd()), dict(environment), session, tuple(one.place for one in hand))
    line = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    line.settimeout(WITHIN_S)
    try:
        with short(Path(place)) as address:
            line.connect(address)
        socket.send_fds(line, [msgspec.json.encode(asked)], [one.file for one in hand])
        answer = line.recv(NUMBER.size)
        (pid,) = NUMBER.unpack(answer)
        handle = os.pidfd_open(pid)
        line.send(GO)
    except (OSError, struct.error):  # the new process, if there is one, sees that nobody waits for it, and ends
        line.close()
        return None
    return Forked(pid, handle, line)


@contextmanager
def short(place: Path) -> Iterator[str]:
    """Yield an address of this socket that is short enough, however long the path is (107 bytes are allowed)."""
    folder = os.open(place.parent, os.O_PATH | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        yield f"/proc/self/fd/{folder}/{place.name}"
    finally:
        os.close(folder)
