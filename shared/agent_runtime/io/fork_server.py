"""`python -m agent_runtime.io.fork_server MODULES`: import them once, then make processes by fork,
until SIGTERM; and its client.

A process that is forked need not import again what all share. The server has one thread when it
forks, so nothing is lost by that. Where what it imported has changed since, or the process is to
start with other variables of the loader or interpreter, it makes nothing, and the caller starts the
process itself. Only the same user can ask: the socket is in the run's folder. A process that it
made does not need it any more.
"""

import atexit
import ctypes
import fcntl
import gc
import importlib
import json
import os
import runpy
import select
import selectors
import signal
import socket
import struct
import sys
import threading
import traceback
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import NamedTuple, NoReturn

import msgspec

from agent_runtime.io.run_files import PERIOD_S, RUN_FOLDER_VARIABLE, ProcessHeartbeat, ready_file

# --- Client of the fork server --------------------------------------------------------------------
# `fork` asks for a process; `Forked` watches and ends it.
# The variable ROCO_FORKS holds the path of the server's socket. Without an answer of a server,
# `fork` returns None, and the caller starts the process itself. A new process waits for the
# caller's go, and ends if the caller is gone.


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


# --- The server -----------------------------------------------------------------------------------


MOST_BYTES, MOST_FILES = 1 << 20, 16  # of a request: an environment has some kB
AT_THE_START = ("LD_", "PYTHON", "GLIBC_", "MALLOC_", "OMP_", "OPENBLAS_")
"""Beginnings of the variables that loader, C library, interpreter and numeric libraries read only
when they start (by their manuals; more than those count for nothing but a start without the
server).
"""


def _changed(file: str) -> int:
    try:
        return os.stat(file).st_mtime_ns
    except OSError:
        return 0


def at_the_start(environment: Mapping[str, str]) -> dict[str, str]:
    """The variables that count when an interpreter starts."""
    return {name: value for name, value in environment.items() if name.startswith(AT_THE_START)}


class Server:
    """Serves requests in one thread. A process that it made leaves `serve` with what it is to
    run.
    """

    def __init__(self, place: Path, beat: Callable[[], None], start: Mapping[str, str]) -> None:
        """`place`: of the socket; `start`: variables that counted when this interpreter started."""
        self._beat, self._start = beat, start
        files = (getattr(module, "__file__", None) for module in list(sys.modules.values()))
        self._sources = {
            file: _changed(file) for file in files if file and "site-packages" not in file
        }
        self._lines: dict[int, socket.socket] = {}  # to who waits for the end of a process
        self._ending = False
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        place.unlink(missing_ok=True)
        with short(place) as address:
            self._listener.bind(address)
        self._listener.listen(64)
        self._woken, self._wake = socket.socketpair()
        self._selector = selectors.DefaultSelector()
        for end in (self._listener, self._woken, self._wake):
            end.setblocking(False)
        self._selector.register(self._listener, selectors.EVENT_READ)
        self._selector.register(self._woken, selectors.EVENT_READ)
        signal.set_wakeup_fd(self._wake.fileno(), warn_on_full_buffer=False)
        signal.signal(signal.SIGCHLD, lambda *_: None)
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._end)

    def _end(self, number: int, frame: FrameType | None) -> None:
        self._ending = True

    def serve(self) -> Asked | None:
        """Serve until a signal ends it, then return None; in a process that it made, return what
        that is to run.
        """
        while not self._ending:
            self._beat()
            for key, _ in self._selector.select(PERIOD_S):
                if key.fileobj is self._listener:
                    with suppress(OSError):
                        line, _ = self._listener.accept()
                        line.setblocking(False)
                        self._selector.register(line, selectors.EVENT_READ)
                elif key.fileobj is self._woken:
                    with suppress(BlockingIOError):
                        self._woken.recv(4096)
                elif (
                    isinstance(key.fileobj, socket.socket)
                    and (asked := self._read(key.fileobj)) is not None
                ):
                    return asked
            self._bury()
        return None

    def _read(self, line: socket.socket) -> Asked | None:
        """Read a request and fork; return what it asks for in the new process only."""
        self._selector.unregister(line)
        files: Sequence[int] = ()
        try:
            data, files, _, _ = socket.recv_fds(line, MOST_BYTES, MOST_FILES)
            asked = Asked.decoded(data)
            # An interpreter of its own would be another than this one: by its sources, or how it
            # starts.
            changed = any(_changed(file) != time for file, time in self._sources.items())
            other = changed or at_the_start(asked.environment) != self._start
            if len(files) != len(asked.places) or other:
                raise OSError("nothing is made")
            pid = os.fork()
        except (OSError, ValueError, RecursionError, msgspec.ValidationError):
            # Who asked sees the line close, and starts the process itself.
            line.close()
        else:
            if pid == 0:
                self._leave(line)
                _become(asked, files, line)
                return asked
            self._lines[pid] = line
        for file in files:
            os.close(file)
        return None

    def _leave(self, line: socket.socket) -> None:
        """Close in the new process what is the server's."""
        signal.set_wakeup_fd(-1)
        for number in (signal.SIGCHLD, signal.SIGTERM):
            signal.signal(number, signal.SIG_DFL)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        others = [key.fileobj for key in self._selector.get_map().values()]
        for end in (*others, self._wake, *self._lines.values()):
            if isinstance(end, socket.socket) and end is not line:
                end.close()
        self._selector.close()

    def _bury(self) -> None:
        """Tell who waits for each process that ended how it did."""
        with suppress(ChildProcessError):
            while (ended := os.waitpid(-1, os.WNOHANG))[0]:
                line = self._lines.pop(ended[0])
                with suppress(OSError):
                    line.send(NUMBER.pack(os.waitstatus_to_exitcode(ended[1])))
                line.close()


