"""Makes helpers, doubles and the example importable; the loop's clock, moved by the test."""

import sys
from pathlib import Path

import pytest

from services.executor.loop import process

HERE = Path(__file__).parent
OTHERS = ("loop", "conformance", "../velma", "../fleet", "../agent_runtime")
sys.path[:0] = [str(HERE), *(str((HERE / one).resolve()) for one in OTHERS)]
sys.path.append(str(HERE.parents[1] / "examples" / "point_mass"))


class Clock:
    """A clock that only sleep and the test move."""

    def __init__(self):
        self.now = 0.0

    def monotonic(self):
        return self.now

    def sleep(self, seconds):
        self.now += seconds


@pytest.fixture
def clock(monkeypatch):
    """In place of the module `time`, in the loop's process."""
    clock = Clock()
    monkeypatch.setattr(process, "time", clock)
    return clock
