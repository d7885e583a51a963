"""The loop's clock, moved by the test; tests of this folder import `grips`."""

import sys
from pathlib import Path

import pytest

from services.executor.loop import process, timing

sys.path.append(str(Path(__file__).parent))


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
    """In place of the module `time`, in the loop's process and its pacer."""
    clock = Clock()
    monkeypatch.setattr(process, "time", clock)
    monkeypatch.setattr(timing, "time", clock)
    return clock