def _become(asked: Asked, files: Sequence[int], line: socket.socket) -> None:
    """Say that the new process is there, wait until it is wanted, and give it its files, folder and
    environment.

    It ends where it is not wanted any more.
    """
    line.setblocking(True)
    rename(asked.module, *asked.arguments)
    if asked.session:
        os.setsid()
    try:
        line.send(NUMBER.pack(os.getpid()))
        if line.recv(len(GO)) != GO:
            os._exit(0)
    except OSError:
        os._exit(0)
    line.close()
    # no place is taken
    above = [fcntl.fcntl(file, fcntl.F_DUPFD_CLOEXEC, 1 + max(asked.places)) for file in files]
    for file in files:
        os.close(file)
    for file, place in zip(above, asked.places, strict=True):
        os.dup2(file, place)
        os.close(file)
    os.chdir(asked.folder)
    os.environ.clear()
    os.environ.update(asked.environment)


def run(asked: Asked) -> None:
    """Run a module as `python -m` does, then end the process."""
    code = 0
    try:
        sys.argv[1:] = asked.arguments
        runpy.run_module(asked.module, run_name="__main__", alter_sys=True)
    except SystemExit as end:
        code = 1
        if end.code is None or isinstance(end.code, int):  # as Python itself has it
            code = (end.code or 0) & 0xFF
        else:
            print(end.code, file=sys.stderr)
    except BaseException:
        traceback.print_exc()
        code = 1
    _exit(code)


def _exit(code: int) -> NoReturn:
    """End as an interpreter does, but take down nothing imported: libraries complain of what they
    hold.
    """
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)


def rename(module: str, *arguments: str) -> None:
    """Write the command line over that of the server, as far as that is long: `ps` and the tools
    tell it by that.
    """
    numbers = Path("/proc/self/stat").read_text().rpartition(")")[2].split()
    # arg_start and arg_end of proc(5), the 48th and 49th of all
    start, end = int(numbers[45]), int(numbers[46])
    if not 0 < start < end:
        return
    words = (
        b"\0".join(os.fsencode(word) for word in (sys.executable, "-P", "-m", module, *arguments))
        + b"\0"
    )
    ctypes.memmove(start, words.ljust(end - start, b"\0")[: end - start - 1] + b"\0", end - start)


def main(modules: Sequence[str]) -> Asked | None:
    """Import the modules and serve; one that cannot be imported is left to who needs it."""
    # imports may set some
    start, run_folder = at_the_start(os.environ), Path(os.environ[RUN_FOLDER_VARIABLE])
    pulse = ProcessHeartbeat(run_folder, FORKS)
    for module in modules:
        pulse.beat()
        try:
            importlib.import_module(module)
        except Exception as error:  # any module, any reason
            print(f"{module} is not kept ready: {error}", file=sys.stderr)
    if len(threads := os.listdir("/proc/self/task")) > 1:
        sys.exit(
            f"{len(threads)} threads run after the imports, expected 1: processes are started one"
            " by one"
        )
    gc.collect()
    gc.freeze()  # or a collection in each process would write to all that they share
    server = Server(Path(os.environ[FORKS_VARIABLE]), pulse.beat, start)
    ready_file(run_folder, FORKS).touch()
    return server.serve()


if __name__ == "__main__":
    if (found := main(sys.argv[1:])) is not None:
        run(found)
    _exit(0)
