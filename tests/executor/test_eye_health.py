"""What is wrong with the head camera or the encoders below it is told by pictures: real ones,
spoilt by the test.
"""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import pytest
from msgspec.structs import replace
from simulated import look_at

from companion.look_around import POINTS
from companion.skills.situation import Neck
from services.executor.renderer import Saw
from services.executor.renderer_process import Sighted
from velma.eyes import health
from velma.eyes.fit import View
from velma.eyes.lens import LENS
from velma.kinematics.robot import Robot
from velma.model.scene import Scene, load, vary
from velma.sim.mujoco_backend import MujocoBackend
from velma.sim.photographs import Photographs

pytestmark = [pytest.mark.timeout(120), pytest.mark.needs_opengl]

SCENE, ROBOT, OFF = vary(load(), 3), Robot(), 0.05
NO_ERROR: Neck = (0.0, 0.0, 0.0)
Pixels = np.ndarray


class Camera(NamedTuple):
    """Pictures of a scene, and what one needs to take them."""

    photographs: Photographs
    backend: MujocoBackend

    def at(
        self, point: tuple[float, float, float], number: int, error: Neck = NO_ERROR
    ) -> tuple[Pixels, View]:
        """The head to a point; the view by joints that are measured with an error (torso, pan,
        tilt).
        """
        qpos = self.backend.configuration().copy()
        neck = look_at(self.backend.model, qpos, point)
        eye = ROBOT.camera(*np.add(neck, error))
        return self.photographs.take(qpos, number), View(LENS, eye.rotation, eye.translation)


@pytest.fixture(scope="module")
def camera_of() -> Iterator[Callable[[Scene], Camera]]:
    """Make cameras; all are freed at the end, since one that is freed before takes the others'
    context along.
    """
    made: list[Camera] = []

    def make(scene: Scene) -> Camera:
        made.append(Camera(Photographs(scene), MujocoBackend(scene)))
        return made[-1]

    yield make
    for one in made:
        one.photographs.close()


@pytest.fixture(scope="module")
def camera(camera_of: Callable[[Scene], Camera]) -> Camera:
    """The camera of the scene."""
    return camera_of(SCENE)


@pytest.fixture
def sighted() -> Sighted:
    """Eyes that know of no look."""
    return Sighted(SCENE)


def survey(camera: Camera, sighted: Sighted, first: int, error: Neck = NO_ERROR) -> list[Saw]:
    """All three gazes; `first`: number of the first picture."""
    return [
        sighted.saw(first + k, *camera.at(point, first + k, error))
        for k, point in enumerate(POINTS)
    ]


def seen(looks: list[Saw]) -> dict[str, np.ndarray]:
    """What some look showed, and where."""
    return {thing.name: np.array(thing.position) for look in looks for thing in look.things}


def with_moved(name: str, **pose: Any) -> Scene:
    """The scene with a thing at another pose."""
    things = [replace(one, **pose) if one.id == name else one for one in SCENE.things]
    return replace(SCENE, things=tuple(things))


def test_good_looks_raise_no_alarm(camera: Camera, sighted: Sighted) -> None:
    """Gazes around, twice, and from one place again and again."""
    looks = [*survey(camera, sighted, 1), *survey(camera, sighted, 4)]
    looks += [sighted.saw(k, *camera.at(POINTS[0], k)) for k in range(7, 12)]
    assert {(look.wrong, look.off) for look in looks} == {("", 0.0)}
    assert set(seen(looks)) == {thing.id for thing in SCENE.things}


SPOILS: dict[str, Callable[[Pixels], Pixels]] = {
    health.Wrong.DARK: np.zeros_like,
    health.Wrong.UNIFORM: lambda picture: np.full_like(picture, 200),
    health.Wrong.MIRRORED: lambda picture: np.ascontiguousarray(picture[:, ::-1]),
}


@pytest.mark.parametrize("wrong", SPOILS)
def test_a_spoilt_picture_shows_nothing_and_says_why(
    camera: Camera, sighted: Sighted, wrong: str
) -> None:
    """Each time; the next good one is good."""
    survey(camera, sighted, 1)
    for number in (4, 5):
        picture, view = camera.at(POINTS[0], number)
        saw = sighted.saw(number, SPOILS[wrong](picture), view)
        assert (saw.wrong, saw.things) == (wrong, ())
    assert survey(camera, sighted, 6)[0].wrong == ""


@pytest.mark.parametrize("point", [0, 1], ids=["from the same place", "from another one"])
def test_the_same_picture_again_is_a_frozen_camera(
    camera: Camera, sighted: Sighted, point: int
) -> None:
    """At its first repetition, though its number goes on and the robot has not moved: its noise is
    the same.
    """
    picture, view = camera.at(POINTS[0], 1)
    assert sighted.saw(1, picture, view).wrong == ""
    _, now = camera.at(POINTS[point], 2)
    assert [sighted.saw(number, picture, now).wrong for number in (2, 3)] == ["frozen"] * 2
    assert sighted.saw(4, *camera.at(POINTS[point], 4)).wrong == ""


def test_a_picture_with_the_number_of_the_last_one_is_frozen(
    camera: Camera, sighted: Sighted
) -> None:
    """Whatever it shows."""
    sighted.saw(1, *camera.at(POINTS[0], 1))
    assert sighted.saw(1, *camera.at(POINTS[1], 2)).wrong == "frozen"


