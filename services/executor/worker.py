"""The worker of ex: a child process that runs skills and owns the receptor; it yields motions and outcomes.

It keeps nothing between acts but what is dear to make (robot model, mirror of the world): a situation is made of what
the agent remembers, so a new worker goes on where the old one died.
"""

import numpy as np

from agent_runtime.io.worker import Link
from companion.languages import rc, rs
from companion.languages.values import Pose, Side
from services.executor import virtual
from services.executor.doing import duration
from services.executor.loop.program import Motion
from services.executor.receptor import Receptor
from services.executor.remembered import Holding, Remembered
from services.executor.setting import scene_of
from services.executor.skills.performing import perform
from services.executor.skills.situation import Held, Situation, beginning
from services.executor.skills.skill import Sensed
from services.executor.words import Ended, Feel, Felt, Move, Perform, Setup, ToWorker
from velma.kinematics import timing
from velma.kinematics.frames import transform, xyz_quat
from velma.kinematics.robot import Robot

# What an act takes beside its first motion [s, simulated]; estimates, they only bound how long anybody waits.
REST_S = {rc.Grasp: 12.0, rc.Release: 20.0, rc.Pour: 30.0, rc.Look: 8.0, rc.MoveCartesian: 5.0}


class Stage:
    """What outlives an act: the robot's model, the receptor, what a marker says about its thing."""

    def __init__(self, setup: Setup) -> None:
        asked = scene_of(setup)
        self.robot, self.things = Robot(), virtual.things(asked)
        self.eye: Receptor = virtual.receptor(asked)

    def situation(self, kept: Remembered, felt: Felt) -> Situation:
        """What ex knows at the beginning of an act."""
        here = beginning(self.robot, dict(self.things))
        here.q, here.head, here.time = felt.setpoint().copy(), felt.head, felt.time
        for name, seen in kept.seen.items():
            here.place(name, transform(seen.pose))
        for side, angle in kept.fingers.items():
            here.set_fingers(str(side), angle)
        for side, one in kept.held.items():
            here.take(str(side), Held(one.object, one.grasp, transform(one.pose), one.mass))
        return here

    def sensed(self, felt: Felt) -> Sensed:
        """What the loop felt, with what the receptor sees."""
        return Sensed(
            ended=felt.ended,
            reason=felt.reason,
            q=felt.setpoint().copy(),
            measured=np.frombuffer(felt.measured).copy(),
            touched=dict(felt.touched),
            fingers=dict(felt.fingers),
            head=felt.head,
            sights=self.eye.look(np.frombuffer(felt.world)) if felt.world else [],
            time=felt.time,
        )


def remembered(here: Situation) -> Remembered:
    """A situation in plain words."""
    seen = {
        name: rs.Seen(name, here.models[name], Pose(*xyz_quat(pose)), here.time) for name, pose in here.seen.items()
    }
    held = {
        Side(side): Holding(one.object, one.grasp, Pose(*xyz_quat(one.T_grip_object)), one.mass)
        for side, one in here.held.items()
    }
    fingers = {Side(side): float(angle) for side, angle in here.fingers.items()}
    head = (float(here.head[0]), float(here.head[1]))
    return Remembered(tuple(float(x) for x in here.q), head, fingers, seen, held, float(here.time))


def serve(link: Link) -> None:
    """The child: one act after another, until the agent is gone."""
    stage = Stage(link.recv(Setup))
    word = link.recv(ToWorker)
    while True:
        word = _act(link, stage, word) if isinstance(word, Perform) else link.recv(ToWorker)


def _act(link: Link, stage: Stage, word: Perform) -> Perform | Feel:
    """Run one skill; the first word that does not belong to it."""
    here = stage.situation(word.remembered, word.felt)
    work = perform(here, word.command)
    try:
        motion = next(work)
        while True:
            link.send(Move(word.number, motion, _expected(word.command, motion), remembered(here)))
            reply: Perform | Feel = link.recv(ToWorker)
            if not isinstance(reply, Feel) or reply.number != word.number:
                return reply
            motion = work.send(stage.sensed(reply.felt))
    except StopIteration as stop:
        link.send(Ended(word.number, stop.value, remembered(here)))
        timing.loaded()  # the first act is a look, which does without; now nobody waits
    following: Perform | Feel = link.recv(ToWorker)
    return following


def _expected(command: rc.Act, motion: Motion) -> float:
    return duration(motion) + REST_S.get(type(command), 2.0)
