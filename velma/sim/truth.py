"""The true state of the world, for the report and for tests. Agents must not read it; they have the
receptor.
"""

import math

import msgspec
import mujoco
import numpy as np
from numpy.typing import NDArray

from velma.model.kinds import FURNITURE, MOVEABLE, Model, objects
from velma.model.scene import Scene
from velma.model.scene_xml import WRIST_SENSORS, grain_name
from velma.names import BODY, SIDES
from velma.sim.mujoco_backend import MujocoBackend

Vector = tuple[float, float, float]

Flags = NDArray[np.bool_]
MOST_CONTACTS = 12
"""Largest number told at a time; estimate: two hands with three fingers on two things."""
LEAST_N = 0.05
"""Weaker forces are not shown; estimate."""


Array = NDArray[np.float64]
Quaternion = tuple[float, float, float, float]

# A grain counts as inside a vessel up to this far outside its walls, since contacts are soft. m,
# estimate.
SLACK = 0.005


class Truth(msgspec.Struct, frozen=True):
    """The true state at a time: grains by vessel, tilt of everything that can be taken, contacts.

    `poses`, `models` and `grains_at` are for pictures: thing id -> (origin, quaternion w first) in
    the world and model (velma.model.kinds.Model), furniture too; centres of the grains. m. So are
    the last three: where the robot touches a thing and the force on the thing (world frame, m and
    N), the strongest MOST_CONTACTS; torques of the drives of the body; by side force N and torque
    Nm of the arm on the hand without errors, axes of the wrist's sensor.
    """

    time_s: float
    grains: int
    grains_in: dict[str, int]  # vessel id -> count
    # id of a thing that can be taken -> angle of its axis from the vertical
    tilt_deg: dict[str, float]
    at: dict[str, Vector]  # id -> origin, m
    fingers_on: dict[str, dict[str, int]]  # id -> side -> finger and palm links that touch it
    furniture_touched: bool  # the robot touches furniture
    work_J: float
    poses: dict[str, tuple[Vector, Quaternion]]
    models: dict[str, str]
    grains_at: tuple[Vector, ...]
    contacts: tuple[tuple[Vector, Vector], ...]
    torque_Nm: tuple[float, ...]
    wrench: dict[str, tuple[float, ...]]


