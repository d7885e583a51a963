"""The loop as a process: `python -m services.executor.loop --slots FILE`.

Owns the clock, the priority and the signals. It opens no network, and writes two lines to stderr:
how it started and why it ended.
"""

import signal
import sys
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer

from agent_runtime.io.options import USAGE_ERROR
from agent_runtime.io.run_files import ProcessHeartbeat, Turns
from services.executor.loop.backends import SHORT, maker
from services.executor.loop.core import LoopCore
from services.executor.loop.link import LoopLink
from services.executor.loop.memory import MEMORY, Keeper, Restorable
from services.executor.loop.process import (
    SETTLE_S,
    LoopProcess,
    Pacer,
    Restable,
    Speed,
    Stillness,
    still_memory,
    take_priority,
)
from services.executor.loop.rehearsal import rehearse
from velma.errors import NoRobotError, VelmaError
from velma.model import scene
from velma.sim.backend import Backend
from velma.sim.mujoco_backend import MujocoBackend
from velma.sim.truth import TruthReader

app = typer.Typer(add_completion=False, help=__doc__)
FAILED = 1
"""Exit code after which a supervisor tries again."""


def build(
    slots: Path, backend: Backend, *, speed: Speed, realtime: bool, settle_s: float = SETTLE_S
) -> LoopProcess:
    """Return the loop of a back-end, settled and published: a reader of `slots` finds a state."""
    # Only a simulation knows the true state of the world.
    truth = TruthReader(backend) if isinstance(backend, MujocoBackend) else None
    core, pacer = LoopCore(backend), Pacer(backend.period_s, realtime)
    keeper = (
        Keeper(slots.with_name(MEMORY), core, backend) if isinstance(backend, Restorable) else None
    )
    # At speed max no time passes between acts.
    still = (
        Stillness(core, backend) if speed is Speed.REAL and isinstance(backend, Restable) else None
    )
    stirred = None
    if isinstance(backend, MujocoBackend):
        stirred = backend.disturbed
        if keeper is not None and keeper.restored:
            backend.resume()
    return LoopProcess(
        core, LoopLink(slots), speed=speed, truth=truth, pacer=pacer, keeper=keeper, still=still,
        stirred=stirred,
        settle_s=settle_s,
    )  # fmt: skip


@app.command()
def main(
    slots: Annotated[
        Path, typer.Option(envvar="ROCO_SLOTS", help="file in which loop and agent meet")
    ],
    scene_file: Annotated[
        str,
        typer.Option(
            "--scene", envvar="ROCO_SCENE", help="TOML file of the scene; empty: the canonical one"
        ),
    ] = "",
    seed: Annotated[
        int,
        typer.Option(envvar="ROCO_SEED", help="vary the scene by this seed; 0: as it is written"),
    ] = 0,
    speed: Annotated[
        Speed, typer.Option(envvar="ROCO_SPEED", help="1: real time; max: only acts, fast")
    ] = Speed.REAL,
    backend: Annotated[
        str,
        typer.Option(
            envvar="ROCO_BACKEND",
            help=f"{', '.join(SHORT)}, or package.module:function that makes one",
        ),
    ] = "mujoco",
) -> None:
    """Run the control loop until SIGTERM."""
    asked: list[int] = []

    def end(number: int, _frame: FrameType | None) -> None:
        asked.append(number)

    signal.signal(signal.SIGTERM, end)
    signal.signal(signal.SIGINT, end)
    try:
        world = scene.load(Path(scene_file)) if scene_file else scene.load()
        robot = maker(backend, scene.vary(world, seed))()
    except VelmaError as error:
        typer.echo(f"loop: {error}", err=True)
        raise typer.Exit(FAILED if isinstance(error, NoRobotError) else USAGE_ERROR) from None
    # Before the priority, which their threads would inherit: the pulse, and the drivers of a
    # back-end.
    turns = Turns(ProcessHeartbeat(slots.parent, "loop"))
    if speed is Speed.REAL:
        rehearse(slots.parent, robot, partial(build, speed=Speed.MAX, realtime=False, settle_s=0.0))
    # Priority only where the loop rests between cycles: a process that never rests would starve the
    # agents.
    refused = take_priority() if speed is Speed.REAL else ""
    process = build(slots, robot, speed=speed, realtime=speed is Speed.REAL and not refused)
    still_memory()
    begun = ", world restored" if process.restored else ""
    typer.echo(
        f"loop: {backend}, scene {world.name}{begun}, speed {speed}{refused and f'; {refused}'}",
        err=True,
    )
    ready = slots.with_name("loop.ready")  # beside the slots, as for every process of a run folder
    ready.touch()
    while not asked:
        process.turn()
        turns.count += 1
    process.end()
    getattr(robot, "close", lambda: None)()
    turns.end()
    ready.unlink(missing_ok=True)
    typer.echo(f"loop: ended by signal {asked[0]} after {process.core.cycles} cycles", err=True)


if __name__ == "__main__":
    sys.exit(app())
