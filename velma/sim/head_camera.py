"""Pictures of the head camera, rendered by MuJoCo in a copy of the simulated world.

No shadows: they would cost as much as the rest. Transparent shapes are blended with what is behind them.
"""

import mujoco
import numpy as np
from numpy.typing import NDArray

from velma.sim import gl

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]

CAMERA = "kinect"
HOUSING = "head_tilt_link"
"""The link that turns with the camera. It is left out of the picture, as a real camera looks out of its housing."""
UNSEEN = 5  # a group of geoms that renderers do not show (velma.model.contacts)
MOST_GEOMS = 2000  # estimate: a scene has 250


class HeadCamera:
    """Makes pictures of `width` x `height` pixels of the world of `model`, which it changes: nobody else may use it.

    Raises GlError where OpenGL is missing. Use it in one thread; `close` frees it.
    """

    def __init__(self, model: mujoco.MjModel, width: int, height: int) -> None:
        self._model, self._data = model, mujoco.MjData(model)
        _hide_housing(model)
        model.vis.quality.shadowsize = model.vis.quality.offsamples = 0  # read when the contexts are made
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        self._gl = gl.context(width, height)
        self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._scene, self._option = mujoco.MjvScene(model, MOST_GEOMS), mujoco.MjvOption()
        self._view = mujoco.MjvCamera()
        self._view.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._view.fixedcamid = model.camera(CAMERA).id
        self._area = mujoco.MjrRect(0, 0, width, height)

    def picture(self, qpos: Array) -> Pixels:
        """Return the picture of the state qpos (nq,) of the world: (height, width, 3), red green blue."""
        data = self._data
        data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_camlight(self._model, data)
        every = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(self._model, data, self._option, None, self._view, every, self._scene)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = 0
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = 0
        mujoco.mjr_render(self._area, self._scene, self._context)
        pixels = np.empty((self._area.height, self._area.width, 3), np.uint8)
        mujoco.mjr_readPixels(pixels, None, self._area, self._context)
        return np.ascontiguousarray(pixels[::-1])  # OpenGL begins with the lowest row

    def pose(self) -> tuple[Array, Array]:
        """Return the true rotation (3, 3) and position (3,) of the camera of the last picture, in the world.

        Axes of the optical frame: x right, y down, z forward.
        """
        camera = self._view.fixedcamid
        turned = self._data.cam_xmat[camera].reshape(3, 3) @ np.diag([1.0, -1.0, -1.0])
        return turned, self._data.cam_xpos[camera].copy()

    def close(self) -> None:
        """Free the contexts."""
        self._context.free()
        self._gl.free()


def _hide_housing(model: mujoco.MjModel) -> None:
    housing = model.body(HOUSING).id
    turns = np.zeros(model.nbody, dtype=bool)
    for body in range(model.nbody):  # parents come first
        turns[body] = body == housing or turns[model.body_parentid[body]]
    model.geom_group[turns[model.geom_bodyid]] = UNSEEN
