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
from calling import POUR, printed, roco

from console.errors import UsageError
from console.runs import report
from console.runs.catalogue import Run, age, catalogue, size, span, words_of
from console.terminal.console import Console
from operate.experiments.comparing import Compared, Diverged, Divergence, Verdict
from operate.experiments.intervals import Interval
from operate.experiments.run_figures import SentMessage
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


def runs_in(folder: Path, *words: str, code: int = 0) -> str:
    """Return the output of `roco runs` in this folder; its exit code must be `code`."""
    return calling.roco("runs", *words, "--in", folder, columns=200, code=code).output


def listed(folder: Path) -> dict[str, Run]:
    """The list, for programs, by name."""
    found = msgspec.json.decode(runs_in(folder, "--format", "json"), type=Told)
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
    assert "new (latest)" in runs_in(tmp_path)


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
    said = runs_in(tmp_path)
    for task in report["tasks"]:  # type: ignore[attr-defined]
        assert f"{task['asked']}: {task['failure'] or 'done'}" in said
    runs_in(tmp_path, "--remove", "--failed")
    assert (tmp_path / "run").exists() == (result != "failed")


def test_it_is_counted_how_many_tasks_came_to_which_end(tmp_path: Path) -> None:
    """By the truth where it is known: what was done only by the robot's word failed."""
    said = {"failed": 2, "cancelled": 2, "done": 1, "refused": 1, "": 1}
    tasks = [
        NOT_TAKEN | {"outcome": outcome} for outcome, times in said.items() for _ in range(times)
    ]
    kept(tmp_path, "run", 1.0, success=False, tasks=[TAKEN, POURED, *tasks])
    assert "2 done, 3 failed, 2 cancelled, 1 refused, 1 not ended" in runs_in(tmp_path)


def test_a_narrow_terminal_cuts_nothing_off(tmp_path: Path) -> None:
    """In 80 columns a reason and a task have the full width, below the run's line."""
    why = "nobody asked to pour, but to take the jar, which no look around had told of before"
    kept(tmp_path, "2026-01-31_12-00-00", 1.0, success=False, failure=why, tasks=[NOT_TAKEN])
    said = calling.roco("runs", "--in", tmp_path, columns=80, code=0).output
    assert max(map(len, said.splitlines())) <= 80
    assert f"\n    {why[:60]}" in said
    assert why in " ".join(said.split())
    assert "\n    take cup: there is no cup" in said


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
    assert "no run 'thesis'" in runs_in(tmp_path, "--remove", "thesis", code=2)
    runs_in(tmp_path, "--remove", "--keep", "0")
    assert [path.name for path in tmp_path.iterdir()] == ["thesis"]


def test_a_recording_without_a_fleet_is_a_run_too(tmp_path: Path) -> None:
    """It began when its folder's name says; how long it took nobody tells."""
    (tmp_path / "2026-01-31_12-00-00").mkdir()
    (tmp_path / "2026-01-31_12-00-00" / "traffic.mcap").touch()
    (one,) = listed(tmp_path).values()
    assert (one.result, one.duration_s) == ("unknown", None)
    assert "2026-01-31 12:00:00" in runs_in(tmp_path)


def test_without_a_run_it_says_what_would_be_right(tmp_path: Path) -> None:
    """Exit code 3: there is nothing to ask."""
    assert "no run is in" in runs_in(tmp_path, code=3)


def test_what_is_up_is_never_removed(up: Path) -> None:
    """By a rule it is passed over, by its name it is refused, and nothing else goes either."""
    kept(up, "other", 40.0)
    assert listed(up)["up"].result == "up"
    said = runs_in(up, "--remove", "up", "other", code=2)
    assert "up is up (1 process, and no supervisor); `roco down" in said
    assert (up / "other").exists()
    runs_in(up, "--remove", "--older-than", "1d")
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
    told = json.loads(runs_in(tmp_path, *words, "--format", "json"))
    assert {path.name for path in tmp_path.iterdir()} == {*before, LATEST}
    assert {one["name"] for one in told} == gone
    said = runs_in(tmp_path, "--remove", *words)
    left = {path.name for path in tmp_path.iterdir()} - {LATEST}
    assert left == before.keys() - gone
    assert (tmp_path / LATEST).is_symlink() == ("a" in left)
    assert f"; freed {words_of([before[name] for name in gone])}" in said
    assert "no run fits" in runs_in(tmp_path, "--older-than", "9d")


@pytest.mark.parametrize(
    "words",
    [[], ["--older-than", "7"], ["--older-than", "7y"], ["--older-than", "-1d"], ["nobody"]],
)
def test_a_removal_that_is_not_clear_is_refused(tmp_path: Path, words: list[str]) -> None:
    """Exit code 2, and nothing goes; without a rule nothing is meant, rather than all."""
    kept(tmp_path, "run", 100.0, success=False)
    runs_in(tmp_path, "--remove", *words, code=2)
    assert [one.name for one in catalogue(tmp_path)] == ["run"]


def test_durations() -> None:
    """Durations are parsed in each allowed form, and a run's duration is printed in words."""
    ages = {"90s": 90.0, "30min": 1800.0, "12h": 43200.0, "7d": 604800.0, "2w": 1209600.0}
    assert {text: age(text) for text in ages} == ages
    spans = {4.4: "4 s", 185.0: "3 min 05 s", 7810.0: "2 h 10 min"}
    assert {seconds: span(seconds) for seconds in spans} == spans
    with pytest.raises(UsageError, match="7d"):
        age("seven days")


