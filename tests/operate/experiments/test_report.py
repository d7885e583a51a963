"""The report of an experiment: its tables count the lines, its page needs nothing else, its tables
read back.
"""

from pathlib import Path

import msgspec
import pytest
from planted import runs, said, written
from pyarrow import csv, parquet

from companion.sentences import happened
from companion.telemetry import RobotState
from companion.tools.report import measures
from companion.tools.report.measures import MEASURES, PourFigures
from companion.tools.report.report import PAPER
from companion.tools.system import SYSTEM
from companion.tools.telemetry import every
from operate.experiments import page, results, summary, tables
from operate.experiments.results import NothingHere
from operate.experiments.run_figures import RESULTS_FILE, Result
from operate.recording.index import NoRecordingError
from operate.recording.run import opened
from operate.reports import report
from operate.reports.counts import Latency, Spans

POUR = Path(__file__).parents[2] / "histories" / "pour_seed_7"


def test_the_summary_counts_the_lines(tmp_path: Path) -> None:
    """Success over all runs, figures over the successful ones, the paper's beside them."""
    told = summary.summed(runs(failing=[2, 9]))
    assert (told.runs, told.success.value) == (30, 28 / 30)
    assert [one.seed for one in told.failures] == [2, 9]
    rows = {row.name: row for row in told.rows}
    theirs = PAPER.times["finished"] - PAPER.times["command-received"]
    assert rows["command to end"].published == theirs
    figures = [one.figures for one in runs(failing=[2, 9]).results if one.success]
    good = [one.energy_J for one in figures if one]
    energy = rows["energy of the body's joints"]
    assert energy.mean.value == pytest.approx(sum(x for x in good if x is not None) / 28)
    assert (energy.mean.n, energy.least, energy.largest) == (28, min(good), max(good))  # type: ignore[type-var]
    assert rows["plan 1: mean bandwidth of C4"].published == 32


def test_tables_7_and_8_have_every_row_of_the_paper() -> None:
    """Ours with intervals; what never happened in our runs stays, empty."""
    told = summary.summed(runs())
    names = {row.name: row for row in told.events}
    assert {happened(one.event, one.of) for one in PAPER.time} <= set(names)
    assert names["finished"].runs == 30
    assert names["finished"].t is not None
    assert names["jar grasped"].t is None
    cell = told.matrix["km"]["pl"]
    assert (cell.published, cell.mean.value) == (730, pytest.approx(117.0))
    assert told.matrix["pl"]["km"].mean.low == told.matrix["pl"]["km"].mean.high == 116
    assert told.matrix["km"]["sent"].published == sum(PAPER.matrix["km"].values())


def test_all_of_it_is_made_of_a_folder_of_lines(tmp_path: Path) -> None:
    """One page that needs nothing from elsewhere, below 500 kB; JSON, text and Parquet say the
    same.
    """
    place = written(tmp_path / "mine", runs(failing=[2]))
    made = page.everything(place)
    assert (made.runs, made.success) == (30, 29 / 30)
    assert made.lines[0].startswith("29 of 30 runs poured: 97 %, 95 % interval 83 … 99 %")
    assert "seed 2: the jar fell" in made.lines[1]
    html = (place / "report.html").read_text()
    assert len(html) < 500_000
    assert html.count("<svg") == 4
    assert "29 of 30 runs poured" in html
    assert "the jar fell" in html
    outside = html.replace("http://www.w3.org", "")
    assert "http" not in outside
    assert "src=" not in outside
    told = msgspec.json.decode((place / "report.json").read_bytes(), type=summary.Summary)
    assert told.success.value == 29 / 30
    assert "| energy of the body's joints [J] |" in (place / "report.md").read_text()
    table = parquet.read_table(place / "runs.parquet")
    assert table.num_rows == 30
    assert sum(table["success"].to_pylist()) == 29


def test_what_was_said_reads_back(tmp_path: Path) -> None:
    """Each row of each seed, in order."""
    by_seed = {seed: said(seed) for seed in (3, 1)}
    tables.write_said(tmp_path / "said.parquet", by_seed)
    assert tables.said_in(tmp_path / "said.parquet") == by_seed


def test_an_experiment_without_recordings_still_has_a_report(tmp_path: Path) -> None:
    """The figures that need what was said are left out, and the page says so."""
    place = written(tmp_path / "mine", msgspec.structs.replace(runs(), said={}))
    (place / results.SAID_FILE).unlink()
    page.everything(place)
    assert "What was said was not kept." in (place / "report.html").read_text()


def test_lines_of_a_killed_experiment_are_read_as_far_as_they_go(tmp_path: Path) -> None:
    """A line cut off is left out; of a seed that stands there twice the first counts; a run without
    a report is one.
    """
    place = written(tmp_path / "mine", runs(range(1, 4)))
    file = place / RESULTS_FILE
    lost = msgspec.json.encode(Result(9, "no report", None))
    twice = msgspec.json.encode(Result(1, "another", None))
    file.write_bytes(file.read_bytes() + lost + b"\n" + twice + b"\n" + b'{"seed": 10, "fail')
    found = results.load(place)
    assert [one.seed for one in found.results] == [1, 2, 3, 9]
    assert [one.success for one in found.results] == [True, True, True, False]
    assert summary.summed(found).failures[0].why == "no report"


