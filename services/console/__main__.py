"""`roco`: bring the fleet up and down, talk to the robot, stop it, run the main job. `roco --help` lists it all.

Every command takes `--format json`. Exit codes: 0 as wanted, 1 not (said on standard error), 2 wrong usage.
"""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from rich.console import Console

from companion.run_folder import KEYS_FOLDER, Fleet, ProcessState, TaskLine
from services.console import (
    acl,
    conversation,
    design,
    design_check,
    design_diff,
    design_estimate,
    design_export,
    design_follow,
    design_new,
    design_show,
    design_trace,
    design_verify,
    draw,
    fleet,
    keys,
    runs,
    send,
    traffic,
)
from services.console import demo as main_job
from services.console.errors import ConsoleError
from services.console.forms import Form, Format, tell_problem
from services.console.hi import Hi


class Speed(StrEnum):
    """1: real time, always. max: simulated time advances during acts only, as fast as it can."""

    REAL = "1"
    MAX = "max"


RunDir = Annotated[Path | None, typer.Option("--run-dir", help="A run's folder; else ROCO_RUN_DIR, else runs/latest.")]
Seed = Annotated[int, typer.Option(help="Varies the poses of jar, bowl and cabinet, and the noise.")]
Rate = Annotated[Speed, typer.Option(help="1: real time; max: as fast as the machine can.")]
SceneFile = Annotated[
    Path | None, typer.Option(exists=True, dir_okay=False, help="A scene's TOML file; else the canonical scene.")
]
Headless = Annotated[
    bool | None,
    typer.Option("--headless/--window", help="At the end open run.rrd in Rerun, or not; not where no display is."),
]
Secure = Annotated[
    bool, typer.Option("--secure", help="Mutual TLS, and rights as the design has them; keys of this run alone.")
]
Out = Annotated[Path | None, typer.Option("--out", help="Where everything is written; else runs/<time>.")]

app = typer.Typer(
    no_args_is_help=True, add_completion=False, help="The operator's command line of the Robot Companion."
)

app.add_typer(design.app, name="design")
app.add_typer(traffic.app, name="traffic")
app.add_typer(conversation.app, name="conversation")
app.add_typer(acl.app, name="acl")
app.add_typer(keys.app, name="keys")
DESIGN_VERBS = (
    design_check,
    design_diff,
    design_estimate,
    design_export,
    design_follow,
    design_new,
    design_show,
    design_trace,
    design_verify,
)
"""The modules whose import registers the verbs of `roco design`."""


class Reply(msgspec.Struct, frozen=True):
    """An answer that is only words."""

    text: str
    run: str = ""


class Status(msgspec.Struct, frozen=True):
    """`roco status`: the fleet, the tasks, whether the robot is held."""

    run: str
    fleet: Fleet | None
    tasks: tuple[TaskLine, ...]
    stop_held: bool
    problem: str = ""


@app.command()
def up(
    out: Out = None,
    seed: Seed = 1,
    speed: Rate = Speed.REAL,
    scene: SceneFile = None,
    only: Annotated[str, typer.Option(help="Names of processes, comma between; else all.")] = "",
    secure: Secure = False,
    wait: Annotated[bool, typer.Option(help="Come back when all are ready.")] = True,
    form: Form = Format.TEXT,
) -> None:
    """Bring the fleet up in the background."""
    with problems(form):
        run = (out or runs.new_run(datetime.now())).resolve()
        supervisor = fleet.start(run, [*options(seed, speed, scene), *keys_of(run, secure), "--only", only])
        if not wait:
            tell(Reply(f"starting in {run}; `roco status` shows how far it is", str(run)), form)
            return
        watch = main_job.Watch(run, "bringing the fleet up", Console(stderr=True), form is Format.JSON)
        try:
            with watch.showing():
                fleet.wait_ready(run, supervisor, watch.look if form is Format.TEXT else lambda _: None)
        except ConsoleError:
            fleet.down(run)
            raise
        tell(Reply(f"ready; everything is written to {run}", str(run)), form)


