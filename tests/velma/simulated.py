"""States of simulated worlds, as tests set them and look into them."""

import mujoco
import numpy as np
import pinocchio as pin

from companion.skills.motions import aim
from companion.skills.situation import Neck
from velma import names


def turn_head(model: mujoco.MjModel, qpos: np.ndarray, pan: float, tilt: float) -> Neck:
    """Turn the head [rad] in a state (nq,); return the angles of the neck."""
    for name, angle in zip(names.HEAD, (pan, tilt), strict=True):
        qpos[model.joint(name).qposadr[0]] = angle
    return 0.0, pan, tilt


def look_at(
    model: mujoco.MjModel, qpos: np.ndarray, point: tuple[float, float, float] | np.ndarray
) -> Neck:
    """Turn the head to a point (3,) [m] in a state (nq,); return the angles of the neck."""
    x, y, z = (float(part) for part in point)
    goal = aim(0.0, (x, y, z))
    return turn_head(model, qpos, goal.pan, goal.tilt)


def put(model: mujoco.MjModel, qpos: np.ndarray, name: str, pose: pin.SE3) -> None:
    """Put a thing that can move to a pose in a state (nq,)."""
    x, y, z, w = pin.SE3ToXYZQUAT(pose)[3:]
    start = model.jnt_qposadr[model.body(name).jntadr[0]]
    qpos[start : start + 7] = [*pose.translation, w, x, y, z]


def placed(model: mujoco.MjModel, qpos: np.ndarray) -> mujoco.MjData:
    """The bodies of a state (nq,)."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    return data
