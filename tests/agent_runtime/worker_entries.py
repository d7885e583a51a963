"""Functions that the workers of the tests run in their child process, and what a parent says to
them.
"""

import os
import signal
import time
from collections.abc import Iterator
from queue import Queue
from typing import Any

import msgspec

from agent_runtime.io.worker import Link, Worker


class Count(msgspec.Struct, frozen=True, tag=True):
    """Count to `end`, asking at each number whether to go on."""

    end: int
    pad: bytes = b""


class Go(msgspec.Struct, frozen=True, tag=True):
    """Go on."""


class At(msgspec.Struct, frozen=True, tag=True):
    """Got here."""

    number: int
    pad: bytes = b""


def count(link: Link) -> None:
    """Count as told."""
    task = link.recv(Count)
    for number in range(task.end):
        link.send(At(number, task.pad))
        link.recv(Go)


def counting(worker: Worker, heard: Queue[Any], task: Count) -> Iterator[int]:
    """Have a worker that runs `count` do the task; yield each number that it says, before it goes
    on.
    """
    worker.tell(task)
    for number in range(task.end):
        assert heard.get(timeout=20) == At(number, task.pad)
        yield number
        worker.tell(Go())


def spin(link: Link) -> None:
    """Say the process id, then compute for ever."""
    link.send(At(os.getpid()))
    while True:
        time.monotonic()


def crash(link: Link) -> None:
    """Die of an error."""
    raise SystemExit(3)


def raises(link: Link) -> None:
    """Die of an exception whose message has several long lines."""
    raise ValueError("no way\n  from here to there " + "and back " * 100)


def shoot(link: Link) -> None:
    """Be killed."""
    os.kill(os.getpid(), signal.SIGKILL)


def babble(link: Link) -> None:
    """Say what is no answer."""
    link.send(7)
    link.recv(Go)
