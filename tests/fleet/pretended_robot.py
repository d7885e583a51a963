"""A robot that is only words: acts of two motions each, done in virtual time, in a world of a few
poses.

It stands in the place of worker and loop beside ex's agent (the same words), so the agent and its
journal are the true ones. What it holds is what ex remembers; where things stand is the world's,
which outlives every process.
"""

import numpy as np
from msgspec.structs import replace

from companion.languages import rc, rs
from companion.languages.values import Pose
from companion.skills.loop_messages import motion
from companion.tasks.pour.done import Pour
from services.executor import device_messages
from services.executor.memory import Holding

REST = np.zeros(15)
PLACED = Pose((0.8, 0.0, 0.9))
MOTION_S = 1.0
KNOTS = np.zeros((101, 15))  # 1 s


class World:
    """Poses of things, and how often each act moved the robot (by key)."""

    def __init__(self):
        self.poses = {
            "table_1": Pose((0.9, 0.0, 0.45)),
            "cabinet_1": Pose((0.9, 0.6, 0.9)),
            "jar_1": Pose((0.85, 0.6, 1.0)),
            "bowl_1": Pose((0.85, 0.5, 1.2)),
        }
        self.models = {
            "table_1": "table",
            "cabinet_1": "cabinet_no_door",
            "jar_1": "jar",
            "bowl_1": "bowl_high",
        }
        self.poured = 0
        self.begun = []
        self.looks = 0
        self.sim_time = 0.0


class Robot:
    """The device; `later(delay, call)` is the wires' virtual time. `looks`: at each motion it looks
    once.
    """

    busy = False

    def __init__(self, post, world, later, looks=False):
        self._post, self._world, self._later, self._looks = post, world, later, looks
        self._act = None
        self._perform = None
        self._moving = ""
        self._count = 0

    def tell(self, content):
        """Take a word of ex."""
        match content:
            case device_messages.Where(number=number) | device_messages.Halt(number=number):
                self._moving = ""
                self._post(device_messages.Stands(number, self._felt("idle")), 0.01)
            case device_messages.Perform() as perform:
                self._perform, self._act = perform, self._skill(perform)
                self._go_on(perform.number, None)
            case device_messages.Do(number=number, motion=asked):
                self._begin(number, asked)
            case device_messages.Brake(number=number):
                if self._moving:
                    self._moving = ""
                    self._post(device_messages.Moved(number, self._felt("cancelled")), 0.05)
            case device_messages.Feel(number=number, felt=felt):
                self._go_on(number, felt)
            case device_messages.Glance(number=number):
                if self._perform is not None and self._perform.number == number:
                    self._post(device_messages.GoOn(number, self._perform.command.key, 60.0), 0.05)
            case device_messages.GoOn():
                self._world.looks += 1
            case device_messages.Drop():
                self._act = self._perform = None

    def close(self):
        """Killed: a motion under way has no end that anybody hears of."""
        self._act, self._moving = None, ""

    def _begin(self, number, asked):
        self._world.begun.append(asked.key)
        self._count += 1
        motion_under_way = self._moving = f"{asked.key}#{self._count}"

        def end():
            if self._moving == motion_under_way:
                self._moving = ""
                self._world.sim_time += MOTION_S
                self._post(device_messages.Moved(number, self._felt("done")))

        def look():
            if self._moving == motion_under_way:
                self._post(device_messages.Passing(number, self._felt("running")))

        if self._looks:
            self._later(MOTION_S / 2.0, look)
        self._later(MOTION_S, end)

    def _felt(self, ended):
        q = REST.tobytes()
        return device_messages.Felt(
            q=q, measured=q, head=(0.0, 0.0), time=self._world.sim_time, ended=ended
        )

    def _go_on(self, number, felt):
        perform = self._perform
        if perform is None or self._act is None:
            return
        if felt is not None and felt.ended != "done":
            kept = perform.remembered
            self._act = None
            outcome = kept.not_done(perform.command.key, felt.ended, felt.why)
            self._post(device_messages.Ended(number, outcome, kept), 0.01)
            return
        following = next(self._act, None)
        if following is not None:
            self._post(device_messages.Move(number, following, 2.0, perform.remembered), 0.02)
            return
        self._act = None
        kept = self._changed(perform.command, perform.remembered)
        seen = tuple(self._sights(kept)) if isinstance(perform.command, rc.Look) else ()
        outcome = rc.Done(perform.command.key, _posture(kept), seen, kept.holding(), 2.0)
        if isinstance(perform.command, Pour):
            outcome = replace(outcome, weighed=(0.26, 0.2), arrived=True)
        self._post(device_messages.Ended(number, outcome, kept), 0.01)

    def _skill(self, perform):
        command, held = perform.command, perform.remembered.held
        if isinstance(command, rc.Release) and command.side not in held:
            return
        yield motion(command.key, KNOTS)
        yield motion(command.key, KNOTS)

    def _sights(self, kept):
        held = {one.object for one in kept.held.values()}
        for name, pose in self._world.poses.items():
            if name not in held:
                yield rs.Seen(name, self._world.models[name], pose, self._world.sim_time)

    def _changed(self, command, kept):
        held = dict(kept.held)
        match command:
            case rc.Grasp(side=side, object=name, grasp=grasp, mass=mass):
                held[side] = Holding(name, grasp, Pose((0.0, 0.0, 0.1)), mass)
            case rc.Release(side=side, object=name):
                if side in held:
                    self._world.poses[name] = command.place or PLACED
                    del held[side]
            case Pour():
                self._world.poured += 1
        return replace(kept, q=tuple(float(x) for x in REST), held=held, time=self._world.sim_time)


def _posture(kept):
    posture = kept.posture()
    assert posture is not None
    return posture
