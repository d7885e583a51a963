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
from toy_fleet import Fleet, journalled

pytestmark = pytest.mark.zenoh


def answered(fleet: Fleet, *numbers: int) -> None:
    """These were asked, worked on and answered, once each and in order."""
    answers = lambda: journalled(fleet.run, toy.asker()).answers  # noqa: E731
    fleet.wait(lambda: len(answers()) >= len(numbers), "answers")
    assert answers() == tuple((number, 2 * number) for number in numbers)
    assert journalled(fleet.run, toy.server()).done == numbers


def waits_in_words(fleet: Fleet, agent: str, words: str) -> None:
    """It says why, once, beats on, and is neither dead nor loud."""
    fleet.wait(lambda: words in fleet.beat(agent).trouble, f"{agent} says {words!r}")
    fleet.beats_on(agent)
    assert fleet.processes[agent].poll() is None
    assert "Traceback" not in fleet.logs()


def test_a_file_that_may_not_grow(toys: Fleet) -> None:
    """RLIMIT_FSIZE of a running agent: its next step waits unreceipted; raised again, all is
    answered once.
    """
    numbers = tuple(range(12))
    toys.want(*numbers)
    answered(toys, *numbers)
    toys.wait(lambda: not journalled(toys.run, toy.server()).agreed, "all is journalled")
    pid = toys.processes["server"].pid
    journal = toys.run / "journal" / "server.journal"
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (journal.stat().st_size, resource.RLIM_INFINITY))
    before = journal.read_bytes()
    toys.want(99)
    waits_in_words(toys, "server", "the file may not grow any more")
    toys.wait(lambda: toys.beat("asker").counts.get("resent", 0) >= 2, "no receipt comes")
    assert journal.read_bytes() == before
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    answered(toys, *numbers, 99)
    toys.wait(lambda: not toys.beat("server").trouble, "the trouble is over")
    lines = (toys.run / "logs" / "server.jsonl").read_text().splitlines()
    assert {"room again", "lines lost"} & {json.loads(line)["event"] for line in lines if line}
    assert toys.stop("server") == 0


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
        fleet.want(*numbers)
        troubled = lambda: [name for name in ("asker", "server") if fleet.beat(name).trouble]  # noqa: E731
        fleet.wait(troubled, "one of them says that it waits")
        waits_in_words(fleet, troubled()[0], "the disk is full")
        fleet.kill("server")
        fleet.start("server")
        fleet.wait(lambda: "no room" in fleet.logs(), "the server cannot even begin")
        (small_disk / "filler").unlink()
        fleet.ready("server")
        answered(fleet, 0, *numbers)
        assert "Traceback" not in fleet.logs()
    finally:
        fleet.end()


def fill(file: Path) -> None:
    """Take all the room there is."""
    with file.open("wb", buffering=0) as taken, suppress(OSError):
        while True:
            taken.write(b"x" * 512)
