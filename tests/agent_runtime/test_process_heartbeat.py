"""The heartbeat of router, recorder and loop: it follows what gets on, and stops with it."""

import os
import threading
import time

import msgspec
import pytest

from agent_runtime.io import run_files
from agent_runtime.io.run_files import PERIOD_S, ProcessHeartbeat, Turns


@pytest.fixture
def clock(monkeypatch):
    """Time as the test says."""
    now = [100.0]
    monkeypatch.setattr(run_files.time, "monotonic", lambda: now[0])
    return now


def aged(file):
    """Make a heartbeat an old one; its time then."""
    os.utime(file, (1.0, 1.0))
    return 1.0


def test_whoever_supervises_finds_the_process(tmp_path):
    """By its id, in the form that an agent's heartbeat has it."""
    beat = ProcessHeartbeat(tmp_path, "router")
    assert beat.file == tmp_path / "router.heartbeat.json"
    assert msgspec.json.decode(beat.file.read_bytes()) == {"name": "router", "pid": os.getpid()}


def test_a_beat_renews_the_time_and_nothing_else(tmp_path, clock):
    """Its reader compares times; its text stays whole at any moment."""
    beat = ProcessHeartbeat(tmp_path, "router")
    text, old = beat.file.read_bytes(), aged(beat.file)
    beat.beat()
    assert beat.file.stat().st_mtime > old
    assert beat.file.read_bytes() == text


def test_it_beats_once_in_a_period_however_often_it_is_asked(tmp_path, clock):
    """A loop asks in each turn."""
    beat = ProcessHeartbeat(tmp_path, "router")
    beat.beat()
    old = aged(beat.file)
    clock[0] += PERIOD_S * 0.9
    beat.beat()
    assert beat.file.stat().st_mtime == old
    clock[0] += PERIOD_S * 0.2
    beat.beat()
    assert beat.file.stat().st_mtime > old


def test_a_heartbeat_that_was_removed_comes_back(tmp_path, clock):
    """Tidying a run folder ends nobody."""
    beat = ProcessHeartbeat(tmp_path, "router")
    beat.file.unlink()
    beat.beat()
    assert beat.file.exists()


class Counting:
    """Stands for the file: says when it was asked to beat."""

    def __init__(self):
        self.beats, self.asked = 0, threading.Event()

    def beat(self):
        self.beats += 1
        self.asked.set()


def test_turns_that_go_on_beat_and_a_loop_that_stands_still_does_not():
    """However long the thread looks on."""
    counting = Counting()
    turns = Turns(counting, period_s=0.01)
    end = time.monotonic() + 20.0
    while counting.beats < 3 and time.monotonic() < end:
        counting.asked.clear()
        turns.count += 1
        assert counting.asked.wait(10.0)
    assert counting.beats >= 3
    before, looks = counting.beats, threading.Event()
    assert not looks.wait(0.2)  # twenty looks of the thread without a turn
    assert counting.beats <= before + 1
    turns.end()


def test_it_ends_when_told(tmp_path):
    """No thread is left behind."""
    turns = Turns(ProcessHeartbeat(tmp_path, "loop"), period_s=0.01)
    turns.end()
    assert not any(thread.name == "pulse" for thread in threading.enumerate())
