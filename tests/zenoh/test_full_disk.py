"""A disk that takes nothing: an agent says so, promises nothing that is not on it, and goes on when
there is room.
"""

import json
import resource
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest
import toy_agents as toy
from toy_fleet import Fleet, wait_for

from agent_runtime.core.state import restored
from agent_runtime.io.journal import last_record

pytestmark = pytest.mark.zenoh


def memory(run: Path, agent: str) -> toy.AskerMemory | toy.ServerMemory:
    """The memory in the agent's journal."""
    record = last_record((run / "journal" / f"{agent}.journal").read_bytes())
    assert record is not None
    found: toy.AskerMemory | toy.ServerMemory = restored(
        toy.asker() if agent == "asker" else toy.server(), record
    ).memory
    return found


def answered(fleet: Fleet, *numbers: int) -> None:
    """These were asked, worked on and answered, once each and in order."""
    wait_for(
        lambda: len(memory(fleet.run, "asker").answers) >= len(numbers), f"answers\n{fleet.logs()}"
    )
    assert memory(fleet.run, "asker").answers == tuple((number, 2 * number) for number in numbers)
    assert memory(fleet.run, "server").done == numbers


def waits_in_words(fleet: Fleet, agent: str, words: str) -> None:
    """It says why, once, beats on, and is neither dead nor loud."""
    wait_for(lambda: words in fleet.beat(agent).trouble, f"{agent} says {words!r}\n{fleet.logs()}")
    beat = fleet.run / f"{agent}.heartbeat.json"
    last = beat.stat().st_mtime_ns
    wait_for(lambda: beat.stat().st_mtime_ns > last, f"{agent} beats on")
    assert fleet.processes[agent].poll() is None
    assert "Traceback" not in fleet.logs()


def test_a_file_that_may_not_grow(fleet: Fleet) -> None:
    """RLIMIT_FSIZE of a running agent: its next step waits unreceipted; raised again, all is
    answered once.
    """
    numbers = tuple(range(12))
    for number in numbers:
        fleet.want(number)
    answered(fleet, *numbers)
    wait_for(lambda: not memory(fleet.run, "server").agreed, "all is journalled")
    pid = fleet.processes["server"].pid
    journal = fleet.run / "journal" / "server.journal"
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (journal.stat().st_size, resource.RLIM_INFINITY))
    before = journal.read_bytes()
    fleet.want(99)
    waits_in_words(fleet, "server", "the file may not grow any more")
    wait_for(lambda: fleet.beat("asker").counts.get("resent", 0) >= 2, "no receipt comes")
    assert journal.read_bytes() == before
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    answered(fleet, *numbers, 99)
    wait_for(lambda: not fleet.beat("server").trouble, "the trouble is over")
    lines = [
        json.loads(line)
        for line in (fleet.run / "logs" / "server.jsonl").read_text().splitlines()
        if line
    ]
    events = [line["event"] for line in lines]
    assert events.count("room again") + events.count("lines lost") >= 1
    assert fleet.stop("server") == 0


@pytest.fixture
def small_disk(tmp_path: Path, disk: Callable[[Path, str], Path]) -> Path:
    """A file system of 1 MB."""
    return disk(tmp_path / "disk", "1m")


def test_a_disk_that_is_full(small_disk: Path) -> None:
    """Of both agents, with requests under way, and one is killed and cannot start: deleted files
    make room for all.
    """
    fleet = Fleet(small_disk)
    fleet.start("router", "server", "asker")
    numbers = tuple(range(1, 21))
    try:
        fleet.ready("server", "asker")
        fleet.want(0)  # those that follow are in the block that the file has
        answered(fleet, 0)
        fill(small_disk / "filler")
        for number in numbers:
            fleet.want(number)
        troubled = lambda: [name for name in ("asker", "server") if fleet.beat(name).trouble]  # noqa: E731
        wait_for(troubled, f"one of them says that it waits\n{fleet.logs()}")
        waits_in_words(fleet, troubled()[0], "the disk is full")
        fleet.kill("server")
        fleet.start("server")
        wait_for(lambda: "no room" in fleet.logs(), "the server cannot even begin")
        (small_disk / "filler").unlink()
        fleet.ready("server")
        answered(fleet, 0, *numbers)
        assert "Traceback" not in fleet.logs()
    finally:
        for name in list(fleet.processes):
            fleet.kill(name)


def fill(file: Path) -> None:
    """Take all the room there is."""
    with file.open("wb", buffering=0) as taken, suppress(OSError):
        while True:
            taken.write(b"x" * 512)
