"""The loop as a process: `python -m services.executor.loop --slots FILE`.

Owns the clock, the priority and the signals. It opens no network, and writes two lines to stderr in its life: how it
began and why it ended.
"""

import signal
import sys
from enum import StrEnum
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer

from agent_runtime.io.pulse import Pulse, Turns
from services.executor.loop.core import LoopCore
from services.executor.loop.link import LoopLink
from services.executor.loop.process import LoopProcess, Speed
from services.executor.loop.timing import Pacer, still_memory, take_priority
from velma.errors import VelmaError
from velma.model import scene
from velma.sim.mock_backend import MockBackend
from velma.sim.mujoco_backend import MujocoBackend
from velma.sim.truth import TruthReader

app = typer.Typer(add_completion=False, help=__doc__)


class BackendName(StrEnum):
    """What stands behind the loop."""

    MUJOCO = "mujoco"
    MOCK = "mock"


def build(slots: Path, *, asked: scene.Scene, speed: Speed, backend: BackendName, realtime: bool) -> LoopProcess:
    """The loop of a scene, settled and published: a reader of `slots` finds a state."""
    if backend is BackendName.MOCK:
        body: MockBackend | MujocoBackend = MockBackend()
        truth = None
    else:
        body = MujocoBackend(asked)
        truth = TruthReader(body)
    core = LoopCore(body)
    pacer = Pacer(body.period_s, realtime)
    return LoopProcess(core, LoopLink(slots), speed=speed, truth=truth, pacer=pacer)


@app.command()
def main(
    slots: Annotated[Path, typer.Option(envvar="ROCO_SLOTS", help="file in which loop and agent meet")],
    scene_file: Annotated[
        str, typer.Option("--scene", envvar="ROCO_SCENE", help="TOML file of the scene; empty: the canonical one")
    ] = "",
    seed: Annotated[
        int | None, typer.Option(envvar="ROCO_SEED", help="vary the scene by this seed; without one it stays as it is")
    ] = None,
    speed: Annotated[Speed, typer.Option(envvar="ROCO_SPEED", help="1: real time; max: only acts, fast")] = Speed.REAL,
    backend: Annotated[BackendName, typer.Option(help="a simulated or a pretended robot")] = BackendName.MUJOCO,
) -> None:
    """Run the control loop until SIGTERM."""
    asked: list[int] = []

    def end(number: int, _frame: FrameType | None) -> None:
        asked.append(number)

    signal.signal(signal.SIGTERM, end)
    signal.signal(signal.SIGINT, end)
    try:
        found = scene.load(Path(scene_file)) if scene_file else scene.load()
    except VelmaError as error:
        typer.echo(f"loop: {error}", err=True)
        raise typer.Exit(2) from None
    if seed is not None:
        found = scene.vary(found, seed)
    turns = Turns(Pulse(slots.parent, "loop"))  # before the priority, which its thread would inherit
    # Priority only where the loop rests between cycles: a process that never rests would starve the agents.
    refused = take_priority() if speed is Speed.REAL else ""
    process = build(slots, asked=found, speed=speed, backend=backend, realtime=speed is Speed.REAL and not refused)
    still_memory()
    typer.echo(f"loop: {found.name}, speed {speed}" + (f"; {refused}" if refused else ""), err=True)
    ready = slots.with_name("loop.ready")  # beside the slots, as every process of a run folder says it
    ready.touch()
    while not asked:
        process.turn()
        turns.count += 1
    process.end()
    turns.end()
    ready.unlink(missing_ok=True)
    typer.echo(f"loop: ended by signal {asked[0]} after {process.core.cycles} cycles", err=True)


if __name__ == "__main__":
    sys.exit(app())
