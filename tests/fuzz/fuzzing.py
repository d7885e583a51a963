"""One reader and many inputs: the outcomes, the slowest, the memory. An undocumented error is a
crash.
"""

import random
import resource
import signal
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

import msgspec
from mutation import mutated
from targets import Run, Target

HANGS_S = 5.0
"""Longest for one input; estimate: a hundred times what the slowest takes on a busy machine."""
GROWTH_KB = 64 * 1024
"""One input of 64 kB may not raise the peak of memory by more; estimate: a thousand bytes for each
of its own.
"""


class Hangs(BaseException):
    """An input took longer than HANGS_S."""


class Crash(msgspec.Struct, frozen=True):
    """An input and what it did."""

    input: bytes
    what: str
    where: str


class Outcome(msgspec.Struct):
    """Results for all inputs. `errors`: documented ones by type; "": accepted. `slowest_ms` of
    processor: `slowest`.

    `peak_mb` of memory; `grown_mb`: since the valid inputs were read.
    """

    inputs: int = 0
    errors: Counter[str] = msgspec.field(default_factory=Counter)
    crashes: list[Crash] = []
    slowest_ms: float = 0.0
    slowest: bytes = b""
    peak_mb: float = 0.0
    grown_mb: float = 0.0


def fuzz(target: Target, seed: int, count: int) -> Outcome:
    """Return what came of `count` inputs, the same ones for the same seed."""
    chance, seeds, outcome = random.Random(f"{target.name} {seed}"), target.seeds(), Outcome()
    with (
        tempfile.TemporaryDirectory(prefix="fuzz-", dir=_memory()) as folder,
        target.read(Path(folder)) as run,
    ):
        for data in seeds:
            with suppress(*target.allowed):
                run(data)
        peak = begin = _peak()
        for _ in range(count):
            data = mutated(seeds, target.changes, chance)
            took = _one(target, run, data, outcome)
            if took > outcome.slowest_ms:
                outcome.slowest_ms, outcome.slowest = took, data
            before, peak = peak, _peak()
            if peak - before > GROWTH_KB:
                outcome.crashes.append(
                    Crash(data, f"memory grew by {(peak - before) // 1024} MB", "memory")
                )
    outcome.peak_mb, outcome.grown_mb = round(peak / 1024, 1), round((peak - begin) / 1024, 1)
    return outcome


def replayed(target: Target, data: bytes, folder: Path) -> Outcome:
    """Return what came of one input."""
    outcome = Outcome()
    with target.read(folder) as run:
        _one(target, run, data, outcome)
    return outcome


def _one(target: Target, run: Run, data: bytes, outcome: Outcome) -> float:
    """Run an input; the processor it took [ms]."""
    outcome.inputs += 1
    began = time.thread_time()
    try:
        with _limited():
            run(data)
        outcome.errors[""] += 1
    except target.allowed as error:
        outcome.errors[type(error).__name__] += 1
        if not str(error):
            outcome.crashes.append(
                Crash(data, f"{type(error).__name__} without words", _place(error))
            )
    except (Exception, Hangs) as error:
        outcome.crashes.append(Crash(data, f"{type(error).__name__}: {error}"[:300], _place(error)))
    return (time.thread_time() - began) * 1000


def _place(error: BaseException) -> str:
    """Return file and line of an error: where crashes are one."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    return f"{Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}" if trace else ""


@contextmanager
def _limited() -> Iterator[None]:
    def late(number: int, frame: FrameType | None) -> None:
        raise Hangs(f"longer than {HANGS_S:g} s")

    signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, HANGS_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def _peak() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _memory() -> str | None:
    """Return the folder of files that are in memory, where there is one."""
    return "/dev/shm" if Path("/dev/shm").is_dir() else None
