"""The child process of ex that runs skills and owns the receptor. It sends motions and outcomes.

Between acts it keeps only what is slow to make (robot model, copy of the world). A situation is made of what the agent
remembers, so a new process goes on where the old one died.
"""

from collections.abc import Callable

import numpy as np

from agent_runtime.core.errors import WorkerError
from agent_runtime.io.worker import Link
from companion.languages import rc, rs
from companion.languages.values import Pose, Side
from services.executor import simulation
from services.executor.acting import duration
from services.executor.local import Array, Brake, ByRays, Ended, Felt, GoOn, Move, Perform, Setup, ToSkill
from services.executor.loop.program import Cancel, LookAgain, Motion
from services.executor.remembered import Holding, Remembered
from services.executor.sight import Eye, Neck, Sight
from services.executor.skills.performing import perform
from services.executor.skills.situation import Held, Situation, beginning
from services.executor.skills.skill import Asked, Sensed
from services.executor.world import scene_of
from velma import names
from velma.kinematics.frames import transform, xyz_quat
from velma.kinematics.robot import Robot

# Duration of an act beside its first motion [s, simulated]; estimates, used only for time-outs.
REST_S = {rc.Grasp: 12.0, rc.Release: 20.0, rc.Pour: 30.0, rc.OpenDoor: 20.0, rc.Look: 15.0, rc.MoveCartesian: 5.0}


class Stage:
    """Objects kept between acts: the robot model, the receptor, the model of each marked thing."""

    def __init__(self, setup: Setup, tell: Callable[[ByRays], None]) -> None:
        """`tell` takes the word that its eyes are others now."""
        self._scene, self._tell = scene_of(setup), tell
        self.robot = Robot()
        self.things, self.markers = simulation.things(self._scene), simulation.markers(self._scene)
        self.eye: Eye = simulation.receptor(self._scene, setup.eyes)

    def situation(self, kept: Remembered, felt: Felt) -> Situation:
        """Return what ex knows at the start of an act."""
        here = beginning(self.robot, dict(self.things), self.markers)
        here.q, here.head, here.time = felt.setpoint().copy(), felt.head, felt.time
        for name, seen in kept.seen.items():
            here.place(name, transform(seen.pose))
            if seen.content is not None:
                here.contents[name] = seen.content
            if seen.uncertainty is not None:
                here.uncertain[name] = seen.uncertainty
        for side, angle in kept.fingers.items():
            here.set_fingers(str(side), angle)
        for side, one in kept.held.items():
            steady = None if one.steady is None else transform(one.steady)
            inside = transform(one.pose)
            here.take(str(side), Held(one.object, one.grasp, inside, one.mass, steady, one.apart, one.slipped))
        here.unfinished, here.ill = dict(kept.unfinished), kept.ill
        here.placed = dict(kept.placed)
        here.put = {name: here.seen[name] for name in kept.placed}
        return here

    def sensed(self, felt: Felt) -> Sensed:
        """Return what the loop measured, with what the eyes see."""
        measured = np.frombuffer(felt.measured).copy()
        neck: Neck = (float(measured[names.TORSO]), *felt.head)
        return Sensed(
            ended=felt.ended,
            why=felt.why,
            q=felt.setpoint().copy(),
            measured=measured,
            touched=dict(felt.touched),
            fingers=dict(felt.fingers),
            grips=dict(felt.grips),
            head=felt.head,
            sights=self._seen(np.frombuffer(felt.world), neck) if felt.world else [],
            time=felt.time,
            wrong=self.eye.wrong,
            off=self.eye.off,
        )

    def _seen(self, world: Array, neck: Neck) -> list[Sight]:
        """Look; where eyes by pixels cannot, by rays from now on."""
        try:
            return self.eye.look(world, neck)
        except WorkerError as error:
            self.eye.close()
            self.eye = simulation.receptor(self._scene)
            self._tell(ByRays(error.what))
            return self.eye.look(world, neck)


def remembered(here: Situation, epoch: str) -> Remembered:
    """Return a situation as plain data; `epoch` names its world."""
    seen = {
        name: rs.Seen(
            name,
            here.models[name],
            Pose(*xyz_quat(pose)),
            here.time,
            here.contents.get(name),
            here.uncertain.get(name),
        )
        for name, pose in here.seen.items()
    }
    held = {
        Side(side): Holding(
            one.object,
            one.grasp,
            Pose(*xyz_quat(one.T_grip_object)),
            one.mass,
            None if one.steady is None else Pose(*xyz_quat(one.steady)),
            one.apart,
            one.slipped,
        )
        for side, one in here.held.items()
    }
    fingers = {Side(side): float(angle) for side, angle in here.fingers.items()}
    head = (float(here.head[0]), float(here.head[1]))
    q, time = tuple(float(x) for x in here.q), float(here.time)
    return Remembered(q, head, fingers, seen, held, dict(here.placed), dict(here.unfinished), time, epoch, here.ill)


def serve(link: Link) -> None:
    """Run one act after the other until the agent is gone."""
    stage = Stage(link.recv(Setup), link.send)
    word = link.recv(ToSkill)
    while True:
        word = _act(link, stage, word) if isinstance(word, Perform) else link.recv(ToSkill)


def _act(link: Link, stage: Stage, word: Perform) -> ToSkill:
    """Run one skill; return the first message that does not belong to it."""
    here = stage.situation(word.remembered, word.felt)
    work = perform(here, word.command)

    def kept() -> Remembered:
        return remembered(here, word.felt.epoch)

    def told(asked: Asked) -> Move | GoOn | Brake:
        match asked:
            case LookAgain(key=key, in_s=in_s):
                return GoOn(word.number, key, in_s)
            case Cancel(key=key):
                return Brake(word.number, key or word.command.key)
        return Move(word.number, asked, _expected(word.command, asked), kept())

    try:
        asked = next(work)
        while True:
            link.send(told(asked))
            reply: ToSkill = link.recv(ToSkill)
            if isinstance(reply, Perform) or reply.number != word.number:
                return reply
            asked = work.send(stage.sensed(reply.felt))
    except StopIteration as stop:
        link.send(Ended(word.number, stop.value, kept(), here.refused))
    following: ToSkill = link.recv(ToSkill)
    return following


def _expected(command: rc.Act, motion: Motion) -> float:
    return duration(motion) + REST_S.get(type(command), 2.0)
