"""What the loop does in a robot's life, done once with a robot of its own before the true one
moves.

The memory of the loop is locked page by page as it is touched (process.py). A page of a library
that was never needed before has to be found, or even read from the disk, in the middle of a cycle.
Those that motions need are there then.
"""

import copy
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from companion.languages.facts import Kind, fact
from companion.skills.loop_messages import (
    Cancel,
    Close,
    HeadGoal,
    LookAgain,
    Motion,
    Move,
    Open,
    Payload,
    Phase,
    Release,
    Until,
    motion,
)
from services.executor.loop.link import AgentLink, StopLink
from services.executor.loop.process import LATE_TURNS, LoopProcess
from velma.model.kinds import MOVEABLE
from velma.names import GRIP_BODY, Array
from velma.sim.backend import Backend
from velma.sim.mock_backend import MockBackend
from velma.sim.mujoco_backend import AWAKE, MujocoBackend

SLOTS = "loop.slots"
KNOTS = 4  # of a motion, 0.03 s
MOST_TURNS = 150  # of one motion
PRESSED_CYCLES = HELD_TURNS = 10


def rehearse(run: Path, robot: Backend, build: Callable[[Path, Backend], LoopProcess]) -> None:
    """Rehearse with a robot like this one, in a folder of `run` that is removed again."""
    with tempfile.TemporaryDirectory(dir=run, prefix=".rehearsal-") as folder:
        path, twin = Path(folder) / SLOTS, _twin(robot)
        process = build(path, twin)
        agent, stop = AgentLink(path), StopLink(path)
        for asked in _motions(process.core.setpoint):
            agent.send(asked)
            _turn(process, agent)
        if isinstance(twin, MujocoBackend):
            _press(twin)
            for _ in range(PRESSED_CYCLES):
                process.core.cycle()
        agent.send(motion("cancelled", _rise(process.core.setpoint)))
        process.turn()
        agent.send(Cancel(None))
        _turns(process)
        process.core.abandon((fact(Kind.ENDED, "loop"),))
        _turn(process, agent)
        agent.file.slots["command"].write(b"no command")
        _turn(process, agent)
        agent.send(Release())
        _turns(process)
        stop.stop()
        _turns(process)
        stop.release()
        _turns(process)
        process.end()


def _twin(robot: Backend) -> Backend:
    if isinstance(robot, MujocoBackend):
        return MujocoBackend(robot.scene, copy.copy(robot.model))
    return MockBackend()


def _motions(start: Array) -> tuple[Motion, ...]:
    """Return motions that use all that a motion may ask for."""
    there = _rise(start)
    back, rest = there[::-1], {"settle_s": 0.02}
    payload = Payload(0.3, (0.0, 0.0, 0.1), 0.06)
    close = Close(0.01, upto=0.05, speed=3.0, settle_s=0.02)
    open_ = Open(0.01, 1.0)
    return (
        motion(
            "there", there, head=HeadGoal(0.02, 0.02, 1.0), right=Move((0.02, 0.02, 0.02)),
            payload_right=payload,
            tare="left", look_every_s=0.02, **rest,
        ),
        motion("back", back, until=Until.CONTACT, payload_right=Payload(), **rest),
        motion("close", start, right=close, left=close, until=Until.TOUCH, **rest),
        motion("open", start, right=open_, left=open_, **rest),
        motion("pull", start, until=Until.PULL, **rest),
    )  # fmt: skip


def _rise(start: Array) -> Array:
    return start + np.linspace(0.0, 0.02, KNOTS)[:, None] ** 2


def _turn(process: LoopProcess, agent: AgentLink) -> None:
    """Turn until nothing goes on; the agent is silent for a while at first, and answers looks."""
    for turn in range(MOST_TURNS):
        process.turn()
        if turn > LATE_TURNS:
            agent.beat()
        told = agent.told()
        if told.look:
            agent.send(LookAgain(told.report.key, 0.02))
        if told.report.phase is not Phase.RUNNING and not process.core.busy:
            return


def _turns(process: LoopProcess) -> None:
    for _ in range(HELD_TURNS):
        process.turn()


def _press(robot: MujocoBackend) -> None:
    """Put the things that can be taken where a hand is."""
    model, data = robot.model, robot.data
    data.tree_asleep[:] = AWAKE
    for thing in robot.scene.of(*MOVEABLE):
        place = model.jnt_qposadr[model.body(thing.id).jntadr[0]]
        data.qpos[place : place + 3] = data.body(GRIP_BODY["right"]).xpos
