"""The head camera: sees what is in its picture and not hidden, with an error that is small and
never nothing.
"""

import msgspec
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from simulated import look_at, placed, put

from companion.skills.situation import Sight
from services.executor.receptor import FARTHEST_M, LEAST_M, TURN_NOISE, Receptor
from velma import names
from velma.kinematics import ik
from velma.kinematics.frames import standing
from velma.kinematics.robot import Robot
from velma.model.kinds import Model
from velma.model.scene import Noise, Scene, SceneObject, load
from velma.sim.mujoco_backend import MujocoBackend

NOISE_M = 0.004
USUAL = Noise(NOISE_M)
CANONICAL = load()
JAR = CANONICAL.find("jar_1")
OPEN = (1.2, 0.0, 1.3)  # in the air, in front of the robot


class Place:
    """A scene with its state and an eye in it."""

    def __init__(self, things: tuple[SceneObject, ...], noise: Noise = USUAL) -> None:
        scene = Scene("test", things, None, noise)
        backend = MujocoBackend(scene)
        self.model, self.qpos = backend.model, backend.configuration().copy()
        self.things = {thing.id: thing.model for thing in things}
        self.noise = noise

    def eye(self, seed: int = 3) -> Receptor:
        return Receptor(self.model, self.things, msgspec.structs.replace(self.noise, seed=seed))

    def turn(self, point: tuple[float, float, float]) -> "Place":
        """The head to a point."""
        look_at(self.model, self.qpos, point)
        return self

    def put(self, name: str, pose: pin.SE3) -> None:
        """A thing that can move goes there."""
        put(self.model, self.qpos, name, pose)

    def seen(self) -> dict[str, Sight]:
        """Return the sights of a new eye at its first look."""
        return {sight.name: sight for sight in self.eye().look(self.qpos)}


def jar(xyz: tuple[float, float, float]) -> SceneObject:
    """A jar somewhere."""
    return SceneObject("jar_1", Model.JAR, xyz)


def test_all_of_the_cabinet_is_seen_from_the_start() -> None:
    """Looking into it: the jar, the bowl, the cabinet itself; and the look leaves the state
    alone.
    """
    place = Place(CANONICAL.things).turn(JAR.xyz)
    before = place.qpos.copy()
    assert {"jar_1", "bowl_1", "cabinet_2"} <= set(place.seen())
    assert (place.qpos == before).all()


@pytest.mark.parametrize("away", [(0.8, -0.8, 0.8), (0.3, -1.0, 1.3), (0.37, 0.85, 3.0)])
def test_a_head_turned_away_does_not_see(away: tuple[float, float, float]) -> None:
    """To the side, far to the side, up: the jar in the cabinet is out of the picture."""
    assert "jar_1" not in Place(CANONICAL.things).turn(away).seen()


def test_what_is_behind_is_not_seen() -> None:
    """A thing behind the back would be in front with the signs of a projection ignored."""
    assert "jar_1" in Place((jar(OPEN),)).turn(OPEN).seen()
    assert "jar_1" not in Place((jar((-OPEN[0], -OPEN[1], OPEN[2])),)).turn(OPEN).seen()


def test_what_is_too_far_or_too_near_is_not_seen() -> None:
    """The camera's range is that of the source: beyond it nothing is reported, nor right before the
    lens.
    """
    place = Place((jar(OPEN),)).turn(OPEN)
    eye = place.model.body(names.CAMERA_BODY)
    data = placed(place.model, place.qpos)
    forwards = data.xmat[eye.id].reshape(3, 3)[:, 2]
    rows = ((0.25, False), (0.7, True), (FARTHEST_M - 0.3, True), (FARTHEST_M + 0.3, False))
    for distance, seen in rows:
        place.put("jar_1", standing(data.xpos[eye.id] + distance * forwards))
        assert ("jar_1" in place.seen()) is seen, distance


def test_what_is_hidden_is_not_seen() -> None:
    """A cabinet with its back to the robot in between; beside it the jar is seen again."""
    wall = SceneObject("cabinet_9", Model.CABINET, (0.9, 0.0, 1.4))
    behind, beside = jar((1.5, 0.0, 1.4)), jar((1.5, 0.8, 1.4))
    assert "jar_1" in Place((behind,)).turn(behind.xyz).seen()
    hidden = Place((wall, behind)).turn(behind.xyz).seen()
    assert "jar_1" not in hidden
    assert "cabinet_9" in hidden
    assert "jar_1" in Place((wall, beside)).turn(beside.xyz).seen()


