"""The main job from start to end, watched: up, say, follow, down, and what the report says."""

import json
import os
import subprocess
import sys
import textwrap
import time
import webbrowser
from collections.abc import Callable, Iterator, Mapping
from datetime import datetime
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from agent_runtime.io.run_files import heartbeat_file, ready_file
from agent_runtime.io.tap import RECORDER
from companion.eyes import VARIABLE, Eyes
from companion.eyes import eyes as named
from companion.run_files import TaskLine
from companion.tools.system import JOB, LOOP
from companion.tools.verbs import checkup
from companion.tools.verbs.hi import ON_ITS_WAY, Hi, HiError, address, door_when_there
from console import interrupts
from console.errors import ConsoleError, UsageError
from console.fleet import starting, up, view
from console.fleet.local import Local
from console.fleet.process_status import ENDED, Look, stuck
from console.fleet.up import Rate, SceneFile, Speed
from console.output import FirstSeed, Form, Format, Seed, problems
from console.runs import folders
from console.runs.experiment import Asked, Count, MostLoad, Place, Resume, Timeout, repeated
from console.terminal.console import Console
from console.terminal.draw import Watch
from console.terminal.run_state import View
from operate.doing import doing
from operate.file_names import REPORT_FILE
from operate.system import here
from velma.sim import gl

SENTENCE = "pour the content of the jar into the bowl"
PICTURES = "run.rrd"
RERUN = Path(sys.executable).with_name("rerun")  # the viewer comes with the library
PERIOD_S = 0.1  # estimate: smooth enough for eyes, little work for a loaded machine
# it takes 3 s and some of preparation; 30 s at a load of 36 on two cores (measured 2026-11-22)
FIRST_LOOK_S = 120.0
AWAY_S = 60.0  # estimate: a killed hi is back in seconds, a hung one in ten
LAST_LOOKS = 5  # estimate: five times what the recorder holds back
REST_S = 90.0
"""Estimate: ta waits 20 s for the end of an act that it stopped (services.task.acts), then makes
safe what is held.
"""


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
    run: Path,
    supervisor_arguments: list[str],
    watch: Watch,
    when_up: Callable[[], None] = lambda: None,
) -> Report:
    """Bring the fleet up, say the sentence, follow it to its end, let the agents come to rest,
    bring the fleet down.

    `when_up` is called before the sentence. Return what the report says. The fleet is brought down
    whatever happens. ConsoleError: it did not come up, or there is no report.
    """
    with interrupts.held() as let_go:
        supervisor = starting.start(run, supervisor_arguments)
        try:
            let_go()
            with watch.showing():
                starting.wait_ready(run, supervisor, watch.look)
                when_up()
                first_look(watch, lambda: supervisor.poll() is None)
                follow(
                    lambda: Hi(address(Local(run))),
                    SENTENCE,
                    watch,
                    lambda: supervisor.poll() is None,
                )
                at_rest(run, JOB.rests, watch, lambda: supervisor.poll() is None)
        finally:
            try:
                watch.ending()
            finally:  # a closed terminal takes no words
                starting.bring_down(run, supervisor)
    report = folders.read(run / REPORT_FILE, Report)
    if report is None:
        raise ConsoleError(
            f"the run ended without a report ({run / REPORT_FILE} is not there); see"
            f" {run}/monitor.log"
        )
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


