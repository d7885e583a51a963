"""The main job from start to end, watched: up, say, follow, down, and what the report says."""

import json
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import msgspec

from agent_runtime.io.heartbeat import ready_file
from agent_runtime.io.run_files import heartbeat_file
from agent_runtime.io.tap import RECORDER
from companion.run_files import TaskLine
from companion.tools.live import LOOP
from companion.tools.system import JOB
from companion.tools.verbs.hi import Hi, HiError, address
from operate.cli import interrupts
from operate.cli.errors import ConsoleError
from operate.cli.fleet import starting
from operate.cli.fleet.local import Local
from operate.cli.fleet.process_status import Look, stuck
from operate.cli.fleet.tasks import ENDED
from operate.cli.runs import folders
from operate.cli.terminal.run_state import View
from operate.cli.terminal.watch import Watch
from operate.run_folder import REPORT_FILE, ProcessState

SENTENCE = "pour the content of the jar into the bowl"
PICTURES = "run.rrd"
RERUN = Path(sys.executable).with_name("rerun")  # the viewer comes with the library
PERIOD_S = 0.1  # estimate: smooth enough for eyes, little work for a loaded machine
FIRST_LOOK_S = 120.0  # it takes 3 s and some of preparation; 30 s at a load of 36 on two cores (measured 2026-11-22)
AWAY_S = 60.0  # estimate: a killed hi is back in seconds, a hung one in ten
LAST_LOOKS = 5  # estimate: five times what the recorder holds back
REST_S = 90.0
"""Estimate: ta waits 20 s for the end of an act that it stopped (services.task.acts), then makes safe what is held."""


COMING = (ProcessState.WAITING, ProcessState.STARTING, ProcessState.BACKING_OFF)


class Report(msgspec.Struct, frozen=True):
    """The fields of report.json that the command line reads; it has many more."""

    success: bool
    failure: str | None = None
    poured_fraction: float | None = None
    sim_time_s: float | None = None
    wall_time_s: float | None = None


class Beat(msgspec.Struct, frozen=True):
    """The fields of an agent's heartbeat that are read; `at`: unix seconds."""

    state: str
    at: float


def play(
    run: Path, supervisor_arguments: list[str], watch: Watch, when_up: Callable[[], None] = lambda: None
) -> Report:
    """Bring the fleet up, say the sentence, follow it to its end, let the agents come to rest, bring the fleet down.

    `when_up` is called before the sentence.
    Return what the report says. The fleet is brought down whatever happens. ConsoleError: it did not come up, or there
    is no report.
    """
    with interrupts.held() as let_go:
        supervisor = starting.start(run, supervisor_arguments)
        try:
            let_go()
            with watch.showing():
                starting.wait_ready(run, supervisor, watch.look)
                when_up()
                first_look(watch, lambda: supervisor.poll() is None)
                follow(lambda: Hi(address(Local(run))), SENTENCE, watch, lambda: supervisor.poll() is None)
                at_rest(run, JOB.rests, watch, lambda: supervisor.poll() is None)
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


def follow(hi: Callable[[], Hi], sentence: str, watch: Watch, alive: Callable[[], bool]) -> TaskLine:
    """Say a sentence and watch its task to the end; `hi` finds the human interface, which may die and come back.

    A sentence whose answer was lost is looked for among hi's tasks before it is said again. Raise ConsoleError where
    the fleet ends before, or hi stays away.
    """
    task, heard = TaskLine("", "", ""), time.monotonic()
    while task.state not in ENDED:
        try:
            tasks = hi().tasks()
            task = _found(tasks, task, sentence) or hi().say(sentence)
            heard = time.monotonic()
            watch.look(tasks=tasks)
        except HiError as error:
            if error.status or time.monotonic() - heard > AWAY_S:
                raise
            watch.look()
        if not alive():
            raise ConsoleError("the fleet ended in the middle of the task; see its logs")
        time.sleep(PERIOD_S)
    for _ in range(LAST_LOOKS):  # the recorder writes down what it heard a moment later
        watch.look(tasks=(*(line for line in watch.scene.tasks if line.task != task.task), task))
        time.sleep(PERIOD_S)
    return task


def at_rest(
    run: Path, rests: Mapping[str, str], watch: Watch, alive: Callable[[], bool], within_s: float = REST_S
) -> list[str]:
    """Wait until each agent says that it is in its state of rest and every process gets on, but not for ever.

    Return who is not at rest, in words. A task that failed or was cancelled may have ended for its person while ta and
    ex still stop. What an agent said before this wait counts for nothing. A monitor that hangs, or began again and has
    not heard of the robot since, has not seen the end.
    """
    began, end, fleet = time.time(), time.monotonic() + within_s, Local(run)

    def unready() -> list[str]:
        return [*_busy(run, rests, began), *_not_up(fleet.look()), *_unheard(run, watch.scene.view)]

    while (busy := unready()) and alive() and time.monotonic() < end:
        said = [words for words in busy if words]
        if said:
            watch.waits(f"until the robot is at rest: {', '.join(said)}")
        watch.look()
        time.sleep(PERIOD_S)
    return busy


def _busy(run: Path, rests: Mapping[str, str], since: float) -> Iterator[str]:
    """Yield who has not said since then [unix s] that it rests: what it does, "" where it has said nothing."""
    for agent, rest in rests.items():
        beat = folders.read(heartbeat_file(run, agent), Beat)
        if beat is None or beat.at < since:
            yield ""
        elif beat.state != rest:
            yield f"{agent} is {beat.state}"


def _not_up(look: Look) -> Iterator[str]:
    """Yield the processes that hang, which a supervisor ends, and those on their way to be ready."""
    for one in look.seen:
        if one.status.state in COMING:
            yield f"{one.name} is {one.status.state}"
        elif words := stuck(one):
            yield f"{one.name} {words}" if words.startswith("hangs") else f"{one.name} is {words}"


def _unheard(run: Path, view: View) -> Iterator[str]:
    """Yield the monitor where it has recorded nothing of the robot since it began: twice a second it is told of it."""
    began, loop = ready_file(run, RECORDER), view.agents.get(LOOP)
    if began.exists() and began.stat().st_mtime > (0.0 if loop is None else loop.t):
        yield f"{RECORDER} has not heard of the robot"


def _found(tasks: tuple[TaskLine, ...], task: TaskLine, sentence: str) -> TaskLine | None:
    """Return the task that the sentence became, as it is now."""
    return next((line for line in tasks if task.task in ("", line.task) and line.said == sentence), None)


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
