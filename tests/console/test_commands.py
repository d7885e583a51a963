"""`roco`, command by command, against a pretended fleet."""

import json
import mmap
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from calling import printed, roco

from companion.run_files import SLOTS_FILE
from companion.tools.verbs.checkup import Pace
from console.fleet import starting

pytestmark = pytest.mark.process


def test_say_tells_what_was_understood(run: Path) -> None:
    """The answer names the task and its state."""
    done = roco("say", "pour the jar into the bowl", "--run-dir", run, "--format", "json", code=0)
    assert json.loads(done.stdout)["task"] == "hi-1-1"


def test_a_sentence_that_is_not_understood_exits_with_1(run: Path) -> None:
    """It says what can be said."""
    done = roco("say", "dance", "--run-dir", run, code=1)
    assert "I can pour" in done.stdout


def test_what_a_hi_refuses_is_told_in_its_words(run: Path) -> None:
    """Cancel without a task: a_hi's own sentence, on standard error, exit code 1."""
    done = roco("cancel", "--run-dir", run, code=1)
    assert "no task has not ended" in done.stderr


def test_status_shows_fleet_and_tasks(run: Path) -> None:
    """All needed are ready: exit code 0."""
    roco("say", "pour", "--run-dir", run)
    done = roco("status", "--run-dir", run, "--format", "json", code=0)
    now = json.loads(done.stdout)
    assert [process["name"] for process in now["fleet"]["processes"]] == ["ta"]
    assert now["tasks"][0]["said"] == "pour"
    assert "ready" in roco("status", "--run-dir", run).stdout


def test_down_ends_the_fleet_and_status_tells_it(run: Path) -> None:
    """After that nothing is ready and a_hi does not answer; both are told, not raised."""
    assert "ended ta" in roco("down", "--run-dir", run).stdout
    roco("status", "--run-dir", run, code=3)
    done = roco("say", "pour", "--run-dir", run, code=3)
    assert "does not answer" in done.stderr
    assert "nothing of" in roco("down", "--run-dir", run).stdout


def test_stop_reaches_whoever_has_the_flag_mapped(tmp_path: Path) -> None:
    """The loop maps the file once; stop and release change that very byte, with nothing else
    running.
    """
    (tmp_path / "stop").write_bytes(b"\x00")
    (tmp_path / SLOTS_FILE).touch()
    file = os.open(tmp_path / "stop", os.O_RDONLY)
    with mmap.mmap(file, 1, prot=mmap.PROT_READ) as flag:
        roco("stop", "--run-dir", tmp_path, code=0)
        assert flag[0] == 1
        roco("release", "--run-dir", tmp_path, code=0)
        assert flag[0] == 0
    os.close(file)


def test_stop_promises_nothing_where_no_control_loop_is(tmp_path: Path) -> None:
    """A robot on another machine goes on; one that starts here rests, and may be released."""
    done = roco("stop", "--run-dir", tmp_path)
    assert (done.exit_code, done.stdout, "nothing was stopped" in done.stderr) == (1, "", True)
    assert (tmp_path / "stop").read_bytes() == b"\x01"
    roco("release", "--run-dir", tmp_path, code=0)


@pytest.mark.parametrize(
    "command", [["down"], ["status"], ["say", "x"], ["cancel"], ["stop"], ["release"]]
)
def test_without_a_run_every_command_says_so(command: list[str], tmp_path: Path) -> None:
    """And says what to do, as JSON where asked for."""
    nowhere = tmp_path / "none"
    assert "roco up" in printed(*command, "--run-dir", nowhere, code=3)["error"]


@pytest.mark.parametrize("success", [True, False])
def test_the_demo_tells_its_story_in_lines_and_exits_by_the_report(
    success: bool, pretend: Callable[[bool], None], tmp_path: Path
) -> None:
    """Without a terminal: one line per happening, then the verdict; a failed pour exits with 1."""
    pretend(success)
    done = roco("demo", "--out", tmp_path / "out", "--speed", "max")
    assert done.exit_code == (0 if success else 1), done.output
    assert "take jar (grasp)" in done.stdout
    assert "jar grasped: left hand" in done.stdout
    assert done.stdout.count("into the bowl: done") == 1
    assert ("success" if success else "no success: the jar slipped") in done.stdout
    assert "97 % of the content" in done.stdout


@pytest.mark.parametrize(
    ("words", "pace", "speed", "said"),
    [
        ([], Pace(500, 20, held=True), "1", False),
        ([], Pace(500, 200, held=False), "max", True),
        ([], None, "1", False),
        (["--speed", "1"], Pace(500, 200, held=False), "1", False),
        (["--speed", "max"], Pace(500, 20, held=True), "max", False),
    ],
)
def test_the_demo_takes_the_speed_that_the_machine_holds(
    words: list[str],
    pace: Pace | None,
    speed: str,
    said: bool,
    pretend: Callable[[bool], None],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    """Unless a person says which; and says so where it is not real time."""
    pretend(True)
    monkeypatch.setattr("companion.tools.verbs.checkup.measure", lambda: pace)
    start, started = starting.start, []
    monkeypatch.setattr(
        starting, "start", lambda run, given: started.append(given) or start(run, given)
    )
    done = roco("demo", "--out", tmp_path / "out", *words, code=0)
    assert started[0][started[0].index("--speed") + 1] == speed
    assert ("40 % of the control loop's cycles are late" in done.stdout) is said


def test_the_demo_speaks_json_line_by_line(pretend: Callable[[bool], None], tmp_path: Path) -> None:
    """Every line of standard output is an object; the last one is the report."""
    pretend(True)
    done = roco("demo", "--out", tmp_path / "out", "--format", "json")
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert lines[-1]["success"] is True
    assert {line.get("kind") for line in lines} >= {"PlanSeen", "PlanAt", "Sent", "Happened"}


def test_an_option_that_is_elsewhere_says_where() -> None:
    """No verb has --system: the project of the folder names it."""
    for words in (("up",), ("status", "--format", "json")):
        done = roco(*words, "--system", "depot", code=2)
        assert "pyproject.toml" in done.output
        assert "ROCO_ENTRY" in done.output
