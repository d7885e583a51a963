"""A robot that stands around jar or bowl, and the small motions with which tests grasp and lift."""

import copy
import math
from functools import cache

import numpy as np

from companion.skills.loop_messages import Close, motion
from services.executor.loop.core import LoopCore
from velma.control.dynamics import Dynamics
from velma.model import scene
from velma.model.tree import ROBOT_XML
from velma.sim.mujoco_backend import MujocoBackend
from velma.sim.truth import TruthReader

DYNAMICS = Dynamics(ROBOT_XML)

# Postures in which a hand stands around its object in the canonical scene, found by inverse
# kinematics: the left grip 2 mm behind the jar's axis, the right one at a published grasp of the
# bowl's rim.
JAR_POSTURE = (
    0.5121, -0.3, -1.8, 1.25, 0.85, 0.0, -0.5, 0.0,
    -1.3444, 1.8428, 1.9591, 0.5537, 2.3412, 1.5196, 0.0563,
)  # fmt: skip
BOWL_POSTURE = (
    0.8447, -1.2777, 1.4691, -1.0681, -1.2973, 1.8842, -1.7219, 0.2865,
    0.6473, 2.0139, 0.7842, 1.8281, -0.5007, -1.6082, 1.9404,
)  # fmt: skip
JAR_GRIP = Close(squeeze=math.radians(40), upto=2.0, speed=0.6, settle_s=0.6)


@cache
def _stood(posture, row, finger):
    backend = MujocoBackend(scene.load())
    backend.data.qpos[backend._q] = posture
    backend.data.qpos[backend._proximal[row]] = finger
    backend.data.qpos[backend._distal[row]] = finger / 3
    core = LoopCore(backend, dynamics=DYNAMICS)
    core.hold(0.4)
    return core


def standing(posture, row, finger):
    """A loop whose robot stands in a posture with the fingers of one hand bent already, everything
    at rest.
    """
    core = copy.deepcopy(_stood(posture, row, finger))
    return core, TruthReader(core.backend)


def jar_gripped():
    """A loop whose left hand holds the jar, locked, on its shelf."""
    core, truth = standing(JAR_POSTURE, 1, 0.52)
    core.run(motion("close", core.setpoint, until="touch", left=JAR_GRIP))
    assert core.report.left.locked
    return core, truth


def at(truth, name):
    """Return the true position of a vessel, (3,) [m]."""
    return truth.pose(name)[1]


def raised(q, row, height):
    """Knots that raise one hand straight up with its own arm only, in a second."""
    columns = slice(1, 8) if row == 0 else slice(8, 15)
    knots, q = [q.copy()], q.copy()
    for step in np.diff(
        height * (lambda u: u**3 * (10 - 15 * u + 6 * u * u))(np.linspace(0, 1, 101))
    ):
        jacobian = DYNAMICS.terms(q).jacobian[6 * row : 6 * row + 6, columns]
        q = q.copy()
        q[columns] += np.linalg.pinv(jacobian) @ (0, 0, step, 0, 0, 0)
        knots.append(q)
    return np.array(knots)


def lever(core, truth, row, name):
    """The object's origin in the grip frame; a test may know the truth."""
    rotation, position = core.dynamics.grips(core.state.q)
    return tuple(float(x) for x in rotation[row].T @ (truth.pose(name)[1] - position[row]))
