"""A simulated robot with its skills and no agents: acts in, outcomes out, copies of it for tests
that begin in the same state. What it is told to grasp, it works out by itself, as the planner
would.
"""

import copy
import dataclasses
from collections.abc import Callable

import numpy as np

from companion import models
from companion.languages import rc
from companion.languages.values import Pose
from companion.look_around import POINTS
from companion.skills.loop_messages import Motion, Phase
from companion.skills.performing import perform
from companion.skills.situation import beginning
from services.executor.loop.core import LoopCore
from services.executor.simulation import InProcess, markers, model_names, receptor
from velma.kinematics import motion
from velma.kinematics.collision import MARGIN
from velma.kinematics.frames import lies, transform, xyz_quat
from velma.kinematics.robot import Robot
from velma.kinematics.tasks import attaching
from velma.kinematics.tasks.grasping import GraspWay, Target, approaches
from velma.kinematics.tasks.placing import backwards
from velma.model.scene import load, vary
from velma.names import COLUMNS
from velma.sim.mujoco_backend import MujocoBackend
from velma.sim.truth import TruthReader

OUT_M, LIFT_M = 0.28, 0.03  # task runs with the true robot model
WAYS_IN_TRIED = 4

CancelWhen = Callable[[Motion, LoopCore], bool]


class Interruptible(InProcess):
    """A body of which a motion is cancelled as soon as `when` says so, once."""

    def __init__(self, core, eye, when=None):
        super().__init__(core, eye)
        self.when, self.cancelled = when, False

    def do(self, motion):
        """Run a motion; the first ending after a cancel is a cancelled one, as the agent has it."""
        fresh = False
        self.core.begin(motion)
        while self.core.report.phase is Phase.RUNNING:
            self.core.cycle()
            if self.when is not None and not self.cancelled and self.when(motion, self.core):
                self.cancelled = fresh = True
                self.core.cancel()
        sensed = self.sensed()
        late = fresh and sensed.ended == "done"
        return dataclasses.replace(sensed, ended="cancelled") if late else sensed


class Acting:
    """One robot in one world, and what it knows of it."""

    def __init__(self, seed=7, whole=None):
        scene = vary(whole or load(), seed)
        self.core, self.eye = LoopCore(MujocoBackend(scene)), receptor(scene)
        self.core.hold(0.4)
        self.robot, self.things, self.markers = Robot(), model_names(scene), markers(scene)
        self.here = beginning(self.robot, self.things, self.markers)
        self._acts = 0
        self.retreats = {}
        self.taking = None

    def copied(self):
        """Another one in the same state; robot model and eye are shared, since both forget what
        they were asked.
        """
        other = copy.copy(self)
        other.core, other.retreats = copy.deepcopy(self.core), dict(self.retreats)
        other.here = beginning(self.robot, self.things, self.markers)
        other.here.stand(self.here.q, self.here.head, self.here.bent, self.here.time)
        for name, pose in self.here.seen.items():
            other.here.place(name, pose)
        for side, angle in self.here.fingers.items():
            other.here.set_fingers(side, angle)
        for side, held in self.here.held.items():
            other.here.take(side, dataclasses.replace(held))
        return other

    def act(self, command, when=None):
        """Perform a command, cancelled when `when` says so."""
        body, work = Interruptible(self.core, self.eye, when), perform(self.here, command)
        try:
            asked = next(work)
            while True:
                asked = work.send(body.do(asked))
        except StopIteration as stop:
            assert when is None or body.cancelled, "the act was over before it was cancelled"
            return stop.value

    def done(self, command):
        """Perform a command that must be done."""
        outcome = self.act(command)
        assert isinstance(outcome, rc.Done), outcome
        return outcome

    @property
    def truth(self):
        """The true state."""
        return TruthReader(self.core.backend).read()

    # --- commands ---------------------------------------------------------------------------------

    def look(self):
        """Around."""
        return rc.Look(self._key(), POINTS)

    def plan_to_take(self, name, side):
        """Work out the commands that take a vessel out of the cabinet by its first grasp:
        `taking`.
        """
        out = self.here.seen["cabinet_2"].rotation[:, 0]
        self._plan(name, side, out, models.GRASPS[self.things[name]][:1])

    def plan_to_take_off_the_table(self, name, side):
        """Work out the commands that take a thing that stands free, by any of its grasps:
        `taking`.
        """
        pose = self.here.seen[name]
        known = models.GRASPS[self.things[name]]
        fitting = [one for one in known if (one.kind == models.LYING) is lies(pose)]
        self._plan(name, side, -pose.translation, fitting)

    def _plan(self, name, side, direction, grasps):
        out = direction * np.array([1.0, 1.0, 0.0])
        out = out / np.linalg.norm(out)
        symmetric = models.MODELS[self.things[name]].symmetric
        target = Target(name, self.here.seen[name], symmetric, out, OUT_M)
        ways = [
            GraspWay(g.id, tuple((transform(s.pose), s.fingers) for s in g.steps)) for g in grasps
        ]
        found, path = self._reached(side, target, ways)
        grasp = next(one for one in grasps if one.id == found.grasp)
        self.retreats[name] = _points(backwards(found.steps))
        mass = models.MODELS[self.things[name]].mass
        force = {"squeeze": grasp.squeeze, "speed": grasp.speed, "mass": mass}
        steps = _points(found.steps)
        close = rc.Grasp(self._key(), side, name, grasp.id, steps, **force)
        away = tuple(float(x) for x in out * OUT_M)
        segments = (rc.Segment((0.0, 0.0, LIFT_M), 0.1), rc.Segment((away[0], away[1], 0.0), 0.25))
        lead = self.move(side, path, found.steps[0][1])
        self.taking = lead, close, rc.MoveCartesian(self._key(), side, segments)

    def _reached(self, side, target, ways):
        here, rng = self.here, np.random.default_rng(1)
        with attaching.room(here.world, MARGIN):
            for found in approaches(
                self.robot, here.world, side, here.q, target, ways, rng, wanted=WAYS_IN_TRIED
            ):
                here.world.fingers(side, found.steps[0][1])
                way = motion.plan(self.robot, here.world, side, here.q, found.way_in[0])
                if way is not None:
                    return found, way.path
        raise AssertionError(f"no way to {target.name}")

    def move(self, side, path, fingers=None):
        """Along a joint path."""
        points = tuple(tuple(float(x) for x in q[COLUMNS[side]]) for q in path)
        return rc.MoveJoint(self._key(), side, points, 0.25, fingers)

    def put_down(self, name, side):
        """Return the act of putting a thing down at any place that ex finds."""
        return rc.Release(self._key(), side, name, "", None, self.retreats[name])

    def home(self, side):
        """That arm."""
        return rc.Home(self._key(), side)

    def _key(self):
        self._acts += 1
        return f"act-{self._acts}"


def _points(steps):
    return tuple(rc.ApproachPoint(Pose(*xyz_quat(pose)), fingers) for pose, fingers in steps)
