"""Pictures of the head camera as a real one would take them: with noise, blur, exposure, and a camera that is not quite
where the robot's model has it (all of the scene's noise)."""

from collections.abc import Sequence

import mujoco
import numpy as np

from velma.eyes.disturbed import disturbed
from velma.eyes.lens import HEIGHT, WIDTH
from velma.model.scene import Scene
from velma.sim.disturbances import Disturbance, Kind, Of, Orders
from velma.sim.head_camera import CAMERA, Array, HeadCamera, Pixels
from velma.sim.markings import marked
from velma.sim.spoiled_senses import SpoiledPictures

_MOUNT, _PICTURE = 1, 2  # random streams of a scene's seed


class Photographs:
    """Takes pictures in a copy of the world of a scene, things with their markers. Raises GlError without OpenGL."""

    def __init__(self, scene: Scene) -> None:
        self._noise = scene.noise
        model = marked(scene)
        _misplace(model, scene)
        self._model, self._places = model, model.body_pos.copy()
        self._camera = HeadCamera(model, WIDTH, HEIGHT)
        self._orders, self._spoiled = Orders.named(), SpoiledPictures()

    def take(self, qpos: Array, number: int) -> Pixels:
        """Return the picture (HEIGHT, WIDTH, 3) of the state qpos (nq,); `number`: which look it is, for its noise."""
        return self.both(qpos, number)[1]

    def both(self, qpos: Array, number: int, spoiled: SpoiledPictures | None = None) -> tuple[Pixels, Pixels]:
        """Return the picture of a perfect camera, and the one that `take` returns, or that of another camera beside it.

        `spoiled`: what goes on in the pictures of that one.
        """
        spoiled = spoiled or self._spoiled
        self._orders.look()
        going_on = self._orders.going_on
        self._move(going_on)
        noise, clean = self._noise, self._camera.picture(qpos)
        rng = np.random.default_rng([noise.seed, _PICTURE, number])
        gain = 1.0 + noise.exposure * rng.uniform(-1.0, 1.0)
        lit = spoiled.light(clean, going_on)
        return clean, spoiled.taken(disturbed(lit, noise.pixel, noise.blur, gain, rng), going_on)

    def _move(self, going_on: Sequence[Disturbance]) -> None:
        """Put furniture where it was moved to: its place is none of the coordinates."""
        self._model.body_pos[:] = self._places
        for one in going_on:
            if one.of is Of.THING and one.kind is Kind.MOVED:
                self._model.body(one.on).pos[:] += one.size

    def room(self, qpos: Array) -> Pixels:
        """Return the robot in the state qpos (nq,), from a place in the room (velma.sim.head_camera)."""
        return self._camera.room(qpos)

    def close(self) -> None:
        """Free the camera."""
        self._camera.close()


def _misplace(model: mujoco.MjModel, scene: Scene) -> None:
    """Turn and shift the camera against the model that the robot has of itself, uniform on each axis."""
    noise, camera = scene.noise, model.camera(CAMERA).id
    rng = np.random.default_rng([noise.seed, _MOUNT])
    turn, off = noise.camera_turn * rng.uniform(-1, 1, 3), noise.camera_shift * rng.uniform(-1, 1, 3)
    quaternion, before, angle = np.zeros(4), model.cam_quat[camera].copy(), float(np.linalg.norm(turn))
    mujoco.mju_axisAngle2Quat(quaternion, turn / max(1e-12, angle), angle)
    mujoco.mju_mulQuat(model.cam_quat[camera], quaternion, before)
    model.cam_pos[camera] += off
