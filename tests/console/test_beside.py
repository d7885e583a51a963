"""One fleet, unless a second one is named: what is refused, where a second one writes, whom a verb
means then.
"""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from calling import roco

from companion.run_files import SLOTS_FILE
from console.errors import UsageError
from console.fleet import starting, targets
from console.fleet.local import Local
from console.runs import folders

from . import fake_fleet

pytestmark = pytest.mark.process

FAKE = Path(__file__).with_name("fake_fleet.py")
Begin = Callable[[str], Path]


@pytest.fixture
def told() -> list[list[str]]:
    """The options of each supervisor that was started."""
    return []


@pytest.fixture
def begin(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, told: list[list[str]]
) -> Iterator[Begin]:
    """Brings up a pretended fleet in a folder here, as the console would, too; the first is
    runs/latest.
    """
    started: list[subprocess.Popen[bytes]] = []
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("ROCO_RUN_DIR", raising=False)

    def start(run: Path, arguments: list[str]) -> "subprocess.Popen[bytes]":
        told.append(arguments)
        run.mkdir(parents=True)
        started.append(subprocess.Popen([sys.executable, FAKE, "services.supervisor", run, "True"]))
        return started[-1]

    def up(folder: str) -> Path:
        run = tmp_path / folder
        starting.wait_ready(run, start(run, []), lambda _: None)
        link = run.parent / "latest"
        if not link.is_symlink():
            link.symlink_to(run.name)
        return run

    monkeypatch.setattr(starting, "start", start)
    yield up
    for process in started:
        process.kill()
        process.wait()


@pytest.mark.parametrize("verb", [["up"], ["demo"], ["experiment", "pour", "--runs", "1"]])
@pytest.mark.parametrize("folder", ["runs/first", "experiments/mine/runs/seed-1"])
def test_beside_a_fleet_none_is_started(
    begin: Begin, tmp_path: Path, verb: list[str], folder: str
) -> None:
    """The sentence says what runs where, and what to do; nothing was made."""
    begin(folder)
    before = _files(tmp_path)
    done = roco(*verb, "--format", "json")
    words = json.loads(done.stderr)["error"]
    assert done.exit_code == 1
    assert f"{folder}, 1 process since" in words
    assert "`roco down` ends it" in words
    assert ("--another NAME" in words) == (len(verb) == 1)
    assert _files(tmp_path) == before


def _files(folder: Path) -> set[Path]:
    return {file for file in folder.rglob("*") if file.name != fake_fleet.BESIDE}


def test_processes_that_a_supervisor_left_count_too(begin: Begin) -> None:
    """They move the robot as well."""
    run = begin("runs/first")
    fleet_file = run / "fleet.json"
    fleet_file.write_text(json.dumps(json.loads(fleet_file.read_text()) | {"supervisor": 0}))
    (run.parent / "latest").unlink()
    done = roco("up", code=1)
    assert "1 process left; `roco down --run-dir runs/first` ends it" in done.stderr


def test_where_nothing_runs_any_more_a_fleet_is_started(
    begin: Begin, told: list[list[str]]
) -> None:
    """Old folders are in nobody's way."""
    starting.down(begin("runs/first"))
    roco("up", code=0)
    assert "--no-latest" not in told[-1]


def test_without_room_no_fleet_is_started(
    tmp_path: Path, disk: Callable[[Path, str], Path]
) -> None:
    """The sentence says where, how much there is, and how much it takes."""
    done = roco("up", "--out", disk(tmp_path / "small", "1m") / "run", code=1)
    assert re.search(
        r"the disk of .*/small/run has 1\.0 MB free, and a fleet needs 34 MB to start: make room",
        done.stderr,
    )


def test_a_second_fleet_is_named_and_latest_stays(
    begin: Begin, told: list[list[str]], tmp_path: Path
) -> None:
    """A verb without a name means the first, as before; the name means the second."""
    first = begin("runs/first")
    done = roco("up", "--another", "second", "--format", "json", code=0)
    reply = json.loads(done.stdout)
    assert reply["run"] == str(tmp_path / "runs/second")
    assert "--target second" in reply["text"]
    assert "--no-latest" in told[-1]
    assert _run(targets.find()) == first
    assert _run(targets.find("second")) == tmp_path / "runs/second"
    (tmp_path / "runs/second" / SLOTS_FILE).touch()
    roco("stop", "--target", "second", code=0)
    assert (folders.stop_held(first), folders.stop_held(tmp_path / "runs/second")) == (False, True)


def test_a_folder_of_ones_own_takes_latest_from_no_living_fleet(
    begin: Begin, told: list[list[str]]
) -> None:
    """--out is a name as well; parts of one fleet may stand side by side."""
    begin("runs/first")
    roco("up", "--out", "runs/part", code=0)
    assert "--no-latest" in told[-1]
    roco("up", "--out", "elsewhere/part", code=0)
    assert "--no-latest" not in told[-1]


def test_the_only_fleet_that_lives_is_meant(begin: Begin) -> None:
    """`roco stop` must not hold a robot that is gone; where several live, they are named."""
    first, second = begin("runs/first"), begin("runs/second")
    starting.down(first)
    assert _run(targets.find()) == second
    third = begin("runs/third")
    with pytest.raises(UsageError, match="--target second or third"):
        targets.find()
    starting.down(second)
    starting.down(third)
    assert _run(targets.find()) == first


@pytest.mark.parametrize("words", [["latest"], [".."], ["a/b"], ["there"], ["new", "--out", "x"]])
def test_a_name_that_cannot_be_one_is_wrong_use(begin: Begin, words: list[str]) -> None:
    """Also one that is used already: two recordings do not mix."""
    os.makedirs("runs/there")
    roco("up", "--another", *words, code=2)
    assert not (Path("runs") / words[0] / "fleet.json").exists()


def _run(target: targets.Target) -> Path:
    assert isinstance(target, Local)
    return target.run
