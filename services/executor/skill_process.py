"""The child process of ex that runs skills and owns the receptor. It sends motions and outcomes.

Between acts it keeps only what is slow to make (robot model, copy of the world). A situation is
made of what the agent remembers, so a new process goes on where the old one died.
"""

from collections import deque
from collections.abc import Callable

import numpy as np
import pinocchio as pin

from agent_runtime.core.errors import WorkerError
from agent_runtime.io.worker import Link
from companion.acts import ACTS
from companion.eyes import Eyes
from companion.languages import rs
from companion.languages.values import Pose, Side
from companion.skills.loop_messages import Cancel, LookAgain
from companion.skills.performing import perform
from companion.skills.situation import Eye, Held, Neck, Sight, Situation, beginning
from companion.skills.skill import Asked, Sensed
from services.executor import simulation
from services.executor.device_messages import (
    Brake,
    ByRays,
    Ended,
    Feel,
    Glance,
    GoOn,
    Move,
    Perform,
    Setup,
    ToSkill,
    duration,
    scene_of,
)
from services.executor.memory import Felt, Holding, SituationRecord
from services.executor.receptor import PixelReceptor
from services.executor.renderer import Blind, Saw, See
from velma import names
from velma.kinematics.frames import transform, xyz_quat
from velma.kinematics.robot import Robot
from velma.names import Array


class Stage:
    """Objects kept between acts: the robot model, the receptor, the model of each marked thing."""

    def __init__(
        self, setup: Setup, tell: Callable[[ByRays], None], ask: Callable[[See], Saw | Blind]
    ) -> None:
        """`tell` takes the word that its eyes are others now; `ask` waits for a look by pixels."""
        self._scene, self._tell = scene_of(setup), tell
        self.robot = Robot()
        self.things = simulation.model_names(self._scene)
        self.markers = simulation.markers(self._scene)
        by_pixels = setup.eyes is Eyes.PIXELS
        self.eye: Eye = (
            PixelReceptor(ask, self.robot) if by_pixels else simulation.receptor(self._scene)
        )

    def situation(self, kept: SituationRecord, felt: Felt) -> Situation:
        """Return what ex knows at the start of an act."""
        here = beginning(self.robot, dict(self.things), self.markers)
        here.stand(felt.setpoint(), felt.head, felt.fingers, felt.time)
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
            held = one.object, one.grasp, transform(one.pose), one.mass
            here.take(str(side), Held(*held, steady, one.apart, one.slipped))
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


def remembered(here: Situation, epoch: str) -> SituationRecord:
    """Return a situation as plain data; `epoch` names its world."""
    seen = {
        name: rs.Seen(
            name, here.models[name], _pose(pose), here.time, here.contents.get(name),
            here.uncertain.get(name),
        )
        for name, pose in here.seen.items()
    }  # fmt: skip
    held = {Side(side): _holding(one) for side, one in here.held.items()}
    fingers = {Side(side): float(angle) for side, angle in here.fingers.items()}
    head = (float(here.head[0]), float(here.head[1]))
    q, time = tuple(float(x) for x in here.q), float(here.time)
    placed, unfinished = dict(here.placed), dict(here.unfinished)
    return SituationRecord(q, head, fingers, seen, held, placed, unfinished, time, epoch, here.ill)


def _pose(transform: pin.SE3) -> Pose:
    return Pose(*xyz_quat(transform))


def _holding(one: Held) -> Holding:
    steady = None if one.steady is None else _pose(one.steady)
    inside = _pose(one.T_grip_object)
    return Holding(one.object, one.grasp, inside, one.mass, steady, one.apart, one.slipped)


def serve(link: Link) -> None:
    """Run one act after the other until the agent is gone."""
    words = AgentMessages(link)
    stage = Stage(link.recv(Setup), link.send, words.looked)
    word = words.next()
    while True:
        word = _act(link, words, stage, word) if isinstance(word, Perform) else words.next()


class AgentMessages:
    """What the agent says, one word after the other; a look is answered before what was said
    meanwhile.
    """

    def __init__(self, link: Link) -> None:
        self._link, self._meanwhile = link, deque[ToSkill]()

    def next(self) -> ToSkill:
        """Return the next word."""
        word: ToSkill = self._meanwhile.popleft() if self._meanwhile else self._link.recv(ToSkill)
        return word

    def looked(self, see: See) -> Saw | Blind:
        """Ask for a look, and wait for it."""
        self._link.send(see)
        while not isinstance(word := self._link.recv(ToSkill), Saw | Blind):
            self._meanwhile.append(word)
        return word


def _act(link: Link, words: AgentMessages, stage: Stage, word: Perform) -> ToSkill:
    """Run one skill; return the first message that does not belong to it."""
    here = stage.situation(word.remembered, word.felt)
    work = perform(here, word.command)

    def kept() -> SituationRecord:
        return remembered(here, word.felt.epoch)

    def told(asked: Asked) -> Move | GoOn | Brake:
        match asked:
            case LookAgain(key=key, in_s=in_s):
                return GoOn(word.number, key, in_s)
            case Cancel(key=key):
                return Brake(word.number, key or word.command.key)
        return Move(word.number, asked, duration(asked) + ACTS[type(word.command)].rest_s, kept())

    try:
        asked = next(work)
        while True:
            link.send(told(asked))
            reply = words.next()
            if not isinstance(reply, Feel | Glance) or reply.number != word.number:
                return reply
            asked = work.send(stage.sensed(reply.felt))
    except StopIteration as stop:
        link.send(Ended(word.number, stop.value, kept(), here.refused))
    return words.next()