def test_lines_of_another_version_are_read(tmp_path: Path) -> None:
    """A figure that is not there yet is left out, one that is not known any more is passed over."""
    place = written(tmp_path / "mine", runs(range(1, 4)))
    file = place / RESULTS_FILE
    older = [msgspec.json.decode(line) for line in file.read_bytes().splitlines()]
    for line in older:
        del line["figures"]["energy_J"]
        line["figures"]["colour"] = "red"
    file.write_bytes(b"".join(msgspec.json.encode(line) + b"\n" for line in older))
    rows = {row.name for row in summary.summed(results.load(place)).rows}
    assert "command to end" in rows
    assert "energy of the body's joints" not in rows


@pytest.mark.parametrize(("count", "named"), [(99, False), (100, True)])
def test_the_99_of_a_hundred_are_of_runs_that_have_a_hundred(count: int, named: bool) -> None:
    """Older reports have that figure of two answers, too; the longest is told of all."""

    def answered(one: PourFigures) -> PourFigures:
        row = Latency("C3", "generate_plan", 15000.0, Spans(count, 6.0, p99=10.0, max=11.0))
        return msgspec.structs.replace(one, latency=(row,))

    rows = {row.name for row in summary.summed(runs(change=answered)).rows}
    assert ("generate_plan: answer, 99 % within" in rows) == named
    assert {f"generate_plan: answer, {part}" for part in ("half within", "longest")} <= rows


def test_a_recorded_run_fills_every_table() -> None:
    """Of a real run, by itself: figures without intervals, both drawn, both tables as its own
    report has them.
    """
    one = results.load(POUR)
    told = summary.summed(one)
    assert {row.mean.low for row in told.rows} == {None}
    happened = {"jar grasped", "bowl put down", "jar poured into bowl"}
    assert {row.name for row in told.events if row.runs} >= happened
    assert sum(cell["sent"].mean.value for cell in told.matrix.values() if "sent" in cell) == 420
    assert sum(cell.mean.value for cell in told.matrix["received"].values()) == 420
    assert "<svg" in page.sizes(one)
    assert "peak 150 kbit/s" not in page.sizes(one)
    assert "data:image/png;base64" in page.sizes(one)
    assert measures.planning(one, 1)
    assert measures.planning(one, 3) == ""
    assert "plan 1: peak bandwidth of C4, in steps of 1 s" in {row.name for row in told.rows}
    assert page.markdown(told, MEASURES).count("\n| jar grasped |") == 1


def test_a_recording_is_exported_as_tables(tmp_path: Path) -> None:
    """Communicates, events, telemetry: the rows of the recording, the same in both formats."""
    past = opened(POUR / "traffic.mcap", SYSTEM).history
    made = tables.of_history(past, SYSTEM)
    assert {name: table.num_rows for name, table in made.items()} == {
        "communicates": len(past.said), "states": len(report.busy(past)), "events": 19,
        "telemetry": len(every(past, RobotState)),
    }  # fmt: skip
    assert sum(made["communicates"]["size"].to_pylist()) == sum(one.size for one in past.said)
    assert made["telemetry"]["work_J"].to_pylist()[-1] == every(past, RobotState)[-1][1].work_J
    assert (
        made["telemetry"]["torso_0_joint"].to_pylist()[0] == every(past, RobotState)[0][1].body[0]
    )
    for to in tables.FORMATS:
        files = tables.write(made, tmp_path, to)
        assert [file.name for file in files] == [f"{name}.{to}" for name in made]
    assert parquet.read_table(tmp_path / "communicates.parquet").equals(made["communicates"])
    assert csv.read_csv(tmp_path / "telemetry.csv").num_rows == made["telemetry"].num_rows
    with pytest.raises(ValueError, match="give parquet or csv"):
        tables.write(made, tmp_path, "xls")


def test_what_holds_nothing_is_named(tmp_path: Path) -> None:
    """An empty folder, a file that is not there, an experiment without a line."""
    with pytest.raises(NothingHere, match="holds no runs; give an experiment's folder"):
        results.load(tmp_path)
    why = "none is not there; give a run folder, or a recording"
    with pytest.raises(NoRecordingError, match=why):
        opened(tmp_path / "none", SYSTEM)
    with pytest.raises(NothingHere, match="`roco experiment` makes one"):
        page.everything(tmp_path)
    (tmp_path / RESULTS_FILE).touch()
    with pytest.raises(NothingHere, match="--resume"):
        page.everything(tmp_path)


def test_a_folder_of_runs_is_a_set(tmp_path: Path) -> None:
    """Each folder in it is a run; `latest` is none; where seeds are alike, runs are numbered."""
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "traffic.mcap").symlink_to(POUR / "traffic.mcap")
    (tmp_path / "latest").symlink_to("two")
    found = results.load(tmp_path)
    assert [one.seed for one in found.results] == [1, 2]
    assert set(found.said) == {1, 2}
