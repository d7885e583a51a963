"""Forces of the simulated world, for pictures: contacts of robot and things, torques of drives, wrenches at wrists.

All is read between two steps; nothing here changes the simulation.
"""

import mujoco
import numpy as np
from numpy.typing import NDArray

from velma.model.scene_xml import WRIST_SENSORS
from velma.names import BODY, SIDES

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Vector = tuple[float, float, float]
MOST_CONTACTS = 12
"""Largest number told at a time; estimate: two hands with three fingers on two things."""
LEAST_N = 0.05
"""Weaker forces are not shown; estimate."""


class Forces:
    """Reads `data`. `robot`, `grains`: which bodies (nbody,) are of the robot, and which are grains."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, robot: Flags, grains: Flags) -> None:
        self._model, self._data = model, data
        self._robot, self._thing = robot, ~robot & ~grains
        self._motors = np.array([model.actuator(name).id for name in BODY], dtype=np.intp)
        self._sensors = {side: [f"{side}_{kind}" for kind in WRIST_SENSORS] for side in SIDES}

    def contacts(self) -> tuple[tuple[Vector, Vector], ...]:
        """Return points where the robot touches a thing and the forces on the thing, world frame, strongest first."""
        data = self._data
        bodies = self._model.geom_bodyid[data.contact.geom[: data.ncon]].reshape(-1, 2)
        robot, thing = self._robot[bodies], self._thing[bodies]
        found = []
        for k in np.flatnonzero((robot[:, 0] & thing[:, 1]) | (robot[:, 1] & thing[:, 0]))[: 4 * MOST_CONTACTS]:
            force = np.zeros(6)
            mujoco.mj_contactForce(self._model, data, int(k), force)
            # The frame's rows are its axes; the force is that on the second body of the pair.
            on = data.contact.frame[k].reshape(3, 3).T @ force[:3] * (1.0 if thing[k, 1] else -1.0)
            if (size := float(np.linalg.norm(on))) > LEAST_N:
                found.append((size, _vector(data.contact.pos[k]), _vector(on)))
        found.sort(reverse=True)
        return tuple((at, on) for _, at, on in found[:MOST_CONTACTS])

    def torques(self) -> tuple[float, ...]:
        """Return the torques of the drives of the body (15,) [Nm], with the weight of the arms."""
        return tuple(self._data.actuator_force[self._motors].tolist())

    def wrenches(self) -> dict[str, tuple[float, ...]]:
        """Return by side force [N], torque [Nm] of the arm on the hand in the last step, axes of the wrist sensor."""
        data = self._data
        return {
            side: tuple(x for name in names for x in data.sensor(name).data.tolist())
            for side, names in self._sensors.items()
        }


def _vector(at: Array) -> Vector:
    x, y, z = at.tolist()
    return x, y, z