class TruthReader:
    """Reads the truth of a simulated robot."""

    def __init__(self, backend: MujocoBackend) -> None:
        self._backend = backend
        model, scene = backend.model, backend.scene
        self._vessels = {
            thing.id: _cavity(thing.model) for thing in scene.of(Model.JAR, Model.BOWL)
        }
        self._moveable = tuple(thing.id for thing in scene.of(*MOVEABLE))
        self._grain_bodies = np.array(
            [model.body(grain_name(k)).id for k in range(_grains(scene))], dtype=np.intp
        )
        self._models = {thing.id: str(thing.model) for thing in scene.things}
        self._bodies = {thing.id: model.body(thing.id).id for thing in scene.things}
        parts = [_side(model, body) for body in range(model.nbody)]
        self._is_robot = np.array([part != "" for part in parts])
        self._hand = {side: np.array([part == side for part in parts]) for side in SIDES}
        grains = np.isin(np.arange(model.nbody), self._grain_bodies)
        self._is_thing = ~self._is_robot & ~grains
        self._motors = np.array([model.actuator(name).id for name in BODY], dtype=np.intp)
        self._is_furniture = np.isin(
            np.arange(model.nbody), [self._bodies[thing.id] for thing in scene.of(*FURNITURE)]
        )

    def read(self) -> Truth:
        """Return the truth now."""
        data = self._backend.data
        inside = {name: self.grains_in(name) for name in self._vessels}
        return Truth(
            time_s=data.time,
            grains=len(self._grain_bodies),
            grains_in=inside,
            tilt_deg={name: self.tilt_deg(name) for name in self._moveable},
            at={name: _vector(data.xpos[self._bodies[name]]) for name in self._moveable},
            fingers_on={name: self.fingers_on(name) for name in self._moveable},
            furniture_touched=self.furniture_touched(),
            work_J=self._backend.work_J,
            poses={name: self._pose(body) for name, body in self._bodies.items()},
            models=self._models,
            grains_at=tuple((x, y, z) for x, y, z in data.xpos[self._grain_bodies].tolist()),
            contacts=self._contacts(),
            torque_Nm=tuple(data.actuator_force[self._motors].tolist()),
            wrench={side: self._wrench(side) for side in SIDES},
        )

    def pose(self, name: str) -> tuple[Array, Array]:
        """Return rotation (3, 3) and position (3,) of a thing's origin in the world."""
        body = self._backend.data.body(name)
        return body.xmat.reshape(3, 3).copy(), body.xpos.copy()

    def _pose(self, body: int) -> tuple[Vector, Quaternion]:
        w, x, y, z = self._backend.data.xquat[body].tolist()
        return _vector(self._backend.data.xpos[body]), (w, x, y, z)

    def tilt_deg(self, name: str) -> float:
        """Return angle between a thing's axis and the vertical, degrees."""
        up = float(self._backend.data.body(name).xmat[8])
        return math.degrees(math.acos(max(-1.0, min(1.0, up))))

    def grains_in(self, name: str) -> int:
        """Return the number of grains with their centre in a jar or bowl."""
        rotation, position = self.pose(name)
        local = (self._backend.data.xpos[self._grain_bodies] - position) @ rotation
        radius, low, high = self._vessels[name]
        within = (
            (np.hypot(local[:, 0], local[:, 1]) < radius)
            & (local[:, 2] > low)
            & (local[:, 2] < high)
        )
        return int(within.sum())

    def fingers_on(self, name: str) -> dict[str, int]:
        """Return, for each side, how many links of its hand touch an object."""
        a, b = self._touching()
        thing = self._bodies[name]
        others = np.concatenate((b[a == thing], a[b == thing]))
        return {side: len(set(others[self._hand[side][others]].tolist())) for side in SIDES}

    def furniture_touched(self) -> bool:
        """Whether any link of the robot touches furniture."""
        a, b = self._touching()
        robot, furniture = self._is_robot, self._is_furniture
        return bool(((furniture[a] & robot[b]) | (furniture[b] & robot[a])).any())

    def _contacts(self) -> tuple[tuple[Vector, Vector], ...]:
        """Return points where the robot touches a thing and the forces on the thing, world frame,
        strongest first.
        """
        data, found = self._backend.data, []
        bodies = np.stack(self._touching(), axis=1)
        robot, thing = self._is_robot[bodies], self._is_thing[bodies]
        both = np.flatnonzero((robot[:, 0] & thing[:, 1]) | (robot[:, 1] & thing[:, 0]))
        for k in both[: 4 * MOST_CONTACTS]:
            force = np.zeros(6)
            mujoco.mj_contactForce(self._backend.model, data, int(k), force)
            # The frame's rows are its axes; the force is that on the second body of the pair.
            on = data.contact.frame[k].reshape(3, 3).T @ force[:3] * (1.0 if thing[k, 1] else -1.0)
            if (size := float(np.linalg.norm(on))) > LEAST_N:
                found.append((size, _vector(data.contact.pos[k]), _vector(on)))
        found.sort(reverse=True)
        return tuple((at, on) for _, at, on in found[:MOST_CONTACTS])

    def _wrench(self, side: str) -> tuple[float, ...]:
        data = self._backend.data
        return tuple(
            x for kind in WRIST_SENSORS for x in data.sensor(f"{side}_{kind}").data.tolist()
        )

    def _touching(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return bodies in contact, (n,) each."""
        data = self._backend.data
        bodies = self._backend.model.geom_bodyid[data.contact.geom[: data.ncon]]
        return bodies[:, 0], bodies[:, 1]


def _vector(at: Array) -> Vector:
    x, y, z = at.tolist()
    return x, y, z


def _grains(scene: Scene) -> int:
    return scene.content.grains if scene.content and scene.find(scene.content.inside) else 0


def _cavity(model: Model) -> tuple[float, float, float]:
    """Return radius and the two heights of a vessel's inside with some slack, in its frame."""
    numbers = objects()[model]
    if model is Model.JAR:
        half = numbers["height"] / 2
        return numbers["radius"], -half - SLACK, half + SLACK
    return numbers["rim_radius"], -SLACK, numbers["height"] + 2 * SLACK


def _side(model: mujoco.MjModel, body: int) -> str:
    """Return right or left for a link of that arm or hand, "body" for the rest of the robot, "" for
    anything else.
    """
    name: str = model.body(body).name
    first = name.removeprefix("calib_").split("_")[0]
    if first in SIDES:
        return first
    return "body" if first in ("torso", "head") else ""
