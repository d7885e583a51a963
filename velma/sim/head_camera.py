"""Pictures of the head camera, rendered by MuJoCo in a copy of the simulated world.

No shadows: they would cost as much as the rest. Transparent shapes are blended with what is behind
them.
"""

import mujoco
import numpy as np
from numpy.typing import NDArray

from velma.model.contacts import SHAPE_GROUP
from velma.sim import gl

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]

CAMERA = "kinect"
HOUSING = "head_tilt_link"
"""The link that turns with the camera. It is left out of the picture, as a real camera looks out of
its housing.
"""
# a group of geoms that renderers show when asked to; SHAPE_GROUP (velma.model.contacts) is another
HOUSING_GROUP = 4
MOST_GEOMS = 2000  # estimate: a scene has 250
# a part of the picture's buffer; estimate: fingers can be told apart
ROOM_WIDTH, ROOM_HEIGHT = 400, 300
ROOM_AT, ROOM_M, ROOM_AZIMUTH, ROOM_ELEVATION = (0.5, -0.1, 0.95), 2.5, 95.0, -22.0
"""The place in the room: the point it looks at [m], the distance [m], angles [deg]; beside table_1,
where nothing hides what the hands do (chosen by eye).
"""


class HeadCamera:
    """Makes pictures of `width` x `height` pixels of the world of `model`, which it changes: nobody
    else may use it.

    Raises GlError where OpenGL is missing. Use it in one thread; `close` frees it.
    """

    def __init__(self, model: mujoco.MjModel, width: int, height: int) -> None:
        self._model, self._data = model, mujoco.MjData(model)
        _hide_housing(model)
        # read when the contexts are made
        model.vis.quality.shadowsize = model.vis.quality.offsamples = 0
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        self._gl = gl.context(width, height)
        self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._scene, self._option = mujoco.MjvScene(model, MOST_GEOMS), mujoco.MjvOption()
        self._view = mujoco.MjvCamera()
        self._view.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._view.fixedcamid = model.camera(CAMERA).id
        self._area = mujoco.MjrRect(0, 0, width, height)
        self._room, self._from_room = _room_view()

    def picture(self, qpos: Array) -> Pixels:
        """Return the picture of the state qpos (nq,) of the world: (height, width, 3), red green
        blue.
        """
        self._place(qpos)
        return self._drawn(self._area, self._option, self._view)

    def room(self, qpos: Array) -> Pixels:
        """Return the robot in the state qpos (nq,), from a place in the room: (ROOM_HEIGHT,
        ROOM_WIDTH, 3).
        """
        self._place(qpos)
        return self._drawn(
            mujoco.MjrRect(0, 0, ROOM_WIDTH, ROOM_HEIGHT), self._from_room, self._room
        )

    def _place(self, qpos: Array) -> None:
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)

    def _drawn(
        self, area: mujoco.MjrRect, option: mujoco.MjvOption, view: mujoco.MjvCamera
    ) -> Pixels:
        every = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(self._model, self._data, option, None, view, every, self._scene)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = 0
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = 0
        mujoco.mjr_render(area, self._scene, self._context)
        pixels = np.empty((area.height, area.width, 3), np.uint8)
        mujoco.mjr_readPixels(pixels, None, area, self._context)
        return np.ascontiguousarray(pixels[::-1])  # OpenGL begins with the lowest row

    def pose(self) -> tuple[Array, Array]:
        """Return the true rotation (3, 3) and position (3,) of the camera of the last picture, in
        the world.

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
    looks = turns[model.geom_bodyid] & (model.geom_group != SHAPE_GROUP)
    model.geom_group[looks] = HOUSING_GROUP


def _room_view() -> tuple[mujoco.MjvCamera, mujoco.MjvOption]:
    view, option = mujoco.MjvCamera(), mujoco.MjvOption()
    view.type = mujoco.mjtCamera.mjCAMERA_FREE
    view.lookat[:] = ROOM_AT
    view.distance = ROOM_M
    view.azimuth = ROOM_AZIMUTH
    view.elevation = ROOM_ELEVATION
    option.geomgroup[HOUSING_GROUP] = 1
    return view, option
