"""The eyes of ex. By rays: a simulated marker detector with noise, the only place that may read
true poses.

It sets a copy of the simulated world to the state that the loop published, and casts rays from the
camera to points on each thing. A thing is detected if enough of its points are in the field of
view, in range and not hidden. Markers (the lab's models carry them) tell which thing it is. How
much is in a vessel is told by the rays through its opening that end at grains, as eyes by pixels
tell it by the colour.
"""

import math
from collections.abc import Callable, Iterator, Mapping

import mujoco
import numpy as np
import pinocchio as pin

from agent_runtime.core.errors import WorkerError
from agent_runtime.io.inbox import OneReaderQueue
from companion.skills.situation import Neck, Sight
from services.executor.renderer import ENTRY, Blind, Renderer, Saw, See, SightedObject, uncertainty
from velma import names
from velma.eyes import content
from velma.eyes.lens import HALF_HEIGHT, HALF_WIDTH
from velma.kinematics.frames import pose_of
from velma.kinematics.robot import Robot
from velma.model.kinds import Model
from velma.model.scene import Noise, Scene
from velma.model.scene_xml import GRAIN
from velma.names import Array

# Of the point cloud of Velma's simulated Kinect (velma_robot@43752e0): 0.5-3.0 m; 0.1 m less to see
# held things (estimate).
NEAREST_M, FARTHEST_M = 0.4, 3.0
LEAST_SHARE, LEAST_POINTS = 0.02, 6  # estimate: one or two markers of a thing must be visible
TURN_NOISE = math.radians(0.2)  # estimate of a marker's angular error, uniform about each axis
# deviation along each axis that is told without noise, too; estimate: nobody sees better
LEAST_M = 0.0005
OUTLIER_M = 0.1  # largest error of a sight that is wrong, on each horizontal axis (estimate)
AROUND = 8  # points around a cylinder
UPRIGHT = math.cos(math.radians(10.0))  # a vessel that is tilted more is not looked into (estimate)
RINGS = np.sqrt((np.arange(6) + 0.5) / 6)
"""Radii of rays through an opening, as shares of its own: each ring stands for the same area."""
GRID_M = 0.15  # between points on a box's face, at least two in each direction


class Receptor:
    """Detects the things (bodies by name, with their models) of a world model with the head camera.

    The same looks in the same order give the same sights. These eyes have no faults: they take no
    picture and do not use the measured joints.
    """

    wrong, off = "", 0.0

    def __init__(self, model: mujoco.MjModel, things: Mapping[str, Model], noise: Noise) -> None:
        self._model, self._data = model, mujoco.MjData(model)
        self._camera = model.body(names.CAMERA_BODY).id
        self._bodies = {name: model.body(name).id for name in things}
        self._points = {
            name: np.array(list(_points(model, body))) for name, body in self._bodies.items()
        }
        self._openings = {
            name: hole for name in things if (hole := content.opening(things[name])) is not None
        }
        self._grains = frozenset(
            n for n in range(model.nbody) if model.body(n).name.startswith(GRAIN)
        )
        self._largest = np.array([noise.position] * 2 + [noise.height])
        self._seed = noise.seed
        self._looks = 0
        self._outliers = noise.outliers
        constant = np.random.default_rng([noise.seed, *b"bias"]).uniform(
            -noise.bias, noise.bias, (len(things), 3)
        )
        self._bias = dict(zip(things, constant, strict=True))
        variances = (self._largest**2 + noise.bias**2) / 3 + LEAST_M**2  # of uniform errors
        self._uncertainty = uncertainty(np.diag([*variances, TURN_NOISE**2 / 3]))

    def look(self, qpos: np.ndarray, _neck: Neck | None = None) -> list[Sight]:
        """Return what is seen in the state qpos (nq,) of the world. Joints are not needed."""
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, self._data)
        self._looks += 1
        rng, more = (
            np.random.default_rng([self._seed, self._looks, *kind]) for kind in (b"", b"more")
        )
        return [self._noisy(name, rng, more) for name in self._bodies if self._visible(name)]

    def close(self) -> None:
        """Nothing was started."""

    def _noisy(self, name: str, rng: np.random.Generator, more: np.random.Generator) -> Sight:
        body = self._bodies[name]
        across = rng.uniform(-self._largest[:2], self._largest[:2])
        turn = pin.exp3(rng.uniform(-TURN_NOISE, TURN_NOISE, 3))
        rotation = self._data.xmat[body].reshape(3, 3)
        shift = (
            np.array([*across, more.uniform(-self._largest[2], self._largest[2])])
            + self._bias[name]
        )
        if more.random() < self._outliers:
            shift[:2] += more.uniform(-OUTLIER_M, OUTLIER_M, 2)
        seen = pin.SE3(turn @ rotation, self._data.xpos[body] + shift)
        mass, whole = self._content(name) or (None, True)
        return Sight(name, seen, mass, self._uncertainty, whole)

    def _content(self, name: str) -> content.Content | None:
        """Return what is seen in a thing; None for one that cannot be looked into from here."""
        body, eye = self._bodies[name], self._data.xpos[self._camera]
        rotation, position = self._data.xmat[body].reshape(3, 3), self._data.xpos[body]
        hole = self._openings.get(name)
        if hole is None or rotation[2, 2] < UPRIGHT:
            return None
        edge = content.circle(*hole) @ rotation.T + position
        above = content.rise(eye, edge)
        if above < content.LOW_RISE or not self._framed(edge - eye).all():
            return None
        centre = edge.mean(axis=0)
        rays = np.concatenate([centre + share * (edge - centre) for share in RINGS]) - eye
        hit = [
            self._first(eye, ray) in self._grains
            for ray in rays / np.linalg.norm(rays, axis=1)[:, None]
        ]
        return content.Content(content.mass(float(np.mean(hit))), above >= content.LEAST_RISE)

    def _visible(self, name: str) -> bool:
        body, eye = self._bodies[name], self._data.xpos[self._camera]
        rays = (
            self._points[name] @ self._data.xmat[body].reshape(3, 3).T + self._data.xpos[body] - eye
        )
        distance = np.linalg.norm(rays, axis=1)
        framed = self._framed(rays) & (distance > NEAREST_M) & (distance < FARTHEST_M)
        seen = sum(self._first(eye, rays[k] / distance[k]) == body for k in np.flatnonzero(framed))
        return bool(seen >= max(LEAST_POINTS, LEAST_SHARE * len(rays)))

    def _framed(self, rays: np.ndarray) -> np.ndarray:
        """Return which rays (n, 3) from the camera, in world axes, are inside the picture."""
        # camera: z forward, x right, y down
        x, y, z = (rays @ self._data.xmat[self._camera].reshape(3, 3)).T
        return np.asarray((z > 0) & (np.abs(x) < HALF_WIDTH * z) & (np.abs(y) < HALF_HEIGHT * z))

    def _first(self, eye: np.ndarray, direction: np.ndarray) -> int:
        """Return the first body on the ray, -1 for none."""
        geom = np.full(1, -1, dtype=np.int32)
        mujoco.mj_ray(self._model, self._data, eye, direction, None, 1, -1, geom)
        return int(self._model.geom_bodyid[geom[0]]) if geom[0] >= 0 else -1


