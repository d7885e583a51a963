"""Pictures of the head camera as a real one would take them: with noise, blur, exposure, and a
camera that is not quite where the robot's model has it (all of the scene's noise).
"""

import math
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from velma.eyes import detect
from velma.eyes.lens import HEIGHT, WIDTH
from velma.eyes.pictures import disturbed
from velma.model.build import LOOK_GROUP, SHAPE_GROUP
from velma.model.markers import Marker, of_scene
from velma.model.scene import Scene, checked
from velma.model.scene_xml import scene_xml
from velma.sim import gl
from velma.sim.disturbances import Kind, Of, Orders
from velma.sim.disturbed_world import SpoiledPictures

# --- Markers on the things of a simulated world, for pictures. They have no mass and no contact ---
# The physics is the same. A body has one texture with all its plates and one mesh of squares: so
# many geoms would be slower to draw.


TEXELS = 12
"""Of a field of a plate, each way; a plate of 96 texels is sharp enough (measured)."""


def marked(scene: Scene) -> mujoco.MjModel:
    """Return the model of a scene with markers on its things. Its coordinates are those of the
    model without.
    """
    spec = mujoco.MjSpec.from_string(scene_xml(checked(scene)))
    for name, markers in of_scene(scene).items():
        _mark(spec, name, markers)
    return spec.compile()


def _mark(spec: Any, name: str, markers: Sequence[Marker]) -> None:
    """Add one mesh with the plates of a body's markers to the body `name`."""
    label, columns = f"{name}_markers", math.ceil(math.sqrt(len(markers)))
    rows = math.ceil(len(markers) / columns)
    sheet = _sheet(markers, rows, columns)
    height, width = sheet.shape
    texture = spec.add_texture(
        name=label, type=mujoco.mjtTexture.mjTEXTURE_2D, width=width, height=height, nchannel=3
    )
    texture.data = np.repeat(sheet[..., None], 3, axis=2).tobytes()
    material = spec.add_material(name=label, specular=0.0, shininess=0.0)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = label
    faces = np.array(
        [(4 * k + a, 4 * k + b, 4 * k + c) for k in range(len(markers)) for a, b, c in _HALVES]
    )
    mesh = spec.add_mesh(name=label)
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # an open surface has no volume
    mesh.uservert = np.concatenate([marker.plate() for marker in markers]).ravel().tolist()
    mesh.usertexcoord = _texcoords(len(markers), rows, columns).ravel().tolist()
    mesh.userface = mesh.userfacetexcoord = faces.ravel().tolist()
    geom = spec.body(name).add_geom(
        name=label, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=label, material=label
    )
    geom.contype = geom.conaffinity = 0
    geom.group, geom.mass = int(LOOK_GROUP), 0.0


_HALVES = ((3, 2, 1), (3, 1, 0))
"""Triangles of a square whose corners are upper left, upper right, lower right, lower left: seen
from its front.
"""


def _sheet(markers: Sequence[Marker], rows: int, columns: int) -> np.ndarray:
    """Return grey levels (rows x n, columns x n) of all plates, row by row, white where none is."""
    side = detect.MODULES * TEXELS
    sheet = np.full((rows * side, columns * side), 255, np.uint8)
    for k, marker in enumerate(markers):
        y, x = divmod(k, columns)
        sheet[y * side : (y + 1) * side, x * side : (x + 1) * side] = detect.plate(
            marker.number, TEXELS
        )
    return sheet


def _texcoords(count: int, rows: int, columns: int) -> np.ndarray:
    """Return where (count, 4, 2) the corners of the plates are in the sheet, 0 to 1, v downwards
    from the top row.
    """
    at = np.array([divmod(k, columns)[::-1] for k in range(count)])[:, None, :]
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])[None]
    return np.asarray((at + corners) / np.array([columns, rows]))


# --- The head camera, rendered by MuJoCo in a copy of the simulated world -------------------------
# No shadows: they would cost as much as the rest. Transparent shapes are blended with what is
# behind them.

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]

