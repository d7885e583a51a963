"""The head camera's picture: what is where in it is what is where in the world, in the scene's
colours.
"""

import math
import subprocess
import sys
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from simulated import look_at, placed, turn_head

from velma import names
from velma.eyes.lens import HALF_WIDTH, HEIGHT, LENS, WIDTH
from velma.model.build import load as robot
from velma.model.kinds import Model
from velma.model.scene import Noise, Scene, SceneObject, load
from velma.model.surfaces import MATERIALS
from velma.sim import gl
from velma.sim.mujoco_backend import MujocoBackend, compiled
from velma.sim.photographs import HOUSING, HeadCamera

pytestmark = pytest.mark.needs_opengl

OPEN = (1.2, 0.0, 1.3)
BOWL_M = 0.1  # high, velma/model/objects.yaml
Point = tuple[float, float, float]


class View:
    """A scene in the start posture, and a camera in it."""

    def __init__(self, scene: Scene) -> None:
        self.qpos = MujocoBackend(scene).configuration().copy()
        self.model = compiled(scene)
        self.camera = HeadCamera(self.model, WIDTH, HEIGHT)

    def turn(self, pan: float, tilt: float) -> "View":
        """The head."""
        turn_head(self.model, self.qpos, pan, tilt)
        return self

    def to(self, point: Point | np.ndarray) -> "View":
        """The head to a point."""
        look_at(self.model, self.qpos, point)
        return self

    def at(self, point: Point) -> tuple[int, int]:
        """Row and column of a point of the world, by the body of the optical frame and the lens."""
        body = placed(self.model, self.qpos).body(names.CAMERA_BODY)
        seen = (np.array(point) - body.xpos) @ body.xmat.reshape(3, 3)
        column, row = LENS.project(seen[None])[0]
        return round(float(row)), round(float(column))

    def pixel(self, point: Point) -> np.ndarray:
        """Red, green, blue (3,) where a point of the world is."""
        row, column = self.at(point)
        assert 0 <= row < HEIGHT
        assert 0 <= column < WIDTH
        return np.array(self.camera.picture(self.qpos)[row, column], dtype=float)


Show = Callable[..., View]


@pytest.fixture
def show() -> Iterator[Show]:
    """Makes views of the canonical scene, or of some things; their contexts are freed."""
    made: list[View] = []

    def view(*things: SceneObject) -> View:
        made.append(View(Scene("test", things, None, Noise(0.0)) if things else load()))
        return made[-1]

    yield view
    for one in made:
        one.camera.close()


def hue(pixel: np.ndarray) -> np.ndarray:
    """A colour without its brightness."""
    return np.asarray(pixel / np.linalg.norm(pixel))


def test_things_have_their_colours_where_they_are(show: Show) -> None:
    """Looking into the cabinet: the blue bowl, the wood of the shelf beside the jar, grains in the
    jar's foot.
    """
    scene = load()
    bowl, jar = scene.find("bowl_1"), scene.find("jar_1")
    assert bowl is not None
    assert jar is not None
    view = show().to(bowl.xyz)
    glaze = hue(np.array(MATERIALS["glaze"][0][:3]))
    assert hue(view.pixel(bowl.xyz)) == pytest.approx(glaze, abs=0.1)
    view.to(jar.xyz)
    row, column = view.at(jar.xyz)
    red, green, blue = np.moveaxis(view.camera.picture(view.qpos).astype(int), 2, 0)
    yellow = (red > blue + 50) & (np.abs(red - green) < 40)  # through the glass; wood is redder
    assert yellow[row : row + 75, column - 35 : column + 45].sum() > 300
    assert yellow[row - 75 : row, column - 35 : column + 45].sum() == 0


def test_a_thing_is_drawn_where_mujoco_projects_it(show: Show) -> None:
    """A bowl in the air, looked past by some degrees: all that is blue lies about the pixel of its
    middle.
    """
    view = show(SceneObject("bowl_1", Model.BOWL, OPEN))
    for away in ((0.0, 0.0, 0.0), (0.0, 0.25, 0.0), (0.0, -0.25, 0.1), (0.2, 0.1, -0.2)):
        picture = view.to(np.add(OPEN, away)).camera.picture(view.qpos).astype(int)
        rows, columns = np.nonzero(picture[..., 2] > picture[..., 0] + 40)
        row, column = view.at((OPEN[0], OPEN[1], OPEN[2] + BOWL_M / 2))
        assert len(rows) > 2000, away
        assert abs(rows.mean() - row) < 10, away
        assert abs(columns.mean() - column) < 4, away


def test_nothing_of_the_head_is_in_the_picture(show: Show) -> None:
    """A picture with the head's shell before the lens is the same as without."""
    view = show(SceneObject("bowl_1", Model.BOWL, OPEN))
    before = view.to(OPEN).camera.picture(view.qpos)
    shell = np.flatnonzero(view.model.geom_bodyid == view.model.body(HOUSING).id)
    view.model.geom_pos[shell] = (0.4, 0.21, 0.02)  # x ahead, y up, z right, of the tilting frame
    assert (view.camera.picture(view.qpos) == before).all()


