"""`roco agents`, `top` and `doctor` on a pretended fleet, and on a terminal."""

import json
import os
import pty
import select
import subprocess
import sys
import termios
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import ModuleType

import pytest
from calling import printed, roco

from companion.run_files import SLOTS_FILE
from companion.tools.verbs import checkup
from console.fleet import checkup as general
from console.fleet.local import Local
from console.runs import folders
from console.terminal import top
from console.terminal.console import Console

pytestmark = pytest.mark.process
Checking = Callable[[], Iterator[general.Check]]


def test_agents_tells_of_every_process(run: Path) -> None:
    """A row for each; the same for programs."""
    done = roco("agents", "--run-dir", run, code=0)
    assert "MiB" in done.stdout
    (row,) = printed("agents", "--run-dir", run)["agents"]
    assert (row["name"], row["process"]) == ("ta", "ready")
    assert row["cpu"] >= 0


def test_what_is_known_of_one_has_its_channels_and_names_who_there_is(run: Path) -> None:
    """A name that is not there is a wrong use."""
    told = printed("agents", "ta", "--run-dir", run)
    assert told["channels"] == {"co": "C1", "ex": "C5", "km": "C6"}
    done = roco("agents", "nobody", "--run-dir", run, code=2)
    assert "there are: ta" in done.stderr


def test_where_no_supervisor_is_nobody_is_stopped(run: Path) -> None:
    """It says what to do."""
    fleet = json.loads((run / "fleet.json").read_bytes())
    (run / "fleet.json").write_text(json.dumps(fleet | {"supervisor": 0}))
    done = roco("agent", "stop", "ta", "--run-dir", run, code=1)
    assert "`roco down`, then `roco up`" in done.stderr
    assert not list(run.glob("*.off"))


def test_top_tells_what_went_over_a_channel(run: Path) -> None:
    """The one communicate of the story, long ago."""
    watched = partial(roco, "top", "--run-dir", run)
    channels = printed("top", "--run-dir", run, "--graph", "--once")["channels"]
    assert {one["name"]: one["count"] for one in channels}["C4"] == 1
    assert "C4 0.0/s 0 B/s, 1 in all" in watched("--graph", "--once").stdout
    assert watched("--format", "dot", "--once").stdout.startswith("graph fleet {")
    told = watched("--count", 2, "--period", 0.2, "--format", "json").stdout
    _, second = told.splitlines()
    assert json.loads(second)["plan"] == "plan 1: pour, succeeded"
    assert "carries out the plan" in watched("--count", "1").stdout


@pytest.mark.parametrize(("width", "height"), [(80, 24), (100, 30)])
def test_the_picture_of_top_fits(width: int, height: int, run: Path) -> None:
    """No line is longer than the terminal, and no more lines than it has."""
    nowhere = Path(os.devnull).open("w")  # noqa: SIM115
    console = Console(width=width, height=height, force_terminal=True, file=nowhere)
    lines = console.render_lines(top.Watched(Local(run)).picture(width, height))
    assert len(lines) <= height
    console.file.close()


def test_top_ends_at_q_and_leaves_the_terminal_as_it_was(run: Path) -> None:
    """In a terminal of its own: the picture comes, q ends it with 0."""
    ours, theirs = pty.openpty()
    before = termios.tcgetattr(theirs)
    command = [sys.executable, "-m", "console", "top", "--run-dir", str(run)]
    process = subprocess.Popen(
        command, stdin=theirs, stdout=theirs, stderr=theirs, env=os.environ | {"TERM": "xterm"}
    )
    told = b""
    while b"who" not in told and b"agent" not in told:
        assert select.select([ours], [], [], 30)[0], told
        told += os.read(ours, 4096)
    os.write(ours, b"q")
    until = time.monotonic() + 30
    while process.poll() is None and time.monotonic() < until:
        if select.select([ours], [], [], 0.1)[0]:
            os.read(ours, 4096)
    assert process.returncode == 0
    assert termios.tcgetattr(theirs) == before
    os.close(ours)
    os.close(theirs)


