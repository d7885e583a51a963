"""Functions that the workers of the tests run in their child process."""

import os
import time

import msgspec

from agent_runtime.io.worker import Link


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


def spin(link: Link) -> None:
    """Say the process id, then compute for ever."""
    link.send(At(os.getpid()))
    while True:
        time.monotonic()


def crash(link: Link) -> None:
    """Die of an error."""
    raise SystemExit(3)
