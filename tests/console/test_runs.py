"""`roco runs`: what is listed of real fleets that are up, ended or died, and what a rule
removes.
"""

import json
import os
import socket
import subprocess
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import calling
import msgspec
import pytest

from console.errors import UsageError
from console.runs.catalogue import Run, age, catalogue, size, span, words_of
from operate.file_names import FLEET_FILE, LATEST, REPORT_FILE
from operate.fleet_file import Fleet, ProcessState, ProcessStatus

NOW = 1_700_000_000.0
DAY = 86400.0
ENDED = (ProcessStatus("ox", ProcessState.STOPPED),)
LOST = ProcessStatus("ox", ProcessState.READY, 4_000_000, module="depot.ox")
Told = list[Run]


def kept(
    folder: Path, name: str, days: float = 0.0, processes: Any = ENDED, **more: object
) -> Path:
    """Make the folder of a run that began that many days before NOW and took a minute."""
    run = folder / name
    run.mkdir(parents=True)
    fleet = Fleet("depot", "tcp/127.0.0.1:1", 0, NOW - days * DAY, processes)
    (run / FLEET_FILE).write_bytes(msgspec.json.encode(fleet))
    os.utime(run / FLEET_FILE, (fleet.started + 60.0,) * 2)
    if more:
        (run / REPORT_FILE).write_text(json.dumps(more))
    return run


def roco(folder: Path, *words: str, code: int = 0) -> str:
    """Return the output of `roco runs` in this folder; its exit code must be `code`."""
    return calling.roco("runs", *words, "--in", folder, columns=200, code=code).output


def listed(folder: Path) -> dict[str, Run]:
    """The list, for programs, by name."""
    found = msgspec.json.decode(roco(folder, "--format", "json"), type=Told)
    return {one.name: one for one in found}


@pytest.fixture
def up(tmp_path: Path, called: Callable[..., int]) -> Path:
    """A folder whose run has a process that lives, and no supervisor."""
    pid = called("depot.ox")
    kept(tmp_path, "up", 30.0, (ProcessStatus("ox", ProcessState.READY, pid, module="depot.ox"),))
    return tmp_path


def test_a_run_is_told_with_begin_duration_and_system(tmp_path: Path) -> None:
    """Newest first, with the newest marked where runs/latest points to it."""
    kept(tmp_path, "old", 2.0)
    kept(tmp_path, "new", 1.0)
    (tmp_path / LATEST).symlink_to("new")
    found = listed(tmp_path)
    assert list(found) == ["new", "old"]
    old = found["old"]
    assert (old.begin, old.duration_s, old.system) == (NOW - 2 * DAY, 60.0, "depot")
    assert [one.latest for one in found.values()] == [True, False]
    assert "new (latest)" in roco(tmp_path)


@pytest.mark.parametrize(
    ("processes", "report", "result", "why"),
    [
        (ENDED, {"success": True}, "success", ""),
        (ENDED, {"success": False, "failure": "the jar fell"}, "failed", "the jar fell"),
        (ENDED, {"success": None}, "ended", ""),
        (ENDED, {}, "ended", ""),
        ((ProcessStatus("ox", ProcessState.GIVEN_UP),), {}, "failed", "given up: ox"),
        ((LOST,), {}, "failed", "died without"),
    ],
)
def test_the_result_of_a_run(
    tmp_path: Path,
    processes: tuple[ProcessStatus, ...],
    report: dict[str, object],
    result: str,
    why: str,
) -> None:
    """By its report, else by how its processes ended."""
    kept(tmp_path, "run", 1.0, processes, **report)
    one = listed(tmp_path)["run"]
    assert one.result == result
    assert why in one.why


POURED = {"asked": "pour into jar bowl", "success": True, "failure": None}
TAKEN = {"asked": "take jar", "success": True, "failure": None}
NOT_TAKEN = {"asked": "take cup", "success": False, "failure": "there is no cup"}
ANOTHER = {"success": False, "failure": "nobody asked to pour, but to take jar"}


@pytest.mark.parametrize(
    ("report", "result"),
    [
        ({"success": True, "tasks": [POURED, NOT_TAKEN]}, "success"),
        (ANOTHER | {"tasks": [TAKEN]}, "success"),
        (ANOTHER | {"tasks": [TAKEN, NOT_TAKEN]}, "failed"),
        ({"success": False, "failure": "no command of a person was heard", "tasks": []}, "failed"),
    ],
)
def test_a_run_lists_its_tasks_and_failed_only_if_one_did(
    tmp_path: Path, report: dict[str, object], result: str
) -> None:
    """A run in which all was done as asked is not removed as failed, also where it is not the
    system's main job.
    """
    kept(tmp_path, "run", 1.0, **report)
    assert listed(tmp_path)["run"].result == result
    said = roco(tmp_path)
    for task in report["tasks"]:  # type: ignore[attr-defined]
        assert f"{task['asked']}: {task['failure'] or 'done'}" in said
    roco(tmp_path, "--remove", "--failed")
    assert (tmp_path / "run").exists() == (result != "failed")


def test_the_size_is_that_on_disk(tmp_path: Path) -> None:
    """As du counts it: blocks, a link's target not at all."""
    run = kept(tmp_path, "run")
    (run / "traffic.mcap").write_bytes(b"x" * 1_000_000)
    (run / "away").symlink_to("/usr/bin")
    counted = int(subprocess.check_output(["du", "-s", "--block-size=1", run]).split()[0])
    assert size(run) == listed(tmp_path)["run"].bytes == counted >= 1_000_000