def test_without_noise_the_same_place_gives_the_same_picture(
    camera_of: Callable[[Scene], Camera],
) -> None:
    """So that is no alarm; the same picture from another place is."""
    without = replace(SCENE, noise=replace(SCENE.noise, pixel=0.0))
    still_camera, sighted = camera_of(without), Sighted(without)
    picture, view = still_camera.at(POINTS[0], 1)
    assert [sighted.saw(number, picture, view).wrong for number in (1, 2)] == ["", ""]
    assert sighted.saw(3, picture, still_camera.at(POINTS[1], 3)[1]).wrong == "frozen"


def test_a_dimmed_picture_shows_the_truth_or_is_dark(camera: Camera) -> None:
    """At a fifth of its brightness the same as before, to 6 mm; at a twentieth nothing, and it says
    so.
    """
    places: dict[float, dict[str, np.ndarray]] = {}
    for share in (1.0, 0.2, 0.05):
        sighted, looks = Sighted(SCENE), []
        for number, point in enumerate(POINTS, 1):
            picture, view = camera.at(point, number)
            looks.append(sighted.saw(number, np.rint(share * picture).astype(np.uint8), view))
        assert {look.wrong for look in looks} == ({"dark"} if share < 0.1 else {""})
        places[share] = seen(looks)
    assert places[0.2].keys() == places[1.0].keys()
    assert not places[0.05]
    assert max(np.linalg.norm(places[0.2][name] - at) for name, at in places[1.0].items()) < 0.006


@pytest.mark.parametrize("joint", [0, 1, 2], ids=["torso", "pan", "tilt"])
def test_an_encoder_of_the_neck_that_is_off_is_told(
    camera: Camera, sighted: Sighted, joint: int
) -> None:
    """How far, in each look, also where no furniture is in view, and nothing is taken from it; then
    that it is well.
    """
    survey(camera, sighted, 1)
    error = tuple(OFF * np.eye(3)[joint])
    looks = survey(camera, sighted, 4, error)
    looks.append(sighted.saw(7, *camera.at((2.0, 0.0, 3.5), 7, error)))
    assert [look.off for look in looks] == pytest.approx([OFF] * 4, rel=0.1)
    assert not seen(looks)
    assert [look.off for look in survey(camera, sighted, 8)] == [0.0] * 3


def test_a_small_offset_is_told_and_seen_with(camera: Camera, sighted: Sighted) -> None:
    """Smaller than what hinders."""
    survey(camera, sighted, 1)
    looks = survey(camera, sighted, 4, (0.0, 0.01, 0.0))
    assert [look.off for look in looks] == pytest.approx([0.01] * 3, rel=0.2)
    assert seen(looks)


MOVED = {"away": (0.05, 0.0, 0.0), "aside": (0.0, 0.05, 0.0), "turned": (0.0, 0.0, 0.05)}


PIECES = [*(("cabinet_2", way) for way in MOVED), ("table_1", "aside"), ("table_2", "away")]


@pytest.mark.parametrize(("name", "way"), PIECES)
def test_furniture_that_was_moved_is_no_encoder(
    camera: Camera, camera_of: Callable[[Scene], Camera], sighted: Sighted, name: str, way: str
) -> None:
    """One piece by 5 cm, or about itself by as much as an encoder is off: it is seen where it is
    now.

    An encoder that is off then is told by its new place.
    """
    before = seen(survey(camera, sighted, 1))
    x, y, turn = MOVED[way]
    one = SCENE.find(name)
    assert one is not None
    at = (one.xyz[0] + x, one.xyz[1] + y, one.xyz[2])
    moved = camera_of(with_moved(name, xyz=at, yaw=one.yaw + turn))
    looks = survey(moved, sighted, 4)
    assert [look.off for look in looks] == [0.0] * 3
    shift = np.linalg.norm(seen(looks)[name] - before[name])
    assert shift == pytest.approx(np.hypot(x, y), abs=0.006)
    off = [look.off for look in survey(moved, sighted, 7, (0.0, OFF, 0.0))]
    assert off == pytest.approx([OFF] * 3, rel=0.1)


def test_furniture_that_was_moved_about_the_robot_is_no_encoder(
    camera: Camera, camera_of: Callable[[Scene], Camera], sighted: Sighted
) -> None:
    """As an encoder would have it, but the cabinet in the same picture stands still."""
    survey(camera, sighted, 1)
    table, cos, sin = SCENE.find("table_2"), np.cos(OFF), np.sin(OFF)
    assert table is not None
    x, y, z = table.xyz
    at = (cos * x - sin * y, sin * x + cos * y, z)
    turned = camera_of(with_moved("table_2", xyz=at, yaw=table.yaw + OFF))
    look = sighted.saw(4, *turned.at(POINTS[2], 4))
    assert look.off == 0.0
    assert {"cabinet_2", "table_2"} <= set(seen([look]))


def test_the_camera_turns_about_the_pivot() -> None:
    """It is a centimetre from the axes of torso, pan and tilt, wherever the head looks."""
    for pan, tilt in ((0.0, 0.0), (0.6, 0.4), (-0.8, 0.9)):
        true = ROBOT.camera(0.0, pan, tilt)
        for error in np.eye(3) * OFF:
            wrong = ROBOT.camera(error[0], pan + error[1], tilt + error[2])
            shift = (wrong * true.inverse()).act(np.array(health.PIVOT)) - health.PIVOT
            assert np.linalg.norm(shift) < 0.011 * OFF
