"""Worker processes: killable at any moment, ended with their parent, and usable as a device on the pretend wires."""

import os
import queue
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from msgspec import Struct
from msgspec.structs import replace
from worker_entries import At, Count, Ended, Go, Halt

from agent_runtime.core.agent import Agent, Behaviour
from agent_runtime.core.errors import WorkerError
from agent_runtime.core.events import Local
from agent_runtime.core.turn import Turn
from agent_runtime.core.wiring import Wiring
from agent_runtime.io.devices import Errand, Post
from agent_runtime.io.worker import Worker
from agent_runtime.testing.wires import Wires
from fipa_codec.languages import Languages

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
    """Question and answer in order, long ones too; the end by itself is told with its code."""
    heard: queue.SimpleQueue[Any] = queue.SimpleQueue()
    ends: queue.SimpleQueue[int] = queue.SimpleQueue()
    worker = Worker("worker_entries:count", answers=At, on_message=heard.put, on_end=ends.put)
    worker.tell(Count(3, b"x" * 1_000_000))
    for number in range(3):
        assert heard.get(timeout=20) == At(number, b"x" * 1_000_000)
        worker.tell(Go())
    assert ends.get(timeout=20) == 0
    worker.kill()


def test_tell_never_blocks() -> None:
    """Ten megabytes to a child that does not listen are taken at once, and a kill still is at once."""
    heard: queue.SimpleQueue[Any] = queue.SimpleQueue()
    worker = Worker("worker_entries:spin", answers=At, on_message=heard.put)
    heard.get(timeout=20)
    start = time.monotonic()
    for _ in range(10):
        worker.tell(Count(0, b"x" * 1_000_000))
    worker.kill()
    assert time.monotonic() - start < 5.0
    assert not worker.alive


def test_end_with_code_and_unknown_entry() -> None:
    """A child that fails, or cannot be found, is told by its exit code; a malformed entry is our own error."""
    for entry, code in (("worker_entries:crash", 3), ("worker_entries:nobody", 1)):
        ends: queue.SimpleQueue[int] = queue.SimpleQueue()
        worker = Worker(entry, answers=At, on_message=lambda _: None, on_end=ends.put)
        assert ends.get(timeout=20) == code
        worker.kill()
    with pytest.raises(WorkerError, match="names no function"):
        Worker("worker_entries", answers=At, on_message=lambda _: None)


def test_dies_with_its_parent() -> None:
    """kill -9 of the parent ends the busy child too."""
    code = (
        "import time, worker_entries as e; from agent_runtime.io.worker import Worker;"
        "Worker('worker_entries:spin', answers=e.At, on_message=lambda m: print(m.number, flush=True)); time.sleep(60)"
    )
    environment = os.environ | {"PYTHONPATH": HERE}
    with subprocess.Popen([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        child = int(parent.stdout.readline())
        assert runs(child)
        parent.kill()
    wait_for(lambda: not runs(child))


class Memory(Struct, frozen=True):
    """What the worker said."""

    numbers: tuple[int, ...] = ()
    ended: int = -1


def follow(memory: Memory, turn: Turn) -> Memory:
    """Answer each number with Go, until the worker ended."""
    match turn.event:
        case Local(content=Count() | Halt() as word):
            turn.tell(word)
        case Local(content=At(number=number)):
            turn.tell(Go())
            return replace(memory, numbers=(*memory.numbers, number))
        case Local(content=Ended(code=code)):
            return replace(memory, ended=code)
    return memory


def counting_wires() -> Wires:
    """One agent with a worker process as its device."""

    def device(post: Post) -> Errand:
        return Errand(post, "worker_entries:count", answers=At, begin=Count, stop=Halt, ended=Ended)

    wires = Wires()
    agent = Agent("a", "at", Memory(), {"at": Behaviour(follow)}, local=Count | At | Ended | Halt)
    wires.add(agent, Wiring("toy", "a", (), Languages()), device)
    return wires


def test_errand_on_the_wires() -> None:
    """The virtual clock stands still while the worker computes, so its answers come at the time of the question."""
    wires = counting_wires()
    start = wires.now
    wires.post("a", Count(5))
    wires.run(lambda: wires.memory("a").ended == 0)
    assert wires.memory("a").numbers == (0, 1, 2, 3, 4)
    assert wires.now == start
    wires.close()


def test_a_new_errand_ends_the_old_one() -> None:
    """A second Count in the middle kills the first worker; Halt kills it for good, without the word Ended."""
    wires = counting_wires()
    wires.post("a", Count(1000))
    wires.run(lambda: len(wires.memory("a").numbers) > 3)
    wires.post("a", Count(1_000_000))
    wires.run(lambda: wires.memory("a").numbers.count(0) == 2)
    wires.post("a", Halt())
    wires.run_for(1.0)
    assert wires.memory("a").ended == -1
    wires.close()