def test_a_folder_that_no_fleet_wrote_is_not_a_run(tmp_path: Path) -> None:
    """It is neither listed nor removed, even by its name."""
    kept(tmp_path, "run", 100.0)
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter.tex").touch()
    assert list(listed(tmp_path)) == ["run"]
    assert "no run 'thesis'" in roco(tmp_path, "--remove", "thesis", code=2)
    roco(tmp_path, "--remove", "--keep", "0")
    assert [path.name for path in tmp_path.iterdir()] == ["thesis"]


def test_a_recording_without_a_fleet_is_a_run_too(tmp_path: Path) -> None:
    """It began when its folder's name says; how long it took nobody tells."""
    (tmp_path / "2026-01-31_12-00-00").mkdir()
    (tmp_path / "2026-01-31_12-00-00" / "traffic.mcap").touch()
    (one,) = listed(tmp_path).values()
    assert (one.result, one.duration_s) == ("unknown", None)
    assert "2026-01-31 12:00:00" in roco(tmp_path)


def test_without_a_run_it_says_what_would_be_right(tmp_path: Path) -> None:
    """Exit code 3: there is nothing to ask."""
    assert "no run is in" in roco(tmp_path, code=3)


def test_what_is_up_is_never_removed(up: Path) -> None:
    """By a rule it is passed over, by its name it is refused, and nothing else goes either."""
    kept(up, "other", 40.0)
    assert listed(up)["up"].result == "up"
    said = roco(up, "--remove", "up", "other", code=2)
    assert "up is up (1 process, and no supervisor); `roco down" in said
    assert (up / "other").exists()
    roco(up, "--remove", "--older-than", "1d")
    assert [path.name for path in up.iterdir()] == ["up"]


def test_a_replay_that_goes_on_is_up(tmp_path: Path) -> None:
    """It has neither supervisor nor processes: its router is asked."""
    with closing(socket.create_server(("127.0.0.1", 0))) as router:
        run = kept(tmp_path, "replay", 1.0, ())
        fleet = Fleet("replay", f"tcp/127.0.0.1:{router.getsockname()[1]}", 0, NOW, ())
        (run / FLEET_FILE).write_bytes(msgspec.json.encode(fleet))
        assert listed(tmp_path)["replay"].up
    assert not listed(tmp_path)["replay"].up


@pytest.mark.parametrize(
    ("words", "gone"),
    [
        (["--older-than", "2d"], {"c", "d"}),
        (["--keep", "1"], {"b", "c", "d"}),
        (["--keep", "3"], {"d"}),
        (["--failed"], {"b", "d"}),
        (["--failed", "--older-than", "2d"], {"d"}),
        (["--older-than", "36h", "--keep", "3"], {"d"}),
        (["a", "c"], {"a", "c"}),
        (["latest"], {"a"}),
        (["a", "d", "--failed"], {"d"}),
    ],
)
def test_a_rule_removes_what_fits_all_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], gone: set[str]
) -> None:
    """Runs of 0.5, 1.5, 2.5 and 3.5 days; b and d failed. Without --remove they are listed, and
    nothing goes.
    """
    for name, days in {"a": 0.5, "b": 1.5, "c": 2.5, "d": 3.5}.items():
        kept(tmp_path, name, days, success=name in "ac")
    (tmp_path / LATEST).symlink_to("a")
    monkeypatch.setattr(time, "time", lambda: NOW)
    before = listed(tmp_path)
    told = json.loads(roco(tmp_path, *words, "--format", "json"))
    assert {path.name for path in tmp_path.iterdir()} == {*before, LATEST}
    assert {one["name"] for one in told} == gone
    said = roco(tmp_path, "--remove", *words)
    left = {path.name for path in tmp_path.iterdir()} - {LATEST}
    assert left == before.keys() - gone
    assert (tmp_path / LATEST).is_symlink() == ("a" in left)
    assert f"; freed {words_of([before[name] for name in gone])}" in said
    assert "no run fits" in roco(tmp_path, "--older-than", "9d")


@pytest.mark.parametrize(
    "words",
    [[], ["--older-than", "7"], ["--older-than", "7y"], ["--older-than", "-1d"], ["nobody"]],
)
def test_a_removal_that_is_not_clear_is_refused(tmp_path: Path, words: list[str]) -> None:
    """Exit code 2, and nothing goes; without a rule nothing is meant, rather than all."""
    kept(tmp_path, "run", 100.0, success=False)
    roco(tmp_path, "--remove", *words, code=2)
    assert [one.name for one in catalogue(tmp_path)] == ["run"]


def test_durations() -> None:
    """Durations are parsed in each allowed form, and a run's duration is printed in words."""
    ages = {"90s": 90.0, "30min": 1800.0, "12h": 43200.0, "7d": 604800.0, "2w": 1209600.0}
    assert {text: age(text) for text in ages} == ages
    spans = {4.4: "4 s", 185.0: "3 min 05 s", 7810.0: "2 h 10 min"}
    assert {seconds: span(seconds) for seconds in spans} == spans
    with pytest.raises(UsageError, match="7d"):
        age("seven days")