def test_its_arms_are_in_the_picture(show: Show) -> None:
    """Only what turns with the camera is left out: looking at its hand, the robot sees the orange
    of its joints.
    """
    view = show(SceneObject("bowl_1", Model.BOWL, (-2.0, 0.0, 1.0)))
    palm = placed(view.model, view.qpos).body("left_HandPalmLink").xpos
    picture = view.to(palm).camera.picture(view.qpos).astype(int)
    orange = (picture[..., 0] > picture[..., 1] + 60) & (picture[..., 1] > picture[..., 2] + 30)
    assert orange.sum() > 4000


def bluish(view: View) -> int:
    """How many pixels are bluer than sky."""
    picture = view.camera.picture(view.qpos).astype(int)
    return int((picture[..., 2] > picture[..., 0] + 40).sum())


def test_what_stands_in_front_hides_and_what_is_clear_does_not(show: Show) -> None:
    """A table hides the bowl under it, the thin back of a cabinet lets the bowl behind it be
    seen.
    """
    table = SceneObject("table_9", Model.TABLE, (0.783, -0.84, 0.0))
    under = SceneObject("bowl_1", Model.BOWL, (0.95, -0.95, 0.4))
    behind = SceneObject("bowl_1", Model.BOWL, (1.6, 0.0, 1.3))
    assert bluish(show(under).to(under.xyz)) > 2000
    assert bluish(show(under, table).to(under.xyz)) == 0
    back = SceneObject("cabinet_9", Model.CABINET, (1.0, 0.0, 1.15))
    whole = bluish(show(behind).to(behind.xyz))
    clear = np.array(show(behind, back).to(behind.xyz).pixel(behind.xyz))
    closed = np.array(show(back).to(behind.xyz).pixel(behind.xyz))
    assert whole > 2000
    assert np.abs(clear - closed).max() > 20


def test_a_picture_leaves_the_state_alone_and_is_the_same_again(show: Show) -> None:
    """It is a function of the state."""
    view = show().turn(0.3, 0.4)
    before = view.qpos.copy()
    first = view.camera.picture(view.qpos)
    view.camera.picture(view.turn(0.0, 0.0).qpos)
    assert (view.camera.picture(before) == first).all()
    assert (view.turn(0.3, 0.4).qpos == before).all()
    assert first.shape == (HEIGHT, WIDTH, 3)
    assert first.dtype == np.uint8


def test_from_the_room_the_whole_robot_is_seen(show: Show) -> None:
    """With the head, which its own camera does not see. That one's picture is the same afterwards,
    but for rounding.
    """
    view = show()
    start = view.qpos.copy()
    before = view.camera.picture(start)
    room = view.camera.room(start).astype(int)
    orange = (room[..., 0] > 180) & (room[..., 2] < 80)
    assert orange.mean() > 0.005  # the covers of its joints
    turned = view.turn(0.6, 0.5)
    changed = np.abs(view.camera.room(turned.qpos).astype(int) - room).max(axis=2) > 20
    assert 0.001 < changed.mean() < 0.03  # the head alone is drawn elsewhere
    assert np.abs(view.camera.picture(start).astype(int) - before).max() <= 1


def test_the_lens_is_that_of_the_robot(show: Show) -> None:
    """Size and field of view are those of robot.yaml, and the pose that of MuJoCo's body of the
    optical frame.
    """
    (camera,) = [body["camera"] for body in robot()["head"] if "camera" in body]
    assert tuple(camera["size"]) == (WIDTH, HEIGHT)
    assert pytest.approx(math.tan(camera["hfov"] / 2)) == HALF_WIDTH
    view = show(SceneObject("bowl_1", Model.BOWL, OPEN)).to(OPEN)
    view.camera.picture(view.qpos)
    rotation, position = view.camera.pose()
    body = placed(view.model, view.qpos).body(names.CAMERA_BODY)
    assert position == pytest.approx(body.xpos)
    assert rotation == pytest.approx(body.xmat.reshape(3, 3))


def test_both_libraries_draw_the_same(show: Show, monkeypatch: pytest.MonkeyPatch) -> None:
    """OSMesa in a process of its own."""
    view = show(SceneObject("bowl_1", Model.BOWL, OPEN)).to(OPEN)
    picture = view.camera.picture(view.qpos)
    code = (
        "import sys, numpy as np\n"
        "from velma.model.kinds import Model\n"
        "from velma.model.scene import Noise, Scene, SceneObject\n"
        "from velma.sim.photographs import HeadCamera\n"
        "from velma.sim.mujoco_backend import compiled\n"
        f"thing = SceneObject('bowl_1', Model.BOWL, {OPEN})\n"
        f"camera = HeadCamera(compiled(Scene('test', (thing,), None, Noise(0.0))), {WIDTH},"
        f" {HEIGHT})\n"
        "picture = camera.picture(np.frombuffer(sys.stdin.buffer.read()))\n"
        "sys.stdout.buffer.write(picture.tobytes())\n"
        "camera.close()\n"
    )
    monkeypatch.setenv("MUJOCO_GL", gl.OSMESA)
    monkeypatch.delenv("PYOPENGL_PLATFORM", raising=False)
    if gl.lost():
        pytest.skip("needs OSMesa (Debian: apt install libosmesa6)")
    run = subprocess.run(
        [sys.executable, "-c", code], input=view.qpos.tobytes(), capture_output=True, timeout=50
    )
    assert run.returncode == 0, run.stderr.decode()
    other = np.frombuffer(run.stdout, np.uint8).reshape(picture.shape)
    assert np.abs(picture.astype(int) - other).mean() < 0.5
