"""`roco up`, `down` and `demo`: the fleet brought up and down, and the main job from start to end."""

import os
import subprocess
from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from rich.console import Console

from companion.tools.verbs import demo as main_job
from companion.tools.verbs import pace
from operate.cli import interrupts
from operate.cli.fleet import running_fleets, starting, targets
from operate.cli.output import Form, Format, Reply, RunDir, problems, tell, tell_problem, waiting
from operate.cli.runs import folders


class Speed(StrEnum):
    """1: real time, always. max: simulated time advances during acts only, as fast as it can."""

    REAL = "1"
    MAX = "max"


Seed = Annotated[int, typer.Option(min=0, help="Varies the poses of jar, bowl and cabinet, and the noise.")]
Rate = Annotated[Speed, typer.Option(help="1: real time; max: as fast as the machine can.")]
DemoRate = Annotated[
    Speed | None, typer.Option(help="1: real time; max: as fast as it can; else real time where the machine holds it.")
]
SceneFile = Annotated[
    Path | None, typer.Option(exists=True, dir_okay=False, help="A scene's TOML file; else the canonical scene.")
]
Headless = Annotated[
    bool | None,
    typer.Option("--headless/--window", help="At the end open run.rrd in Rerun, or not; not where no display is."),
]
Insecure = Annotated[
    bool, typer.Option("--insecure", help="No TLS and no rights: whoever is on this host may say anything.")
]
Out = Annotated[Path | None, typer.Option("--out", help="Where everything is written; else runs/<time>.")]
Another = Annotated[
    str, typer.Option("--another", metavar="NAME", help="Beside a fleet that runs: a second one, in runs/NAME.")
]


def up(
    out: Out = None,
    another: Another = "",
    seed: Seed = 1,
    speed: Rate = Speed.REAL,
    scene: SceneFile = None,
    only: Annotated[str, typer.Option(help="Names of processes, comma between; else all.")] = "",
    insecure: Insecure = False,
    wait: Annotated[bool, typer.Option(help="Come back when all are ready.")] = True,
    form: Form = Format.TEXT,
) -> None:
    """Bring the fleet up in the background. Interrupted, it brings down what it began.

    Where one runs already it starts none, unless --another names it: that one is meant by `--target NAME`.

    Examples:
      roco up
      roco up --speed max --seed 7
      roco up --insecure --out runs/today
      roco up --only router,monitor,km,pl
      roco up --another second
    """
    with problems(form), interrupts.heard():
        where = running_fleets.place(out, another, datetime.now())
        words = [*options(seed, speed, scene, insecure), *(["--only", only] if only else [])]
        starting.check(words)
        _begun(where, words, wait, form)
        named = "" if where.latest else f"; `--target {another or folders.near(where.run)}` means it"
        what = f"ready; everything is written to {where.run}"
        text = what if wait else f"starting in {where.run}; `roco status` shows how far it is"
        tell(Reply(text + named, str(where.run)), form)


def _begun(where: running_fleets.Place, words: list[str], wait: bool, form: Format) -> None:
    """Start the fleet and wait until it is ready. What was started is brought down where that fails."""
    with interrupts.held() as let_go:
        supervisor = starting.start(where.run, [*words, *([] if where.latest else ["--no-latest"])])
        if not wait:
            return
        try:
            let_go()
            _watched(where.run, supervisor, form)
        except BaseException as error:
            try:
                if isinstance(error, KeyboardInterrupt) and form is Format.TEXT:
                    tell_problem("interrupted; what was started is brought down, Ctrl-C does not wait", form)
            finally:  # a closed terminal takes no words
                starting.bring_down(where.run, supervisor)
            raise


def _watched(run: Path, supervisor: "subprocess.Popen[bytes]", form: Format) -> None:
    """Wait until all are ready, and show how far they are. FleetError: they do not come up."""
    watch = main_job.Watch(run, "bringing the fleet up", Console(stderr=True), form is Format.JSON)
    with watch.showing():
        starting.wait_ready(run, supervisor, watch.look if form is Format.TEXT else lambda _: None)


def down(target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Bring the fleet down in order; works with a dead supervisor, too.

    Examples:
      roco down
      roco down --run-dir runs/today
      roco down --target compose
    """
    with problems(form):
        found = targets.find(target, run_dir)
        with waiting("the fleet ends, the report is written; Ctrl-C does not wait", form):
            names = found.down()
        words = f"ended {', '.join(names)}" if names else f"nothing of {found.where} was running"
        tell(Reply(words, found.where), form)


def demo(
    seed: Seed = 1,
    out: Out = None,
    another: Another = "",
    speed: DemoRate = None,
    scene: SceneFile = None,
    headless: Headless = None,
    insecure: Insecure = False,
    form: Form = Format.TEXT,
) -> None:
    """Run the main job from start to end, watched: up, say, report, down. Exits with 1 on a failed pour.

    Examples:
      roco demo
      roco demo --speed max --seed 7 --headless
      roco demo --format json
    """
    with problems(form), interrupts.heard():
        run, latest = running_fleets.place(out, another, datetime.now())
        starting.check(options(seed, Speed.REAL, scene, insecure))
        console = Console()
        words = options(seed, speed or _held(console, form), scene, insecure)
        watch = main_job.Watch(run, "The Robot Companion pours", console, form is Format.JSON)
        report = main_job.play(run, [*words, *([] if latest else ["--no-latest"])], watch)
        if form is Format.JSON:
            said = main_job.verdict_json(report, run)
        else:
            said = main_job.verdict(report, run, console.width if console.is_terminal else None)
        console.out(said, highlight=False)
        if has_display() if headless is None else not headless:
            main_job.show(run)
        if not report.success:
            raise typer.Exit(1)


def _held(console: Console, form: Format) -> Speed:
    """The speed that this machine holds now; where that is not real time, it is said in a line."""
    with waiting("a second of the control loop is timed", form):
        measured = pace.measure()
    if measured is None or measured.held:
        return Speed.REAL
    words = f"{measured.words}: --speed max is taken, --speed 1 insists on real time"
    console.out(msgspec.json.encode(measured).decode() if form is Format.JSON else words, highlight=False)
    return Speed.MAX


def options(seed: int, speed: Speed, scene: Path | None, insecure: bool) -> list[str]:
    """The supervisor's options of a run."""
    others = [*(["--scene", str(scene)] if scene else []), *(["--insecure"] if insecure else [])]
    return ["--seed", str(seed), "--speed", speed.value, *others]


def has_display() -> bool:
    """Whether a window could be seen."""
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
