"""A wall clock of a process's own: stepped while it runs, back and forth; its monotonic clock and
its waits are not.
"""

import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from operate.fault_proxy import clocks

pytestmark = [
    pytest.mark.process,
    pytest.mark.skipif(
        shutil.which(clocks.COMPILER) is None,
        reason="needs a C compiler (Debian: apt install gcc libc6-dev)",
    ),
]
TELLS = """
import sys, time, threading
for line in sys.stdin:
    before = time.monotonic()
    time.sleep(0.01)
    threading.Event().wait(0.01)
    waited = time.monotonic() - before
    print(time.time(), time.time_ns() / 1e9, waited, time.monotonic(), flush=True)
"""
HOUR_S, SOON_S = 3600.0, 60.0


class Told:
    """A process with a clock of its own."""

    def __init__(self, run: Path) -> None:
        self.run, pipe = run, subprocess.PIPE
        environment = clocks.made(run, ("ox",))["ox"]
        self.process = subprocess.Popen(
            [sys.executable, "-c", TELLS], env=environment, stdin=pipe, stdout=pipe, text=True
        )

    def times(self) -> list[float]:
        """Return what it says of its clocks now: wall, wall, how long it waited, monotonic."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write("\n")
        self.process.stdin.flush()
        return [float(word) for word in self.process.stdout.readline().split()]


@pytest.fixture
def told(tmp_path: Path) -> Iterator[Told]:
    """A process that tells its clocks; ended at the end."""
    made = Told(tmp_path)
    yield made
    made.process.communicate(timeout=SOON_S)


@pytest.mark.parametrize("seconds", [-HOUR_S, -1.5, HOUR_S, 0.25, 1e8])
def test_only_the_wall_clock_is_stepped(told: Told, seconds: float) -> None:
    """At once, by that much; healed it is right again."""
    for step in (0.0, seconds, 0.0):
        clocks.step(told.run, "ox", step)
        early, before = time.time() + step, time.monotonic()
        wall, same, waited, monotonic = told.times()
        until, after = time.time() + step, time.monotonic()
        assert early <= wall <= same <= until
        assert 0.02 <= waited <= after - before
        assert before <= monotonic <= after


def test_without_a_compiler_nobody_has_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And a step of it is nothing; clocks of an earlier start are gone."""
    assert clocks.made(tmp_path, ("ox",))
    monkeypatch.setattr(clocks, "COMPILER", "no-such-compiler")
    assert clocks.made(tmp_path, ("ox",)) == {}
    clocks.step(tmp_path, "ox", 1.0)
    assert not clocks.file(tmp_path, "ox").exists()
