"""`roco experiment`: interrupted it goes on, a run that hangs is ended, what does not work at all
is not repeated.
"""

import signal
import subprocess
import sys
from collections.abc import Callable
from io import StringIO
from pathlib import Path

import msgspec
import pytest
from typer.testing import CliRunner

from console.__main__ import app
from console.errors import ConsoleError, UsageError
from console.fleet import starting
from console.output import Format
from console.runs import experiment
from console.terminal.console import Console
from operate.experiments.run_figures import RESULTS_FILE
from operate.file_names import REPORT_FILE

pytestmark = pytest.mark.process

Play = Callable[[int], str]
POURED = '{"success": true, "failure": null, "energy_J": 1.0, "seed": 1, "began": 1.0}'
MISSED = '{"success": false, "failure": "the jar fell"}'
HANGS = "import time; time.sleep(60)"


def setting(**changed: object) -> experiment.Setting:
    """Three runs from seed 1 on."""
    return msgspec.structs.replace(
        experiment.setting_here("pour", ("demo",), experiment.Asked(3, 1, "max", None, 20.0, 0.0)),
        **changed,
    )


@pytest.fixture
def played(monkeypatch: pytest.MonkeyPatch) -> Callable[[Play], list[int]]:
    """In place of the demo start a program of Python, chosen by the seed; the seeds that were
    played.
    """
    seeds: list[int] = []

    def by(play: Play) -> list[int]:
        def start(place: Path, setting: experiment.Setting, seed: int) -> subprocess.Popen[bytes]:
            seeds.append(seed)
            command = [sys.executable, "-c", play(seed)]
            with (place / experiment.LOG_FILE).open("ab") as log:
                return subprocess.Popen(command, cwd=place, stdout=log, stderr=log)

        monkeypatch.setattr(experiment, "_start", start)
        return seeds

    return by


def leaves(report: str, code: int = 0) -> str:
    """A demo that leaves this report and ends."""
    return f"open({REPORT_FILE!r}, 'w').write({report!r}); raise SystemExit({code})"


def run_all(
    place: Path, wanted: experiment.Setting, resume: bool = False, form: Format = Format.TEXT
) -> str:
    """The verb without its report; what it printed."""
    console = Console(file=StringIO(), width=100)
    now, done = experiment.begun(place, wanted, resume)
    experiment._all(place, now, experiment.Watch(now, done, form, console))
    return console.file.getvalue()  # type: ignore[attr-defined]


def test_each_run_leaves_a_line(tmp_path: Path, played: Callable[[Play], list[int]]) -> None:
    """With its seed, why it failed, its report in a line, and the estimate of what is left."""
    played(lambda seed: leaves(MISSED, 1) if seed == 2 else leaves(POURED))
    said = run_all(tmp_path, setting())
    lines = experiment.lines(tmp_path)
    found = [(one.seed, one.failure, one.exit) for one in lines]
    assert found == [(1, None, 0), (2, "the jar fell", 1), (3, None, 0)]
    assert msgspec.json.decode(lines[0].figures)["energy_J"] == 1.0
    assert len((tmp_path / RESULTS_FILE).read_bytes().splitlines()) == 3
    assert "run 2 of 3, seed 2: FAILED: the jar fell" in said
    assert said.splitlines()[0].endswith("left")


def test_an_interrupted_experiment_goes_on(
    tmp_path: Path, played: Callable[[Play], list[int]]
) -> None:
    """A run with a line is not repeated; one that was under way is, in a clean folder; more runs
    may be asked for.
    """
    seeds = played(lambda seed: leaves(POURED))
    run_all(tmp_path, setting(runs=2))
    whole = (tmp_path / RESULTS_FILE).read_bytes()
    # a kill in the middle of the second line
    (tmp_path / RESULTS_FILE).write_bytes(whole[:-20])
    left = experiment.folder(tmp_path, 2) / "left over"
    left.touch()
    with pytest.raises(UsageError, match="--resume"):
        experiment.begun(tmp_path, setting(), resume=False)
    run_all(tmp_path, setting(runs=4), resume=True)
    assert seeds == [1, 2, 2, 3, 4]
    assert sorted(one.seed for one in experiment.lines(tmp_path)) == [1, 2, 3, 4]
    assert not left.exists()
    assert experiment.setting(tmp_path).runs == 4


def test_of_a_seed_that_stands_there_twice_the_first_line_counts(tmp_path: Path) -> None:
    """Two experiments at once in one folder do not choose the better run."""
    for failure in ("the jar fell", None):
        experiment.append_line(
            tmp_path / experiment.RESULTS_FILE,
            experiment.Line(1, 1.0, 60.0, 0, False, (1.0, 1.0), failure, msgspec.Raw(b"null")),
        )
    assert [one.failure for one in experiment.lines(tmp_path)] == ["the jar fell"]