@app.command()
def down(run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Bring the fleet down in order; works with a dead supervisor, too."""
    with problems(form):
        run = runs.find(run_dir)
        names = fleet.down(run)
        tell(Reply(f"ended {', '.join(names)}" if names else f"nothing of {run} was running", str(run)), form)


@app.command()
def status(run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Show the fleet's processes and the tasks. Exits with 1 where not all that must be ready are."""
    with problems(form):
        run = runs.find(run_dir)
        now = state_of(run)
        if form is Format.JSON:
            tell(now, form)
        else:
            show(now)
        processes = now.fleet.processes if now.fleet else ()
        if not processes or any(p.state is not ProcessState.READY and not p.optional for p in processes):
            raise typer.Exit(1)


@app.command()
def say(text: str, run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Say a sentence to the robot, such as "pour the jar into the bowl". Exits with 1 where it is refused."""
    with problems(form):
        task = Hi(runs.hi_address(runs.find(run_dir))).say(text)
        tell(task, form)
        if task.state == "refused":
            raise typer.Exit(1)


@app.command()
def cancel(
    task: Annotated[str, typer.Argument(help="A task's name; else the oldest that has not ended.")] = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Cancel a task: what is held is put down safely, then the next command is served."""
    with problems(form):
        tell(Hi(runs.hi_address(runs.find(run_dir))).cancel(task), form)


@app.command()
def stop(run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Stop the robot at once. It reaches the control loop directly and needs no agent, router or supervisor."""
    flag(run_dir, True, "stopped: the loop holds the robot until `roco release`", form)


@app.command()
def release(run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Let the robot move again after `roco stop`."""
    flag(run_dir, False, "released: the loop leaves the stop by its own rules", form)


@app.command()
def demo(
    seed: Seed = 1,
    out: Out = None,
    speed: Rate = Speed.REAL,
    scene: SceneFile = None,
    headless: Headless = None,
    secure: Secure = False,
    form: Form = Format.TEXT,
) -> None:
    """Run the main job from start to end, watched: up, say, report, down. Exits with 1 on a failed pour."""
    with problems(form):
        run = (out or runs.new_run(datetime.now())).resolve()
        console = Console()
        watch = main_job.Watch(run, "The Robot Companion pours", console, form is Format.JSON)
        report = main_job.play(run, [*options(seed, speed, scene), *keys_of(run, secure)], watch)
        said = main_job.verdict_json if form is Format.JSON else main_job.verdict
        console.out(said(report, run), highlight=False)
        if has_display() if headless is None else not headless:
            main_job.show(run)
        if not report.success:
            raise typer.Exit(1)


def options(seed: int, speed: Speed, scene: Path | None) -> list[str]:
    """The supervisor's options of a run."""
    return ["--seed", str(seed), "--speed", speed.value, *(["--scene", str(scene)] if scene else [])]


def keys_of(run: Path, secure: bool) -> list[str]:
    """Make the keys of a run, fresh at each start; the supervisor's option that names them."""
    if not secure:
        return []
    keys.of_run(run)
    return ["--keys", str(run / KEYS_FOLDER)]


def has_display() -> bool:
    """Whether a window could be seen."""
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def flag(run_dir: Path | None, held: bool, words: str, form: Format) -> None:
    """Write the stop flag and say so."""
    with problems(form):
        run = runs.find(run_dir)
        runs.set_stop(run, held)
        tell(Reply(words, str(run)), form)


def state_of(run: Path) -> Status:
    """What can be learnt of a run; a silent human interface is told, not raised."""
    try:
        tasks, problem = Hi(runs.hi_address(run)).tasks(), ""
    except ConsoleError as error:
        tasks, problem = (), str(error)
    return Status(str(run), runs.living(run), tasks, runs.stop_held(run), problem)


def show(now: Status) -> None:
    """Print a status for people."""
    console = Console()
    console.print(f"run {now.run}" + ("  [bold red]STOPPED[/] (`roco release`)" if now.stop_held else ""))
    if now.fleet is not None:
        console.print(draw.fleet_table(now.fleet))
    for task in now.tasks:
        console.print(f"{task.task}  {task.state}  {task.said}  {task.text}", highlight=False, soft_wrap=True)
    if now.problem:
        console.print(now.problem, style="yellow")


def tell(what: msgspec.Struct, form: Format) -> None:
    """Print an answer: as JSON, or the sentence in it."""
    if form is Format.JSON:
        print(msgspec.json.encode(what).decode())
    elif isinstance(what, TaskLine):
        print(f"{what.task}  {what.state}  {what.text}" if what.task else what.text)
    elif isinstance(what, Reply):
        print(what.text)


@contextmanager
def problems(form: Format) -> Iterator[None]:
    """Turn what goes wrong into words on standard error and exit code 1."""
    try:
        yield
    except ConsoleError as error:
        tell_problem(error, form)
        raise typer.Exit(1) from error
    except KeyboardInterrupt as error:
        print("interrupted", file=sys.stderr)
        raise typer.Exit(130) from error


app.command()(send.send)


def main() -> None:
    """Entry point of `roco`."""
    app()


if __name__ == "__main__":
    main()