CAMERA = "kinect"
HOUSING = "head_tilt_link"
"""The link that turns with the camera. It is left out of the picture, as a real camera looks out of
its housing.
"""
# a group of geoms that renderers show when asked to, beside SHAPE_GROUP
HOUSING_GROUP = 4
MOST_GEOMS = 2000  # estimate: a scene has 250
# a part of the picture's buffer; estimate: fingers can be told apart
ROOM_WIDTH, ROOM_HEIGHT = 400, 300
FRAME_WIDTH, FRAME_HEIGHT = 640, 480
"""Of a picture that people see large. At 800 x 600 that of the room takes a quarter more of a
processor (55 and 44 ms, measured).
"""
COARSE_SLICES, COARSE_STACKS = 16, 8
"""Facets of round shapes in pictures for people; with MuJoCo's own 28 and 16 that of the room takes
half as much again (62 and 44 ms of a processor, measured).
"""
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
        model.vis.quality.numslices, model.vis.quality.numstacks = COARSE_SLICES, COARSE_STACKS
        self._coarse = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
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
        return self._drawn(self._area, self._option, self._view, self._context)

    def head(self, qpos: Array, width: int, height: int) -> Pixels:
        """Return the same view for people: (height, width, 3), at most as large as `picture`."""
        self._place(qpos)
        area = mujoco.MjrRect(0, 0, width, height)
        return self._drawn(area, self._option, self._view, self._coarse)

    def room(self, qpos: Array, width: int = ROOM_WIDTH, height: int = ROOM_HEIGHT) -> Pixels:
        """Return the robot in the state qpos (nq,), from a place in the room: (height, width, 3),
        at most as large as `picture`.
        """
        self._place(qpos)
        area = mujoco.MjrRect(0, 0, width, height)
        return self._drawn(area, self._from_room, self._room, self._coarse)

    def _place(self, qpos: Array) -> None:
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)

    def _drawn(
        self,
        area: mujoco.MjrRect,
        option: mujoco.MjvOption,
        view: mujoco.MjvCamera,
        context: mujoco.MjrContext,
    ) -> Pixels:
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, context)
        every = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(self._model, self._data, option, None, view, every, self._scene)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = 0
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = 0
        mujoco.mjr_render(area, self._scene, context)
        pixels = np.empty((area.height, area.width, 3), np.uint8)
        mujoco.mjr_readPixels(pixels, None, area, context)
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
        self._coarse.free()
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


# --- Pictures of the head camera as a real one would take them ------------------------------------


_MOUNT, _PICTURE = 1, 2  # random streams of a scene's seed


class Photographs:
    """Takes pictures in a copy of the world of a scene, things with their markers. Raises GlError
    without OpenGL.
    """

    def __init__(self, scene: Scene) -> None:
        self._noise = scene.noise
        model = marked(scene)
        _misplace(model, scene)
        self._model, self._places = model, model.body_pos.copy()
        self._camera = HeadCamera(model, WIDTH, HEIGHT)
        self._orders, self._spoiled = Orders.named(), SpoiledPictures()

    def take(self, qpos: Array, number: int) -> Pixels:
        """Return the picture (HEIGHT, WIDTH, 3) of the state qpos (nq,); `number`: which look it
        is, for its noise.
        """
        return self.both(qpos, number)[1]

    def both(
        self, qpos: Array, number: int, spoiled: SpoiledPictures | None = None
    ) -> tuple[Pixels, Pixels]:
        """Return the picture of a perfect camera, and the one that `take` returns, or that of
        another camera beside it.

        `spoiled`: what goes on in the pictures of that one.
        """
        spoiled = spoiled or self._spoiled
        clean, noise, going_on = self.clean(qpos), self._noise, self._orders.going_on
        rng = np.random.default_rng([noise.seed, _PICTURE, number])
        gain = 1.0 + noise.exposure * rng.uniform(-1.0, 1.0)
        lit = spoiled.light(clean, going_on)
        return clean, spoiled.taken(disturbed(lit, noise.pixel, noise.blur, gain, rng), going_on)

    def clean(self, qpos: Array) -> Pixels:
        """Return the picture (HEIGHT, WIDTH, 3) of a perfect camera."""
        self._move()
        return self._camera.picture(qpos)

    def head(self, qpos: Array, width: int, height: int) -> Pixels:
        """Return what a perfect camera sees, for people: (height, width, 3)."""
        self._move()
        return self._camera.head(qpos, width, height)

    def _move(self) -> None:
        """Put furniture where it was moved to: its place is none of the coordinates."""
        self._orders.look()
        self._model.body_pos[:] = self._places
        for one in self._orders.going_on:
            if one.of is Of.THING and one.kind is Kind.MOVED:
                self._model.body(one.on).pos[:] += one.size

    def room(self, qpos: Array, width: int = ROOM_WIDTH, height: int = ROOM_HEIGHT) -> Pixels:
        """Return the robot in the state qpos (nq,), from a place in the room."""
        self._move()
        return self._camera.room(qpos, width, height)

    def close(self) -> None:
        """Free the camera."""
        self._camera.close()


def _misplace(model: mujoco.MjModel, scene: Scene) -> None:
    """Turn and shift the camera against the model that the robot has of itself, uniform on each
    axis.
    """
    noise, camera = scene.noise, model.camera(CAMERA).id
    rng = np.random.default_rng([noise.seed, _MOUNT])
    turn = noise.camera_turn * rng.uniform(-1, 1, 3)
    off = noise.camera_shift * rng.uniform(-1, 1, 3)
    quaternion = np.zeros(4)
    before = model.cam_quat[camera].copy()
    angle = float(np.linalg.norm(turn))
    mujoco.mju_axisAngle2Quat(quaternion, turn / max(1e-12, angle), angle)
    mujoco.mju_mulQuat(model.cam_quat[camera], quaternion, before)
    model.cam_pos[camera] += off