# --- `roco compare`, `roco report`, `roco export`: exit codes, and what people and programs are
# shown.


def experiment(place: Path, factor: float = 1.0, lost: int = 0) -> Path:
    """An experiment's folder: twenty runs with energies around a mean, the first ones failed."""
    place.mkdir()
    lines = [
        {
            "seed": seed,
            "failure": "the jar fell" if seed <= lost else None,
            "figures": {"success": seed > lost, "energy_J": factor * (600.0 + seed), "began": 1.0},
        }
        for seed in range(1, 21)
    ]
    (place / "results.jsonl").write_bytes(b"\n".join(map(msgspec.json.encode, lines)))
    return place


@pytest.mark.timeout(180)
def test_a_regression_is_said_and_ends_with_1(tmp_path: Path) -> None:
    """Energy by name, with its threshold; the same set alone passes; a wide threshold passes,
    too.
    """
    before, after = experiment(tmp_path / "before"), experiment(tmp_path / "after", 1.3)
    out = roco("compare", str(before), str(after), code=1).stdout
    assert "regression: energy of the body's joints (threshold 10)" in out
    assert "+30.0" in out
    roco("compare", str(before), str(after), "--threshold", "energy=40", code=0)
    roco("compare", str(after), str(before), code=0)


def test_lost_runs_are_named(tmp_path: Path) -> None:
    """Half of them failed: exit code 1, the first seeds and why."""
    before, after = experiment(tmp_path / "a"), experiment(tmp_path / "b", lost=10)
    out = roco("compare", before, after, code=1).stdout
    assert "seed 1 succeeded in A and not in B: the jar fell" in out
    assert "regression: success (threshold 5)" in out


def test_two_recordings_for_programs() -> None:
    """A folder and the file in it are the same run."""
    told = printed("compare", POUR, POUR / "traffic.mcap")
    assert (told["regression"], told["runs"]) == (False, [1, 1])
    assert told["diverged"] == [{"seed": 7, "first": None}]


@pytest.mark.timeout(180)
def test_what_is_no_set_of_runs_is_wrong_use(tmp_path: Path) -> None:
    """Exit code 2 and what would be right, also for a threshold that is none."""
    error = roco("compare", str(tmp_path), str(POUR), code=2).stderr
    assert "give an experiment's folder" in error
    error = roco("compare", str(POUR), str(POUR), "--threshold", "speed=3", code=2).stderr
    assert "success, latency, energy, traffic" in error


def test_a_unit_and_an_interval_are_shown() -> None:
    """Brackets would be taken for markup."""
    sides = (Interval(48.0, None, None, 3), Interval(50.0, None, None, 3))
    row = Compared(
        "command to end", "latency", "s", *sides, None, 4.2, -1.0, 9.4, 10.0, Verdict.SAME
    )
    console = Console(width=80, color_system=None)
    with console.capture() as text:
        console.print(report.quantities((row,)))
    assert "command to end, s" in text.get()
    assert "-1.0 … +9.4" in text.get()


def test_the_first_difference_is_shown_in_words() -> None:
    """The conversation, the communicate, and each side's words at the first difference are
    shown.
    """
    said = SentMessage(
        1.5, "C6", "ta", "km", "subscribe", "inform", "km-1-1", "SeenObject", 300, "seen jar"
    )
    first = Divergence("km to ta, subscribe", 1, 3, said, None)
    lines = report.divergences((Diverged(4, first), Diverged(5, None)))
    assert lines[0].startswith("what was said differs in 1 of 2 seeds")
    assert "seed 4: km to ta, subscribe, conversation 1, communicate 3" in lines[1]
    assert lines[2].endswith("A: 1.50 s  ta > km  inform  seen jar")
    assert lines[3].endswith("B: nothing more")
    assert report.divergences((Diverged(4, None),)) == ["the same was said in 1 run of each side"]


@pytest.mark.parametrize("form", ["text", "json"])
def test_a_report_is_made_of_a_recording_alone(form: str) -> None:
    """Nothing is written; success ends with 0."""
    before = sorted(POUR.iterdir())
    out = roco("report", POUR / "traffic.mcap", "--format", form, code=0).stdout
    assert sorted(POUR.iterdir()) == before
    if form == "json":
        assert msgspec.json.decode(out)["communicates"]["total"] == 420
    else:
        assert "success; seed 7, speed 1" in out
        assert "plan 1       " in out
        assert "written:" not in out


@pytest.mark.timeout(180)
def test_a_report_goes_where_it_is_wanted_and_overwrites_no_recording(tmp_path: Path) -> None:
    """report.json, report.html and run.rrd beside a copy of the recording."""
    words = ("report", POUR / "traffic.mcap", "--out", tmp_path / "again")
    assert "written:" in roco(*words, code=0).stdout
    made = {path.name for path in (tmp_path / "again").iterdir()}
    assert {"report.json", "report.html", "run.rrd", "traffic.mcap"} <= made
    assert "another --out" in roco(*words, code=2).stderr


@pytest.mark.timeout(180)
def test_tables_are_written(tmp_path: Path) -> None:
    """Each table is reported with its number of rows."""
    told = printed("export", POUR, "--to", "csv", "--out", tmp_path)
    assert {Path(one["file"]).name: one["rows"] for one in told} == {
        "communicates.csv": 420, "states.csv": 81, "events.csv": 19, "telemetry.csv": 172,
    }  # fmt: skip
    assert (tmp_path / "communicates.csv").read_text().count("\n") == 421
    roco("export", str(tmp_path), "--out", str(tmp_path), code=2)