def _points(model: mujoco.MjModel, body: int) -> Iterator[np.ndarray]:
    """Yield points on the surface of a body's geoms, in the body's frame [m]."""
    first, count = model.body_geomadr[body], model.body_geomnum[body]
    for geom in range(first, first + count):
        if model.geom_rgba[geom][3] == 0.0:
            continue  # invisible: the inner walls that only hold the grains
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
        for local in _surface(model.geom_type[geom], model.geom_size[geom]):
            yield rotation.reshape(3, 3) @ local + model.geom_pos[geom]


def _surface(kind: int, size: np.ndarray) -> Iterator[np.ndarray]:
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        counts = np.maximum(2, np.ceil(2 * size / GRID_M).astype(int) + 1)
        for index in np.ndindex(*counts):
            at = 2 * np.array(index) / (counts - 1) - 1
            if np.abs(at).max() == 1.0:
                yield 0.98 * size * at
    elif kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        for height in (-0.8, 0.0, 0.8):
            for k in range(AROUND):
                turn = math.tau * k / AROUND
                yield np.array(
                    [size[0] * math.cos(turn), size[0] * math.sin(turn), height * size[1]]
                )


# --- Eyes by pixels: another process renders the picture and reads the markers in it --------------
# Where the camera is comes from the measured joints and the robot's model, never from the
# simulator.


class PixelReceptor:
    """Sees the things of a scene by their markers. Calls come from one thread.

    `wrong`, `off`: as of Saw, of the last look. A new child has no look to compare its first one
    with.
    """

    def __init__(self, ask: Callable[[See], Saw | Blind], robot: Robot | None = None) -> None:
        """`ask` waits for the answer of the child."""
        self.wrong, self.off = "", 0.0
        self._ask, self._robot, self._looks = ask, robot or Robot(), 0

    def look(self, world: Array, neck: Neck) -> list[Sight]:
        """Return what the picture of the state `world` (nq,) shows. Raises WorkerError where no
        child sees, and why.
        """
        self._looks += 1
        eye = self._robot.camera(*neck)
        place = tuple(eye.rotation.ravel().tolist()), tuple(eye.translation.tolist())
        saw = self._ask(See(self._looks, world.tobytes(), *place))
        if isinstance(saw, Blind):
            raise WorkerError(ENTRY, f"does not see: {saw.reason}", "start with --eyes rays")
        self.wrong, self.off = saw.wrong, saw.off
        return [_sight(one) for one in saw.things]

    def close(self) -> None:
        """Nothing to close: the child is another's."""


def _sight(one: SightedObject) -> Sight:
    pose = pose_of(one.rotation, one.position)
    return Sight(one.name, pose, one.content, one.uncertainty, one.whole)


class OwnPixelReceptor(PixelReceptor):
    """Eyes by pixels with a child of their own."""

    def __init__(self, scene: Scene) -> None:
        self.renderer, self._answers = Renderer(lambda: scene), OneReaderQueue[Saw | Blind]()
        super().__init__(self._answered)

    def close(self) -> None:
        """End the child."""
        self.renderer.close()

    def _answered(self, see: See) -> Saw | Blind:
        self.renderer.look(see, self._answers.put)
        return self._answers.get()
