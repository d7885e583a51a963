"""A killable child process that talks msgspec Structs over a socket pair: the planner's search, the
executor's skills.

Parent: `Worker("package.module:function", answers=Union, on_message=post)`; `tell` never blocks (a
thread writes), messages come by `on_message` on a thread that may only enqueue, `on_end(reason)`
says that the child ended by itself, and why: its exception, the signal that killed it, or its exit
status. `kill` is at once. Child: `function(link)` with the plain blocking `link.send(struct)` and
`link.recv(Union)`. A child whose parent dies, however it dies, ends at once: it watches a second
pipe that only the parent holds. Frames: <length u32 little endian><msgpack>. The child's
environment and interpreter are the parent's; nothing is pickled and no module of the parent's main
is imported.
"""

import contextlib
import importlib
import os
import select
import signal
import socket
import struct
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import Any, TypeVar

import msgspec

from agent_runtime.core.errors import WorkerError
from agent_runtime.io.fork_server import Forked, Handed, fork
from agent_runtime.io.inbox import OneReaderQueue

MODULE = "agent_runtime.io.worker"
HEAD = struct.Struct("<I")
REASON_CHARS = 300  # of an exception; the communicates that carry a reason have some hundred bytes
T = TypeVar("T")


class Link:
    """The child's (or any) end of the socket: whole messages, blocking."""

    def __init__(self, end: socket.socket) -> None:
        self._end = end
        self._lock = threading.Lock()

    def send(self, message: Any) -> None:
        """Send one Struct; raises OSError when the other side is gone."""
        self.send_bytes(msgspec.msgpack.encode(message))

    def recv(self, kind: type[T] | Any = Any) -> T | Any:
        """The next message, decoded as `kind` (a Struct or a tagged union); EOFError when the other
        side is gone.
        """
        return msgspec.msgpack.decode(self.recv_bytes(), type=kind)

    def waiting(self) -> bool:
        """Whether a message, or a part of one, is there."""
        return bool(select.select([self._end], [], [], 0.0)[0])

    def send_bytes(self, data: bytes) -> None:
        """Send one frame."""
        with self._lock:
            self._end.sendall(HEAD.pack(len(data)) + data)

    def recv_bytes(self) -> bytes:
        """The next frame's bytes."""
        return self._exactly(HEAD.unpack(self._exactly(HEAD.size))[0])

    def _exactly(self, size: int) -> bytes:
        data = bytearray()
        while len(data) < size:
            part = self._end.recv(min(size - len(data), 1 << 20))
            if not part:
                raise EOFError("the other side of the worker's link is gone")
            data += part
        return bytes(data)


class Worker:
    """The parent's side of one child process; one use: a killed worker is replaced by a new one."""

    def __init__(
        self,
        entry: str,
        *,
        answers: Any,
        on_message: Callable[[Any], None],
        on_end: Callable[[str], None] | None = None,
        nice: int = 0,
    ) -> None:
        """Start `entry` ("package.module:function"); `answers` is the union of Structs the child
        sends.

        Raises WorkerError where `entry` is not of that form; a function that is not there shows by
        `on_end`.
        """
        if entry.count(":") != 1:
            raise WorkerError(entry, "names no function", "write package.module:function")
        self.entry = entry
        self._decoder = msgspec.msgpack.Decoder(answers | str)  # a str: the exception that ends it
        self._on_message, self._on_end = on_message, on_end
        ours, theirs = socket.socketpair()
        watched, self._lifeline = os.pipe()
        self._socket = ours
        self._link = Link(ours)
        words = (entry, str(theirs.fileno()), str(watched), str(nice))
        passed = (theirs.fileno(), watched)
        hand = [Handed(file, file) for file in (1, 2, *passed)]
        # forked where this process has a fork server
        self._process: subprocess.Popen[bytes] | Forked = fork(
            MODULE, *words, environment=os.environ, hand=hand
        ) or subprocess.Popen(
            [sys.executable, "-P", "-m", MODULE, *words],
            pass_fds=passed,
            stdin=subprocess.DEVNULL,
        )
        theirs.close()
        os.close(watched)
        self._outgoing = OneReaderQueue[bytes | None]()
        self._muted, self._closing = threading.Event(), threading.Lock()
        self._threads = [
            threading.Thread(target=run, daemon=True) for run in (self._write, self._read)
        ]
        for thread in self._threads:
            thread.start()

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def alive(self) -> bool:
        return self._process.poll() is None

    def tell(self, message: Any) -> None:
        """Hand the child a Struct; never blocks. Words to a dead child are lost, as its end is told
        by `on_end`.
        """
        self._outgoing.put(msgspec.msgpack.encode(message))

    def kill(self) -> None:
        """End the child now; nothing it said arrives after this, and `on_end` is not called. May be
        repeated.
        """
        self._muted.set()
        self._process.kill()
        self._process.wait()
        self._outgoing.put(None)
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join()
        with self._closing:  # two threads may end it at once
            lifeline, self._lifeline = self._lifeline, -1
        if lifeline >= 0:
            os.close(lifeline)
        self._socket.close()

    def _write(self) -> None:
        while (data := self._outgoing.get()) is not None:
            try:
                self._link.send_bytes(data)
            except OSError:  # the child is gone; the reading thread tells it
                return

    def _read(self) -> None:
        reason = ""
        try:
            while True:
                message = self._decoder.decode(self._link.recv_bytes())
                if self._muted.is_set():
                    return
                if isinstance(message, str):
                    reason = message
                else:
                    self._on_message(message)
        except (EOFError, OSError):
            pass
        except msgspec.DecodeError as error:
            reason = f"it said what is none of its answers: {error}"
            sys.stderr.write(f"worker {self.entry!r}: {reason}; it is stopped\n")
            self._process.kill()
        code = self._process.wait()
        self._outgoing.put(None)
        if self._on_end is not None and not self._muted.is_set():
            killed = f"killed by {signal.Signals(-code).name}" if code < 0 else ""
            self._on_end(reason or killed or f"exit status {code}")


def _end_with_parent(lifeline: int) -> None:
    """Block until the parent's end of the pipe is gone, then leave without clean-up: nobody wants
    the result.
    """
    os.read(lifeline, 1)
    os._exit(1)


def main(arguments: list[str]) -> None:
    """The child: entry, socket, lifeline, niceness."""
    entry, (end, lifeline, nice) = arguments[0], map(int, arguments[1:])
    threading.Thread(target=_end_with_parent, args=(lifeline,), daemon=True).start()
    if nice:
        os.nice(nice)
    module, function = entry.split(":")
    link = Link(socket.socket(fileno=end))
    try:
        getattr(importlib.import_module(module), function)(link)
    except (EOFError, BrokenPipeError):  # the parent has no more questions
        pass
    except Exception as error:  # any child, any reason
        with contextlib.suppress(OSError):
            link.send(f"{type(error).__name__}: {' '.join(str(error).split())}"[:REASON_CHARS])
        raise


if __name__ == "__main__":
    main(sys.argv[1:])
