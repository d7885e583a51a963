"""`roco up`, `down` and `demo`: the fleet brought up and down, and the main job from start to end."""

import os
from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from services.console import demo as main_job
from services.console import fleet, runs, targets
from services.console.errors import ConsoleError
from services.console.forms import Form, Format, Reply, RunDir, problems, tell, waiting


class Speed(StrEnum):
    """1: real time, always. max: simulated time advances during acts only, as fast as it can."""

    REAL = "1"
    MAX = "max"


Seed = Annotated[int, typer.Option(help="Varies the poses of jar, bowl and cabinet, and the noise.")]
Rate = Annotated[Speed, typer.Option(help="1: real time; max: as fast as the machine can.")]
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


def up(
    out: Out = None,
    seed: Seed = 1,
    speed: Rate = Speed.REAL,
    scene: SceneFile = None,
    only: Annotated[str, typer.Option(help="Names of processes, comma between; else all.")] = "",
    insecure: Insecure = False,
    wait: Annotated[bool, typer.Option(help="Come back when all are ready.")] = True,
    form: Form = Format.TEXT,
) -> None:
    """Bring the fleet up in the background.

    Examples:
      roco up
      roco up --speed max --seed 7
      roco up --insecure --out runs/today
      roco up --only router,monitor,km,pl
    """
    with problems(form):
        run = (out or runs.new_run(datetime.now())).resolve()
        supervisor = fleet.start(run, [*options(seed, speed, scene, insecure), "--only", only])
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


def down(target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Bring the fleet down in order; works with a dead supervisor, too.

    Examples:
      roco down
      roco down --run-dir runs/today
      roco down --target compose
    """
    with problems(form):
        found = targets.find(target, run_dir)
        with waiting("the fleet ends, the report is written", form):
            names = found.down()
        words = f"ended {', '.join(names)}" if names else f"nothing of {found.where} was running"
        tell(Reply(words, found.where), form)


def demo(
    seed: Seed = 1,
    out: Out = None,
    speed: Rate = Speed.REAL,
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
    with problems(form):
        run = (out or runs.new_run(datetime.now())).resolve()
        console = Console()
        watch = main_job.Watch(run, "The Robot Companion pours", console, form is Format.JSON)
        report = main_job.play(run, options(seed, speed, scene, insecure), watch)
        said = main_job.verdict_json if form is Format.JSON else main_job.verdict
        console.out(said(report, run), highlight=False)
        if has_display() if headless is None else not headless:
            main_job.show(run)
        if not report.success:
            raise typer.Exit(1)


def options(seed: int, speed: Speed, scene: Path | None, insecure: bool) -> list[str]:
    """The supervisor's options of a run."""
    others = [*(["--scene", str(scene)] if scene else []), *(["--insecure"] if insecure else [])]
    return ["--seed", str(seed), "--speed", speed.value, *others]


def has_display() -> bool:
    """Whether a window could be seen."""
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