def test_doctor_finds_nothing_wrong_with_a_fleet_that_is_well(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And a note where it is held."""
    monkeypatch.setitem(checkup.CHECKS.machine, "imports", partial(general.imports, ("msgspec",)))
    roco("stop", "--run-dir", run)
    done = roco("doctor", "--run-dir", run, "--format", "json")
    checks = {check["name"]: check for check in json.loads(done.stdout)["checks"]}
    assert checks["fleet"]["level"] == "fine"
    assert checks["stop"]["level"] == "note"
    machine = {"python", "libraries", "imports", "ports", "disk", "memory", "processor"}
    assert machine <= checks.keys()


def test_doctor_names_what_died_and_what_was_left_behind(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each with its remedy; exit code 1."""
    monkeypatch.setattr(general, "MACHINE", {})
    monkeypatch.delitem(checkup.CHECKS.machine, "imports")
    fleet = json.loads((run / "fleet.json").read_bytes())
    left = tmp_path / "runs" / "before"
    left.mkdir(parents=True)
    (left / "fleet.json").write_text(json.dumps(fleet | {"supervisor": 0}))
    dead = {"name": "km", "state": "given-up", "note": "killed by signal 9"}
    (run / "fleet.json").write_text(
        json.dumps(fleet | {"connect": "tcp/127.0.0.1:1", "processes": [*fleet["processes"], dead]})
    )
    monkeypatch.chdir(tmp_path)
    done = roco("doctor", "--run-dir", run, "--format", "json", code=1)
    checks = {check["name"]: check for check in json.loads(done.stdout)["checks"]}
    assert checks["km"]["what"] == "given-up: killed by signal 9"
    assert "roco agent start km" in checks["km"]["remedy"]
    assert "nobody listens at tcp/127.0.0.1:1" in checks["router"]["what"]
    assert checks["other runs"]["level"] == "wrong"
    assert "roco down --run-dir runs/before" in checks["other runs"]["remedy"]
    assert "✗" in roco("doctor", "--run-dir", run).stdout


@pytest.mark.parametrize(("late", "level"), [(20, "fine"), (300, "wrong")])
@pytest.mark.parametrize("runs", [False, True])
def test_doctor_says_whether_real_time_is_held(
    late: int,
    level: str,
    runs: bool,
    request: pytest.FixtureRequest,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Without a fleet by a loop that is tried out, else by the one that runs; and what to do where
    it is not held.
    """
    asked: list[Path | None] = []

    def measure(slots: Path | None = None) -> checkup.Pace:
        asked.append(slots)
        return checkup.Pace(500, late, held=late < 50)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(checkup, "measure", measure)
    monkeypatch.setattr(general, "MACHINE", {})
    monkeypatch.delitem(checkup.CHECKS.machine, "imports")
    run = request.getfixturevalue("run") if runs else None
    if run is not None:
        named(run, "loop")
        (tmp_path / "runs").symlink_to(run.parent)
    done = roco("doctor", *(["--run-dir", run] if runs else []), "--format", "json")
    checks = json.loads(done.stdout)["checks"]
    (check,) = [check for check in checks if check["name"] == "real time"]
    assert asked == [run and run / SLOTS_FILE]
    assert check["level"] == level
    assert ("real time cannot be held" in check["what"]) == (level == "wrong")
    assert ("--speed max" in check["remedy"]) == (level == "wrong")
    assert f"{late / 5:.0f} % of the control loop's cycles" in check["what"]
    assert (done.exit_code == 1) >= (level == "wrong")


def named(run: Path, name: str) -> None:
    """Call the process of a pretended fleet so."""
    fleet = json.loads((run / "fleet.json").read_bytes())
    fleet["processes"][0]["name"] = name
    (run / "fleet.json").write_text(json.dumps(fleet))


def test_doctor_asks_nobody_about_a_loop_that_does_not_run(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beside a fleet none is tried out either: both would be late."""
    monkeypatch.chdir(run.parent)
    monkeypatch.setattr(folders, "RUNS", run.parent)
    monkeypatch.setattr(checkup, "measure", lambda *_: pytest.fail("a loop was timed"))
    assert list(checkup.real_time()) == []
    assert list(checkup.loop(Local(run), Local(run).look())) == []


@pytest.mark.parametrize("realtime", [False, True])
def test_doctor_says_whether_the_loop_gets_its_priority(
    realtime: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As the loop found it, not as the rights of this user let one expect."""
    monkeypatch.chdir(tmp_path)
    pace = checkup.Pace(500, 0, held=True, realtime=realtime)
    monkeypatch.setattr(checkup, "measure", lambda: pace)
    levels = [check.level for check in checkup.real_time() if check.name == "priority"]
    assert levels == ["note"] * (not realtime)


def test_the_load_of_a_fleet_of_ones_own_is_only_told(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At --speed max nothing fails by it."""
    monkeypatch.chdir(run.parent)
    (run.parent / "runs").symlink_to(run.parent)
    monkeypatch.setattr(os, "getloadavg", lambda: (99.0, 0.0, 0.0))
    assert next(iter(general.processors())).level == "note"


def test_doctor_names_libraries_that_are_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the extra that brings them; those of development are nobody's business."""
    wanted = ["nowhere-to-be>=1; extra == 'executor'", "not-this>=2; extra == 'dev'", "msgspec"]
    monkeypatch.setattr("importlib.metadata.requires", lambda _: wanted)
    (check,) = checkup.CHECKS.machine["libraries"]()
    assert check.what == "not installed: nowhere-to-be"
    assert "[executor]" in check.remedy
    (check,) = general.imports(("nowhere_to_be",))
    assert check.level == "wrong"
    assert "nowhere_to_be" in check.what


@pytest.mark.parametrize(
    ("room", "check", "package"),
    [
        (general, general.explorer, "topdown.prove.compiled"),
        (checkup, checkup.library, "velma.compiled"),
    ],
)
def test_doctor_says_whether_a_library_in_c_is_built(
    room: ModuleType, check: Checking, package: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without it nothing fails: a note with the command that builds it."""
    monkeypatch.setattr(room.compiled, "library", object)
    assert [one.level for one in check()] == ["fine"]
    monkeypatch.setattr(room.compiled, "library", lambda: None)
    (missing,) = check()
    assert (missing.level, package in missing.what) == ("note", True)
    assert f"`python -m {package}`" in missing.remedy
