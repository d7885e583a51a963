"""`roco compare`, `roco report`, `roco export`: exit codes, and what people and programs are
shown.
"""

from pathlib import Path

import msgspec
import pytest
from calling import POUR, printed, roco

from console.runs import report
from console.terminal.console import Console
from operate.experiments.comparing import Compared, Diverged, Divergence, Verdict
from operate.experiments.intervals import Interval
from operate.experiments.run_figures import SentMessage


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
