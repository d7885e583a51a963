"""Worker processes: killable at any moment, ended with their parent, and usable as a device on the
pretend wires.
"""

import os
import queue
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from worker_entries import At, Count, counting

from agent_runtime.core.errors import WorkerError
from agent_runtime.io.worker import REASON_CHARS, Worker

pytestmark = pytest.mark.process

HERE = str(Path(__file__).parent)


@pytest.fixture(autouse=True)
def _children_find_the_entries(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", HERE)


def wait_for(condition: Callable[[], bool], deadline_s: float = 20.0) -> None:
    """Look every 10 ms until the condition holds."""
    end = time.monotonic() + deadline_s
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def runs(pid: int) -> bool:
    """Whether the process is there and no zombie."""
    try:
        return "\nState:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except FileNotFoundError:
        return False


def test_talks_and_ends() -> None:
    """Question and answer in order, long ones too; the end by itself is told."""
    heard: queue.Queue[Any] = queue.Queue()
    ends: queue.Queue[str] = queue.Queue()
    worker = Worker("worker_entries:count", answers=At, on_message=heard.put, on_end=ends.put)
    for _ in counting(worker, heard, Count(3, b"x" * 1_000_000)):
        pass
    assert ends.get(timeout=20) == "exit status 0"
    worker.kill()


def test_tell_never_blocks() -> None:
    """Ten megabytes to a child that does not listen are taken at once, and a kill still is at
    once.
    """
    heard: queue.Queue[Any] = queue.Queue()
    worker = Worker("worker_entries:spin", answers=At, on_message=heard.put)
    heard.get(timeout=20)
    start = time.monotonic()
    for _ in range(10):
        worker.tell(Count(0, b"x" * 1_000_000))
    worker.kill()
    assert time.monotonic() - start < 5.0
    assert not worker.alive


@pytest.mark.parametrize(
    ("entry", "reason"),
    [
        ("raises", "ValueError: no way from here to there"),
        ("nobody", "AttributeError: module 'worker_entries' has no attribute 'nobody'"),
        ("crash", "exit status 3"),
        ("shoot", "killed by SIGKILL"),
        ("babble", "it said what is none of its answers: "),
    ],
)
def test_why_a_child_ended_is_told(entry: str, reason: str) -> None:
    """By its exception in a line of bounded length, else by how the process ended."""
    ends: queue.Queue[str] = queue.Queue()
    worker = Worker(
        f"worker_entries:{entry}", answers=At, on_message=lambda _: None, on_end=ends.put
    )
    told = ends.get(timeout=20)
    assert told.startswith(reason)
    assert len(told) <= REASON_CHARS
    worker.kill()


def test_a_malformed_entry_is_our_own_error() -> None:
    """Nothing is started."""
    with pytest.raises(WorkerError, match="names no function"):
        Worker("worker_entries", answers=At, on_message=lambda _: None)


def test_dies_with_its_parent() -> None:
    """kill -9 of the parent ends the busy child too."""
    code = (
        "import time, worker_entries as e; from agent_runtime.io.worker import"
        " Worker;Worker('worker_entries:spin', answers=e.At, on_message=lambda m: print(m.number,"
        " flush=True)); time.sleep(60)"
    )
    environment = os.environ | {"PYTHONPATH": HERE}
    with subprocess.Popen(
        [sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, text=True
    ) as parent:
        assert parent.stdout is not None
        child = int(parent.stdout.readline())
        assert runs(child)
        parent.kill()
    wait_for(lambda: not runs(child))