@pytest.mark.parametrize("changed", [{"seed": 2}, {"speed": "1"}, {"scene": "other.toml"}])
def test_another_experiment_does_not_go_on_in_its_folder(
    tmp_path: Path, changed: dict[str, object]
) -> None:
    """Runs of two settings in one table would say nothing."""
    experiment.begun(tmp_path, setting(), resume=False)
    with pytest.raises(UsageError, match=next(iter(changed))):
        experiment.begun(tmp_path, setting(**changed), resume=True)


def test_a_run_that_hangs_is_ended_and_counts_as_a_failure(
    tmp_path: Path, played: Callable[[Play], list[int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also one that does not listen to Ctrl-C; the others go on."""
    deaf = f"import signal; signal.signal({int(signal.SIGINT)}, signal.SIG_IGN); {HANGS}"
    played(lambda seed: {1: HANGS, 2: deaf}.get(seed, leaves(POURED)))
    monkeypatch.setattr(experiment, "END_S", 0.5)
    run_all(tmp_path, setting(runs=2, timeout_s=3.0))
    run_all(tmp_path, setting(timeout_s=50.0), resume=True)
    lines = experiment.lines(tmp_path)
    assert [one.timed_out for one in lines] == [True, True, False]
    assert [one.failure for one in lines] == ["not ended after 3 s", "not ended after 3 s", None]
    assert lines[1].exit == -signal.SIGKILL


def test_where_nothing_works_it_stops(tmp_path: Path, played: Callable[[Play], list[int]]) -> None:
    """After three runs without a report, with the last words of the demo."""
    seeds = played(lambda seed: "raise SystemExit('no space left')")
    with pytest.raises(ConsoleError, match=r"3 runs in a row left no report.*no space left"):
        run_all(tmp_path, setting(runs=30))
    assert seeds == [1, 2, 3]


def test_a_report_of_success_and_a_bad_exit_is_no_success(
    tmp_path: Path, played: Callable[[Play], list[int]]
) -> None:
    """Something went wrong after the pour."""
    played(lambda seed: leaves(POURED, 1))
    run_all(tmp_path, setting(runs=1))
    assert experiment.lines(tmp_path)[0].failure == "`roco demo` ended with 1"


def test_for_programs_each_run_is_a_line_of_json(
    tmp_path: Path, played: Callable[[Play], list[int]]
) -> None:
    """With what is left in seconds: for each to come the median of those so far; at last none."""
    played(lambda seed: leaves(POURED))
    lines = run_all(tmp_path, setting(), form=Format.JSON).splitlines()
    said = [msgspec.json.decode(line) for line in lines]
    counts = [(one["kind"], one["seed"], one["done"], one["of"]) for one in said]
    assert counts == [("run", 1, 1, 3), ("run", 2, 2, 3), ("run", 3, 3, 3)]
    took = [one["took_s"] for one in said]
    assert said[0]["left_s"] == pytest.approx(2 * took[0], abs=0.2)  # each is rounded
    assert said[1]["left_s"] == pytest.approx((took[0] + took[1]) / 2, abs=0.2)
    assert said[2]["left_s"] == 0.0


def test_a_run_waits_for_a_quiet_machine_but_not_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    """It begins as soon as the load is low enough, and after its patience in any case."""
    loads = iter([9.0, 7.0, 2.0])
    monkeypatch.setattr(experiment, "LOAD_S", 0.001)
    monkeypatch.setattr(experiment, "machine_load", lambda: next(loads))
    seen: list[float] = []
    assert experiment.quiet(3.0, 20.0, lambda load, _: seen.append(load))
    assert seen == [9.0, 7.0]
    monkeypatch.setattr(experiment, "machine_load", lambda: 9.0)
    assert not experiment.quiet(3.0, 0.01, lambda *_: None)


def test_a_supervisor_that_told_nothing_yet_is_ended() -> None:
    """Ctrl-C in the first moments of a demo leaves no fleet behind."""
    young = subprocess.Popen([sys.executable, "-c", HANGS])
    starting.end(young)
    assert young.returncode == -signal.SIGTERM


@pytest.mark.timeout(180)
def test_the_whole_verb_ends_with_a_report(
    tmp_path: Path, played: Callable[[Play], list[int]]
) -> None:
    """Runs, then report.html, .json and .md; the last line says where."""
    played(lambda seed: leaves(POURED))
    words = ["experiment", "pour", "--runs", "2", "--seed", "5", "--out", str(tmp_path / "mine")]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    assert "2 of 2 runs poured: 100 %" in done.stdout
    assert (tmp_path / "mine" / "report.html").is_file()
    again = CliRunner().invoke(app, words)
    assert again.exit_code == 2
    assert "--resume" in again.stderr


def test_resume_needs_a_folder() -> None:
    """Exit code 2, and what to name."""
    done = CliRunner().invoke(app, ["experiment", "pour", "--resume"])
    assert done.exit_code == 2
    assert "--out" in done.stderr
