"""Pictures of the head camera, by ray casting in a copy of the simulated world. They need no GL.

Pictures are for people only; ex itself sees by its receptor. Shapes, colours and lamps are those of the scene
(velma.model.surfaces), without shadows and textures. Transparent shapes are blended with what is behind them.
"""

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from velma import names

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]

# Simulated Kinect of Velma (velma_robot@43752e0): horizontal field of view 1.047 rad, 800 x 600, range 10 m.
HALF_WIDTH = math.tan(1.047 / 2)
HALF_HEIGHT = HALF_WIDTH * 600 / 800
RANGE_M = 10.0
WIDTH, HEIGHT = 128, 96
"""Estimate: grains in the jar can be told apart, and a picture costs 3 % of a core at one a second."""
SKY = (0.86, 0.90, 0.94)
"""Colour where no ray hits: the haze of velma.model.surfaces."""
HOUSING = "head_tilt_link"
"""The link that turns with the camera. It is left out of the picture, as a real camera looks out of its housing."""
SOLID, CLEAR, UNSEEN = (1, 1, 1, 0, 0, 0), (0, 0, 0, 0, 1, 0), 5
"""Groups of geoms: 0 to 2 are visible (velma.model.contacts); the camera puts others into the last two."""
SEE_THROUGH = 4


class Camera:
    """Makes pictures of the world of `model`. It changes the model, so nobody else may use it."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model, self._data = model, mujoco.MjData(model)
        self._body = model.body(names.CAMERA_BODY).id
        self._rays = _rays()
        self._colours = _colours(model)
        _sort(model, self._colours[:, 3], model.body(HOUSING).id)

    def picture(self, qpos: Array) -> Pixels:
        """Return the picture of the state qpos (nq,) of the world: (HEIGHT, WIDTH, 3), red green blue."""
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        rays = self._rays @ self._data.xmat[self._body].reshape(3, 3).T
        far, solid = self._cast(rays, SOLID)
        near, clear = self._cast(rays, CLEAR)
        share = np.where(near < far, clear[:, 3], 0.0)[:, None]
        colours = (1.0 - share) * solid[:, :3] + share * clear[:, :3]
        return np.rint(255.0 * np.clip(colours, 0.0, 1.0)).astype(np.uint8).reshape(HEIGHT, WIDTH, 3)

    def _cast(self, rays: Array, groups: tuple[int, ...]) -> tuple[Array, Array]:
        """Return distance (n,) of the first hit of each ray (n, 3), inf for none, its lit colour, alpha (n, 4)."""
        count = len(rays)
        geoms, distance, normals = np.full(count, -1, np.int32), np.zeros(count), np.zeros((count, 3))
        eye, seen = self._data.xpos[self._body], np.array(groups, np.uint8)
        mujoco.mj_multiRay(
            self._model, self._data, eye, rays.ravel(), seen, 1, -1, geoms, distance, normals.ravel(), count, RANGE_M
        )
        hit = geoms >= 0
        colours = np.tile((*SKY, 1.0), (count, 1))
        colours[hit] = self._colours[geoms[hit]]
        colours[hit, :3] *= self._light(rays[hit], normals[hit])
        return np.where(hit, distance, np.inf), colours

    def _light(self, rays: Array, normals: Array) -> Array:
        """Return the share of each colour (n, 3) that surfaces reflect, lit by the lamps of scene and camera."""
        normals = normals * -np.sign(np.sum(rays * normals, axis=1, keepdims=True))  # towards the camera
        lamp = self._model.vis.headlight
        light = lamp.ambient + lamp.diffuse * -np.sum(rays * normals, axis=1, keepdims=True)
        for way, colour in zip(self._data.light_xdir, self._model.light_diffuse, strict=True):
            light = light + colour * np.maximum(0.0, -normals @ way)[:, None]
        return np.asarray(light)


def _rays() -> Array:
    """Return unit rays (n, 3) through the pixel centres, rows from the top; z forward, x right, y down."""
    x = HALF_WIDTH * (2 * (np.arange(WIDTH) + 0.5) / WIDTH - 1)
    y = HALF_HEIGHT * (2 * (np.arange(HEIGHT) + 0.5) / HEIGHT - 1)
    across, down = np.meshgrid(x, y)
    rays = np.stack([across.ravel(), down.ravel(), np.ones(WIDTH * HEIGHT)], axis=1)
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def _colours(model: mujoco.MjModel) -> Array:
    """Return red, green, blue, alpha of each geom (ngeom, 4): of its material times its mean texture, else its own."""
    colours = np.array(model.geom_rgba, dtype=float)
    for geom in np.flatnonzero(model.geom_matid >= 0):
        material = model.geom_matid[geom]
        colours[geom] = model.mat_rgba[material]
        texture = model.mat_texid[material][mujoco.mjtTextureRole.mjTEXROLE_RGB]
        if texture >= 0:
            colours[geom, :3] *= _mean(model, texture)
    return colours


def _mean(model: mujoco.MjModel, texture: int) -> Array:
    """Return the mean colour (3,) of a texture."""
    size = model.tex_width[texture] * model.tex_height[texture] * model.tex_nchannel[texture]
    start = model.tex_adr[texture]
    pixels = model.tex_data[start : start + size].reshape(-1, model.tex_nchannel[texture])
    return np.asarray(pixels[:, :3].mean(axis=0) / 255.0)


def _sort(model: mujoco.MjModel, alpha: Array, housing: int) -> None:
    """Put transparent geoms, and those that turn with the camera, into groups of their own."""
    with_camera = np.zeros(model.nbody, dtype=bool)
    for body in range(model.nbody):  # parents come first
        with_camera[body] = body == housing or with_camera[model.body_parentid[body]]
    looked_at = model.geom_group <= 2
    model.geom_group[looked_at & (alpha < 1.0)] = SEE_THROUGH
    model.geom_group[with_camera[model.geom_bodyid]] = UNSEEN
