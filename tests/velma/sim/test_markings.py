"""Markers in the simulated world: the physics does not feel them, and each is read where it is,
upright.
"""

from collections.abc import Iterator

import cv2
import mujoco
import numpy as np
import pinocchio as pin
import pytest

from velma.eyes import detect
from velma.eyes.detect import Detector
from velma.eyes.fit import View
from velma.eyes.lens import HEIGHT, LENS, WIDTH
from velma.model.kinds import DOORS, Model
from velma.model.markers import Marker, of_scene
from velma.model.scene import Noise, Scene, SceneObject, hung, load
from velma.sim.mujoco_backend import MujocoBackend, compiled
from velma.sim.photographs import CAMERA, HeadCamera, marked

AT = (1.5, 0.0, 1.0)
AWAY_M, NEAR_M = 0.5, 0.25  # of the camera, from furniture and from things


def test_the_physics_is_the_same_bit_by_bit() -> None:
    """A second of the canonical scene with grains, robot moving: every coordinate, and masses and
    inertias.
    """
    scene = load()
    worlds = []
    for model in (compiled(scene), marked(scene)):
        data = mujoco.MjData(model)
        data.qpos[:] = MujocoBackend(scene).configuration()
        for step in range(500):
            data.ctrl[:] = 2.0 * np.sin(0.01 * step + np.arange(model.nu))
            mujoco.mj_step(model, data)
        worlds.append((model, data))
    (plain, free), (model, data) = worlds
    assert np.abs(free.qpos - MujocoBackend(scene).configuration()).max() > 0.1
    assert (data.qpos == free.qpos).all()
    assert (data.qvel == free.qvel).all()
    assert (model.body_mass == plain.body_mass).all()
    assert (model.body_inertia == plain.body_inertia).all()
    assert model.ngeom == plain.ngeom + len(scene.things)


def alone(model: Model) -> tuple[SceneObject, ...]:
    """Return a thing of this model in the air; a leaf hangs wide open at its cabinet."""
    if model not in DOORS:
        return (SceneObject("thing_1", model, AT),)
    return SceneObject("cabinet_1", Model.CABINET_DOOR, AT), SceneObject(
        "thing_1", model, of="cabinet_1", open=1.5
    )


class Stand:
    """One thing in the air and a camera that goes anywhere: the head's, taken off."""

    def __init__(self, model: Model) -> None:
        scene = hung(Scene("test", alone(model), None, Noise(0.0)))
        thing = scene.things[-1]
        turned = np.array(pin.utils.rotate("z", thing.yaw))
        self.markers = [
            one._replace(corners=one.corners @ turned.T + thing.xyz)  # in the world
            for one in of_scene(scene)[thing.id]
        ]
        self.detector = Detector(one.number for one in self.markers)
        self.model = marked(scene)
        self.qpos = self.model.qpos0.copy()
        self.camera = HeadCamera(self.model, WIDTH, HEIGHT)
        self.model.cam_bodyid[self.model.camera(CAMERA).id] = 0

    def before(self, marker: Marker, away: float) -> tuple[np.ndarray, View]:
        """The grey picture from before a marker, a little from above and aside, and the view."""
        middle = marker.corners.mean(axis=0)
        across, up = marker.corners[1] - marker.corners[0], marker.corners[0] - marker.corners[3]
        normal = np.cross(across, up) / np.linalg.norm(across) ** 2
        eye = middle + away * (normal + 0.2 * up / np.linalg.norm(up))
        forwards = (middle - eye) / np.linalg.norm(middle - eye)
        right = np.cross(forwards, up / np.linalg.norm(up))
        right /= np.linalg.norm(right)
        rotation = np.column_stack([right, np.cross(forwards, right), forwards])
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, (rotation @ np.diag([1.0, -1.0, -1.0])).ravel())
        camera = self.model.camera(CAMERA).id
        self.model.cam_pos[camera], self.model.cam_quat[camera] = eye, quaternion
        picture = self.camera.picture(self.qpos)
        return cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), View(LENS, rotation, eye)


@pytest.fixture(params=list(Model), ids=str)
def stand(request: pytest.FixtureRequest) -> Iterator[Stand]:
    """Each model of a thing."""
    made = Stand(request.param)
    yield made
    made.camera.close()


@pytest.mark.needs_opengl
def test_each_marker_is_read_where_it_is_and_upright(stand: Stand) -> None:
    """Number and order of corners: no plate is mirrored, turned, or below the surface it lies
    on.
    """
    away = AWAY_M if (stand.markers[0].corners - AT).max() > 0.15 else NEAR_M
    for marker in stand.markers:
        # of the bowl: its other side is in the way
        inside = marker.number >= 38 and len(stand.markers) == 18
        grey, view = stand.before(marker, 0.12 if inside else away)
        found = stand.detector.find(grey)
        assert marker.number in found
        expected = view.lens.project(view.inside(marker.corners))
        assert found[marker.number] == pytest.approx(expected, abs=2.5)


def test_a_pattern_is_that_of_the_dictionary() -> None:
    """White rim, black rim, bits; the same in a larger dictionary; and more than there are is an
    error.
    """
    picture = detect.plate(7, 4)
    assert picture.shape == (32, 32)
    assert (picture[:4] == 255).all()
    assert (picture[4:8, 4:28] == 0).all()
    larger = cv2.aruco.generateImageMarker(detect.dictionary(250), 7, 24, borderBits=1)
    assert (picture[4:28, 4:28] == larger).all()
    with pytest.raises(ValueError, match="251 markers"):
        detect.dictionary(251)
