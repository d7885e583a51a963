"""The main job from start to end, watched: up, say, follow, down, and what the report says."""

import json
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from pathlib import Path

import msgspec

from companion.run_files import TaskLine
from companion.tools.verbs.hi import Hi, address
from operate.cli import interrupts
from operate.cli.errors import ConsoleError
from operate.cli.fleet import starting
from operate.cli.fleet.local import Local
from operate.cli.fleet.tasks import ENDED
from operate.cli.runs import folders
from operate.cli.terminal.watch import Watch
from operate.run_folder import REPORT_FILE

SENTENCE = "pour the content of the jar into the bowl"
PICTURES = "run.rrd"
RERUN = Path(sys.executable).with_name("rerun")  # the viewer comes with the library
PERIOD_S = 0.1  # estimate: smooth enough for eyes, little work for a loaded machine
FIRST_LOOK_S = 120.0  # it takes 3 s and some of preparation; 30 s at a load of 36 on two cores (measured 2026-11-22)
LAST_LOOKS = 5  # estimate: five times what the recorder holds back


class Report(msgspec.Struct, frozen=True):
    """The fields of report.json that the command line reads; it has many more."""

    success: bool
    failure: str | None = None
    poured_fraction: float | None = None
    sim_time_s: float | None = None
    wall_time_s: float | None = None


def play(run: Path, supervisor_arguments: list[str], watch: Watch) -> Report:
    """Bring the fleet up, say the sentence, follow it to its end, bring the fleet down; what the report says.

    The fleet is brought down whatever happens. ConsoleError: it did not come up, or there is no report.
    """
    with interrupts.held() as let_go:
        supervisor = starting.start(run, supervisor_arguments)
        try:
            let_go()
            with watch.showing():
                starting.wait_ready(run, supervisor, watch.look)
                first_look(watch, lambda: supervisor.poll() is None)
                follow(Hi(address(Local(run))), SENTENCE, watch, lambda: supervisor.poll() is None)
        finally:
            try:
                watch.ending()
            finally:  # a closed terminal takes no words
                starting.bring_down(run, supervisor)
    report = folders.read(run / REPORT_FILE, Report)
    if report is None:
        raise ConsoleError(f"the run ended without a report ({run / REPORT_FILE} is not there); see {run}/monitor.log")
    return report


def first_look(watch: Watch, alive: Callable[[], bool], within_s: float = FIRST_LOOK_S) -> None:
    """Wait until ta has looked around for km, as in the paper's seconds 0 to 37, but not for ever.

    A sentence said before would be taken too: pl's questions then wait for the look.
    """
    end, looking = time.monotonic() + within_s, False
    while alive() and time.monotonic() < end:
        watch.look()
        ta = watch.scene.view.agents.get("ta")
        state = ta.state if ta is not None else ""
        if state and (looking or state != "idle") and state != "surveying":
            return
        looking = looking or state == "surveying"
        time.sleep(PERIOD_S)


def follow(hi: Hi, sentence: str, watch: Watch, alive: Callable[[], bool]) -> TaskLine:
    """Say a sentence and watch its task to the end. ConsoleError where the fleet ends before."""
    task = hi.say(sentence)
    while task.state not in ENDED:
        if not alive():
            raise ConsoleError("the fleet ended in the middle of the task; see its logs")
        time.sleep(PERIOD_S)
        tasks = hi.tasks()
        watch.look(tasks=tasks)
        task = next((line for line in tasks if line.task == task.task), task)
    for _ in range(LAST_LOOKS):  # the recorder writes down what it heard a moment later
        watch.look(tasks=(*(line for line in watch.scene.tasks if line.task != task.task), task))
        time.sleep(PERIOD_S)
    return task


def verdict(report: Report, run: Path, width: int | None = None) -> str:
    """The end of it, in lines for a person; `width`: of a terminal, so that no word of a reason is broken there."""
    said = "success" if report.success else f"no success: {report.failure or 'see the report'}"
    lines = [textwrap.fill(said, width, break_long_words=False, break_on_hyphens=False)] if width else [said]
    if report.poured_fraction is not None:
        lines.append(f"{100 * report.poured_fraction:.0f} % of the content is in the bowl")
    if report.sim_time_s is not None and report.wall_time_s is not None:
        acts = f"{report.sim_time_s:.0f} s of simulated acts"
        lines.append(f"{acts}; {report.wall_time_s:.0f} s of wall time from the command to its end")
    lines.append(f"report: {folders.near(run / 'report.html')}")
    if (run / PICTURES).exists():
        lines.append(f"to look at it again: {folders.near(RERUN)} {folders.near(run / PICTURES)}")
    return "\n".join(lines)


def show(run: Path) -> None:
    """Open the pictures of a run in a window of their own, if there are any; it stays when this command has ended."""
    if RERUN.exists() and (run / PICTURES).exists():
        quiet = subprocess.DEVNULL
        command = [str(RERUN), str(run / PICTURES)]
        subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet, start_new_session=True)


def verdict_json(report: Report, run: Path) -> str:
    """The same as one JSON object."""
    return json.dumps({**msgspec.to_builtins(report), "run": str(run)})