def test_the_robots_own_hand_does_not_hide_what_it_holds(robot: Robot) -> None:
    """The jar between the fingers, in front of the head, is seen where it is."""
    place = Place((jar(OPEN),))
    grip = pin.SE3(pin.rpy.rpyToMatrix(0.0, np.pi / 2, 0.0), np.array([0.55, 0.25, 1.35]))
    q = ik.sample(robot, "left", grip, np.array(names.START), np.random.default_rng(1), starts=200)
    assert q is not None
    for name, angle in zip(names.BODY, q, strict=True):
        place.qpos[place.model.joint(name).qposadr[0]] = angle
    held = standing(robot.grip(q, "left").translation)
    place.put("jar_1", held)
    sight = place.turn(tuple(held.translation)).seen()["jar_1"]
    assert sight.T_world_object.translation == pytest.approx(held.translation, abs=NOISE_M)


@pytest.fixture(scope="module")
def robot() -> Robot:
    """Torso and arms."""
    return Robot()


@pytest.fixture(scope="module")
def jar_in_sight() -> Place:
    """A jar in the open, looked at."""
    return Place((jar(OPEN),)).turn(OPEN)


def errors(eye: Receptor, place: Place, looks: int) -> np.ndarray:
    """Errors of the jar's place, (looks, 3) [m]."""
    return np.array(
        [eye.look(place.qpos)[0].T_world_object.translation - OPEN for _ in range(looks)]
    )


@settings(max_examples=25)
@given(seed=st.integers(0, 2**31))
def test_the_error_is_small_and_never_nothing(jar_in_sight: Place, seed: int) -> None:
    """At most 4 mm on each horizontal axis, none in height, another one at each look, the same for
    the same seed.
    """
    found = errors(jar_in_sight.eye(seed), jar_in_sight, 5)
    assert (np.abs(found[:, :2]) <= NOISE_M).all()
    assert (np.abs(found[:, :2]) > 0.0).all()
    assert (found[:, 2] == 0.0).all()
    assert len({tuple(row) for row in found}) == 5
    assert (found == errors(jar_in_sight.eye(seed), jar_in_sight, 5)).all()


def test_the_error_fills_its_range_and_is_as_large_as_is_told(jar_in_sight: Place) -> None:
    """Over many looks it comes near both ends, and its mean near zero: uniform, as told. Each sight
    tells its mean square.
    """
    found = errors(jar_in_sight.eye(), jar_in_sight, 400)[:, :2]
    assert (found.max(axis=0) > 0.9 * NOISE_M).all()
    assert (found.min(axis=0) < -0.9 * NOISE_M).all()
    assert np.abs(found.mean(axis=0)) == pytest.approx(0.0, abs=0.2 * NOISE_M)
    (told,) = {jar_in_sight.eye().look(jar_in_sight.qpos)[0].uncertainty for _ in range(3)}
    assert told is not None
    squares = (found**2).mean(axis=0)
    assert (told.xyz[0], told.xyz[3]) == pytest.approx(tuple(squares + LEAST_M**2), rel=0.15)
    assert told.xyz[5] == pytest.approx(LEAST_M**2)


def test_the_turn_is_a_little_off(jar_in_sight: Place) -> None:
    """By at most a fifth of a degree about each axis. Without noise the place is exact: its error
    is the scene's, not the receptor's own.
    """
    eye = jar_in_sight.eye()
    for _ in range(20):
        turn = pin.log3(eye.look(jar_in_sight.qpos)[0].T_world_object.rotation)
        assert 0.0 < np.abs(turn).max() <= TURN_NOISE * (1 + 1e-6)
    exact = Place((jar(OPEN),), Noise(0.0)).turn(OPEN).seen()["jar_1"]
    assert exact.T_world_object.translation == pytest.approx(OPEN)


def test_heights_and_a_constant_error_are_options() -> None:
    """What is constant is the same at each look, another one for another seed."""
    place = Place((jar(OPEN),), Noise(0.002, height=0.01, bias=0.005)).turn(OPEN)
    middles = []
    for seed in (3, 4):
        found = errors(place.eye(seed), place, 400)
        middles.append((found.max(axis=0) + found.min(axis=0)) / 2)
        assert np.ptp(found, axis=0) == pytest.approx((0.004, 0.004, 0.02), rel=0.1)
        assert (np.abs(middles[-1]) <= 0.0055).all()
    assert np.linalg.norm(middles[0] - middles[1]) > 0.001


def test_some_sights_are_far_off() -> None:
    """As many as the scene says, by up to 10 cm; the others as without them."""
    place = Place((jar(OPEN),), Noise(0.002, outliers=0.2)).turn(OPEN)
    found = np.abs(errors(place.eye(), place, 600)[:, :2]).max(axis=1)
    far = found > 0.002
    assert far.mean() == pytest.approx(0.2, abs=0.05)
    assert 0.05 < found.max() < 0.102
