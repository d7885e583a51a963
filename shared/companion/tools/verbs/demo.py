"""`roco demo`: the main job from start to end."""

import os
import webbrowser
from datetime import datetime
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from companion.eyes import VARIABLE, Eyes
from companion.eyes import eyes as named
from companion.tools.verbs import checkup, main_job
from companion.tools.verbs.page import door_when_there
from operate.cli import interrupts
from operate.cli.errors import UsageError
from operate.cli.fleet import running_fleets, starting, up, view
from operate.cli.fleet.up import Speed
from operate.cli.output import Form, Format, Seed, problems, waiting
from operate.cli.terminal.console import Console
from operate.cli.terminal.watch import Watch
from operate.system import here
from velma.sim import gl

DemoRate = Annotated[
    Speed | None, typer.Option(help="1: real time; max: as fast as it can; else real time where the machine holds it.")
]
Headless = Annotated[
    bool | None,
    typer.Option("--headless/--window", help="At the end open run.rrd in Rerun, or not; not where no display is."),
]
Page = Annotated[bool, typer.Option("--page", help="Open the person's page in a browser as soon as the fleet is up.")]

Seeing = Annotated[
    Eyes | None,
    typer.Option(
        "--eyes",
        help="pixels: by markers in the rendered picture; rays: true poses with noise; else pixels, with OpenGL.",
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
    """Run the main job from start to end, watched: up, say, report, down. Exits with 1 on a failed pour.

    It prints the address of the person's page; --page opens it in a browser.

    Examples:
      roco demo
      roco demo --speed max --seed 7 --headless
      roco demo --eyes rays
      roco demo --format json
    """
    with problems(form), interrupts.heard():
        _see(eyes, form)
        run, latest = running_fleets.place(out, another, datetime.now())
        starting.check(up.options(seed, Speed.REAL, scene, insecure))
        console = Console()
        words = up.options(seed, speed or _held(console, form), scene, insecure, faults=faults)
        watch = Watch(here(), run, "The Robot Companion pours", console, form is Format.JSON)
        supervisor_words = [*words, *([] if latest else ["--no-latest"])]
        report = main_job.play(run, supervisor_words, watch, lambda: _page(run, console, form, opened=page))
        if form is Format.JSON:
            said = main_job.verdict_json(report, run)
        else:
            said = main_job.verdict(report, run, console.width if console.is_terminal else None)
        console.out(said, highlight=False)
        if view.has_display() if headless is None else not headless:
            main_job.show(run)
        if not report.success:
            raise typer.Exit(1)


def _see(asked: Eyes | None, form: Form) -> None:
    """Let ex have these eyes, or those of the environment. Raises UsageError where nothing here can draw for them."""
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
    console.out(msgspec.json.encode(found).decode() if form is Format.JSON else f"page: {found.url}", highlight=False)
    if opened:
        webbrowser.open(found.url)


def _held(console: Console, form: Format) -> Speed:
    """The speed that this machine holds now; where that is not real time, it is said in a line."""
    with waiting("a second of the control loop is timed", form):
        measured = checkup.measure()
    if measured is None or measured.held:
        return Speed.REAL
    words = f"{measured.words}: --speed max is taken, --speed 1 insists on real time"
    console.out(msgspec.json.encode(measured).decode() if form is Format.JSON else words, highlight=False)
    return Speed.MAX
