"""The head camera's picture: what is where in it is what is where in the world, in the scene's colours."""

import math

import mujoco
import numpy as np
import pytest

from services.executor.camera import HEIGHT, SKY, WIDTH, Camera
from services.executor.skills.motions import aim
from velma import names
from velma.model.scene import Model, Noise, Scene, Thing, load
from velma.model.surfaces import MATERIALS
from velma.sim.mujoco_backend import MujocoBackend, compiled

OPEN = (1.2, 0.0, 1.3)
BOWL_M = 0.1  # high, velma/model/objects.yaml
SKY_PIXEL = tuple(round(255 * part) for part in SKY)
Point = tuple[float, float, float]


class View:
    """A scene in the start posture, and a camera in it."""

    def __init__(self, *things: Thing) -> None:
        scene = Scene("test", things, None, Noise(0.0)) if things else load()
        self.qpos = MujocoBackend(scene).configuration().copy()
        self.model = compiled(scene)
        self.camera = Camera(compiled(scene))

    def turn(self, pan: float, tilt: float) -> "View":
        """The head."""
        for name, angle in zip(names.HEAD, (pan, tilt), strict=True):
            self.qpos[self.model.joint(name).qposadr[0]] = angle
        return self

    def to(self, point: Point) -> "View":
        """The head to a point."""
        goal = aim(0.0, point)
        return self.turn(goal.pan, goal.tilt)

    def at(self, point: Point) -> tuple[int, int]:
        """Row and column of a point of the world, by MuJoCo's own camera: its place, axes and field of view."""
        data = mujoco.MjData(self.model)
        data.qpos[:] = self.qpos
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_camlight(self.model, data)
        right, up, back = data.cam_xmat[0].reshape(3, 3).T @ (np.array(point) - data.cam_xpos[0])
        half = math.tan(math.radians(self.model.cam_fovy[0]) / 2)
        row = HEIGHT / 2 * (1 - up / (-back * half))
        column = WIDTH / 2 * (1 + right / (-back * half) * HEIGHT / WIDTH)
        return math.floor(float(row)), math.floor(float(column))

    def pixel(self, point: Point) -> np.ndarray:
        """Red, green, blue (3,) where a point of the world is."""
        row, column = self.at(point)
        assert 0 <= row < HEIGHT
        assert 0 <= column < WIDTH
        return np.array(self.camera.picture(self.qpos)[row, column], dtype=float)


def hue(pixel: np.ndarray) -> np.ndarray:
    """A colour without its brightness."""
    return np.asarray(pixel / np.linalg.norm(pixel))


def test_things_have_their_colours_where_they_are() -> None:
    """Looking into the cabinet: the blue bowl, the wood of the shelf beside the jar, grains in the jar's foot."""
    scene = load()
    bowl, jar = scene.find("bowl_1"), scene.find("jar_1")
    assert bowl is not None
    assert jar is not None
    view = View().to(bowl.xyz)
    assert hue(view.pixel(bowl.xyz)) == pytest.approx(hue(np.array(MATERIALS["glaze"][0][:3])), abs=0.08)
    view.to(jar.xyz)
    yellow = hue(np.array(MATERIALS["grain"][0][:3]))
    row, column = view.at(jar.xyz)
    foot = view.camera.picture(view.qpos)[row : row + 12, column - 4 : column + 5].reshape(-1, 3).astype(float)
    assert sum(np.abs(hue(pixel) - yellow).max() < 0.15 for pixel in foot) > 5


@pytest.mark.parametrize("away", [(0.0, 0.0, 0.0), (0.0, 0.25, 0.0), (0.0, -0.25, 0.1), (0.2, 0.1, -0.2)])
def test_a_thing_is_drawn_where_mujoco_projects_it(away: Point) -> None:
    """A bowl in the air, looked past by some degrees: all that is blue lies about the pixel of its middle."""
    bowl = Thing("bowl_1", Model.BOWL, OPEN)
    aimed = tuple(a + b for a, b in zip(OPEN, away, strict=True))
    view = View(bowl).to((aimed[0], aimed[1], aimed[2]))
    picture = view.camera.picture(view.qpos).astype(int)
    rows, columns = np.nonzero(picture[..., 2] > picture[..., 0] + 40)
    row, column = view.at((OPEN[0], OPEN[1], OPEN[2] + BOWL_M / 2))
    assert len(rows) > 50
    assert abs(rows.mean() - row) < 2
    assert abs(columns.mean() - column) < 2


def test_nothing_of_the_head_is_in_the_picture() -> None:
    """Looking up and about in an empty world every pixel is sky, even where the head's shell is before the lens."""
    view = View(Thing("bowl_1", Model.BOWL, (-2.0, 0.0, 1.0)))
    shell = np.flatnonzero(view.model.geom_bodyid == view.model.body("head_tilt_link").id)
    view.model.geom_pos[shell] = (0.4, 0.21, 0.02)  # x ahead, y up, z right, of the tilting frame
    camera = Camera(view.model)
    for pan in (-1.0, 0.0, 1.0):
        picture = camera.picture(view.turn(pan, -0.7).qpos)
        assert (picture == SKY_PIXEL).all()


def test_its_arms_are_in_the_picture() -> None:
    """Only what turns with the camera is left out: looking at its hand, the robot sees the orange of its joints."""
    view = View(Thing("bowl_1", Model.BOWL, (-2.0, 0.0, 1.0)))
    data = mujoco.MjData(view.model)
    data.qpos[:] = view.qpos
    mujoco.mj_kinematics(view.model, data)
    x, y, z = data.body("left_HandPalmLink").xpos
    picture = view.to((x, y, z)).camera.picture(view.qpos).astype(int)
    orange = (picture[..., 0] > picture[..., 1] + 60) & (picture[..., 1] > picture[..., 2] + 30)
    assert orange.sum() > 100


def bluish(view: View) -> int:
    """Return the number of pixels that are bluer than steel, and no sky."""
    picture = view.camera.picture(view.qpos).astype(int)
    return int((picture[..., 2] > picture[..., 0] + 25).sum())


def test_what_stands_in_front_hides_and_what_is_clear_does_not() -> None:
    """A table hides the bowl under it, the thin back of a cabinet lets the bowl behind it be seen."""
    table = Thing("table_9", Model.TABLE, (0.783, -0.84, 0.0))
    under, behind = (Thing("bowl_1", Model.BOWL, at) for at in ((0.95, -0.95, 0.4), (1.6, 0.0, 1.3)))
    assert bluish(View(under).to(under.xyz)) > 50
    assert bluish(View(under, table).to(under.xyz)) == 0
    back = Thing("cabinet_9", Model.CABINET, (1.0, 0.0, 1.15))
    assert bluish(View(behind).to(behind.xyz)) > 50
    assert bluish(View(behind, back).to(behind.xyz)) > 20


def test_a_picture_leaves_the_state_alone_and_is_the_same_again() -> None:
    """It is a function of the state."""
    view = View().turn(0.3, 0.4)
    before = view.qpos.copy()
    first = view.camera.picture(view.qpos)
    assert (view.qpos == before).all()
    assert (View().camera.picture(before) == first).all()
    assert first.shape == (HEIGHT, WIDTH, 3)
    assert first.dtype == np.uint8