def follow(
    hi: Callable[[], Hi], sentence: str, watch: Watch, alive: Callable[[], bool]
) -> TaskLine:
    """Say a sentence and watch its task to the end; `hi` finds the human interface, which may die
    and come back.

    A sentence whose answer was lost is looked for among hi's tasks before it is said again. Raise
    ConsoleError where the fleet ends before, or hi stays away.
    """
    task, heard = TaskLine("", "", ""), time.monotonic()
    while task.state not in ENDED:
        try:
            tasks = hi().tasks()
            said = (line for line in tasks if line.said == sentence)
            mine = (line for line in said if task.task in ("", line.task))
            task = next(mine, None) or hi().say(sentence)
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
    run: Path,
    rests: Mapping[str, str],
    watch: Watch,
    alive: Callable[[], bool],
    within_s: float = REST_S,
) -> list[str]:
    """Wait until each agent says that it is in its state of rest and every process gets on, but not
    for ever.

    Return who is not at rest, in words. A task that failed or was cancelled may have ended for its
    person while ta and ex still stop. What an agent said before this wait counts for nothing. A
    monitor that hangs, or began again and has not heard of the robot since, has not seen the end.
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
    """Yield who has not said since then [unix s] that it rests: what it does, "" where it has said
    nothing.
    """
    for agent, rest in rests.items():
        beat = folders.read(heartbeat_file(run, agent), Beat)
        if beat is None or beat.at < since:
            yield ""
        elif beat.state != rest:
            yield f"{agent} is {beat.state}"


def _not_up(look: Look) -> Iterator[str]:
    """Yield the processes that hang, which a supervisor ends, and those on their way to be
    ready.
    """
    for one in look.seen:
        if one.status.state in ON_ITS_WAY:
            yield f"{one.name} is {one.status.state}"
        elif words := stuck(one):
            yield f"{one.name} {words}" if words.startswith("hangs") else f"{one.name} is {words}"


def _unheard(run: Path, view: View) -> Iterator[str]:
    """Yield the monitor where it has recorded nothing of the robot since it began: twice a second
    it is told of it.
    """
    began, loop = ready_file(run, RECORDER), view.agents.get(LOOP)
    if began.exists() and began.stat().st_mtime > (0.0 if loop is None else loop.t):
        yield f"{RECORDER} has not heard of the robot"


def verdict(report: Report, run: Path, width: int | None = None) -> str:
    """The end of it, in lines for a person; `width`: of a terminal, so that no word of a reason is
    broken there.
    """
    said = "success" if report.success else f"no success: {report.failure or 'see the report'}"
    lines = (
        [textwrap.fill(said, width, break_long_words=False, break_on_hyphens=False)]
        if width
        else [said]
    )
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
    """Open the pictures of a run in a window of their own, if there are any; it stays when this
    command has ended.
    """
    if RERUN.exists() and (run / PICTURES).exists():
        quiet = subprocess.DEVNULL
        command = [str(RERUN), str(run / PICTURES)]
        subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet, start_new_session=True)


# --- `roco demo`: the main job from start to end --------------------------------------------------


DemoRate = Annotated[
    Speed | None,
    typer.Option(
        help="1: real time; max: as fast as it can; else real time where the machine holds it."
    ),
]
Headless = Annotated[
    bool | None,
    typer.Option(
        "--headless/--window",
        help="At the end open run.rrd in Rerun, or not; not where no display is.",
    ),
]
Page = Annotated[
    bool,
    typer.Option("--page", help="Open the person's page in a browser as soon as the fleet is up."),
]

Seeing = Annotated[
    Eyes | None,
    typer.Option(
        "--eyes",
        help=(
            "pixels: by markers in the rendered picture; rays: true poses with noise; else pixels,"
            " with OpenGL."
        ),
    ),
]


def demo(
    seed: Seed = 1,
    out: up.Out = None,
    another: up.Another = "",
    speed: DemoRate = None,
    scene: up.SceneFile = None,
    eyes: Seeing = None,
    headless: Headless = None,
    page: Page = False,
    insecure: up.Insecure = False,
    faults: up.Faults = False,
    form: Form = Format.TEXT,
) -> None:
    """Run the main job from start to end, watched: up, say, report, down. Exits with 1 on a failed
    pour.

    It prints the address of the person's page; --page opens it in a browser.

    Examples:
      roco demo
      roco demo --speed max --seed 7 --headless
      roco demo --eyes rays
      roco demo --format json
    """
    with problems(form), interrupts.heard():
        _see(eyes, form)
        run, latest = folders.place(out, another, datetime.now())
        starting.check(up.options(seed, Speed.REAL, scene, insecure))
        console = Console()
        words = up.options(seed, speed or _held(console, form), scene, insecure, faults=faults)
        watch = Watch(here(), run, "The Robot Companion pours", console, form is Format.JSON)
        supervisor_words = [*words, *([] if latest else ["--no-latest"])]
        report = play(run, supervisor_words, watch, lambda: _page(run, console, form, opened=page))
        if form is Format.JSON:
            said = json.dumps({**msgspec.to_builtins(report), "run": str(run)})
        else:
            said = verdict(report, run, console.width if console.is_terminal else None)
        console.out(said, highlight=False)
        if view.has_display() if headless is None else not headless:
            show(run)
        if not report.success:
            raise typer.Exit(1)


def _see(asked: Eyes | None, form: Form) -> None:
    """Let ex have these eyes, or those of the environment. Raises UsageError where nothing here can
    draw for them.
    """
    if asked is not None:
        os.environ[VARIABLE] = asked
    words = os.environ.get(VARIABLE, "")
    try:
        _, why = named(words, gl.lost)
    except ValueError as error:
        raise UsageError(str(error)) from None
    if why and form is Format.TEXT:
        typer.echo(f"eyes by rays: {why}", err=True)


def _page(run: Path, console: Console, form: Format, *, opened: bool) -> None:
    """Say where the person's page is, and open it where that is wanted."""
    found = door_when_there(run)
    if found is None:
        return
    told = msgspec.json.encode(found).decode() if form is Format.JSON else f"page: {found.url}"
    console.out(told, highlight=False)
    if opened:
        webbrowser.open(found.url)


def _held(console: Console, form: Format) -> Speed:
    """The speed that this machine holds now; where that is not real time, it is said in a line."""
    with doing("a second of the control loop is timed"):
        measured = checkup.measure()
    if measured is None or measured.held:
        return Speed.REAL
    words = f"{measured.sentence}: --speed max is taken, --speed 1 insists on real time"
    console.out(
        msgspec.json.encode(measured).decode() if form is Format.JSON else words, highlight=False
    )
    return Speed.MAX


# --- `roco experiment pour`: the main job repeated, each run with a fresh fleet; the figures beside
# the paper's


def pour(
    runs: Count = 30,
    seed: FirstSeed = 1,
    speed: Rate = Speed.MAX,
    scene: SceneFile = None,
    out: Place = None,
    resume: Resume = False,
    timeout: Timeout = 360.0,
    most_load: MostLoad = 0.0,
    form: Form = Format.TEXT,
) -> None:
    """Repeat the main job, a fresh fleet each time; report.html, .json and .md set it beside the
    paper.

    Exits with 0 when all runs are done, whether they poured or not; interrupted, it goes on with
    --resume.

    Examples:
      roco experiment pour --runs 30 --seed 1
      roco experiment pour --runs 30 --out experiments/mine --resume
    """
    asked = Asked(runs, seed, speed.value, scene, timeout, most_load)
    repeated(("pour",), ("demo", "--headless"), asked, out, resume, form, "poured")
