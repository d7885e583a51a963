"""The pose fit: derivatives, poses recovered from their pixels, and an honest covariance."""

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from velma.eyes.fit import FLOOR_PX, View, _linear, fit, largest, poses
from velma.eyes.lens import LENS
from velma.model.kinds import Model
from velma.model.markers import Marker, of_scene
from velma.model.scene import Scene, SceneObject

JAR: tuple[Marker, ...] = of_scene(
    Scene("jar", (SceneObject("jar_1", Model.JAR, (0.0, 0.0, 0.0)),))
)["jar_1"]
SEEN = (JAR[0], JAR[1], JAR[8], JAR[15])  # those that look along +x
EYE = np.array([0.0, 0.0, 1.6])
yaws, tilts = st.floats(-math.pi, math.pi), st.floats(-0.6, 0.6)
places = st.tuples(st.floats(0.6, 1.2), st.floats(-0.3, 0.3), st.floats(0.8, 1.3)).map(np.array)


def looking(point: np.ndarray) -> View:
    """A camera at EYE that looks at a point; its picture is level."""
    forwards = (point - EYE) / np.linalg.norm(point - EYE)
    right = np.cross(forwards, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    return View(LENS, np.column_stack([right, np.cross(forwards, right), forwards]), EYE)


def towards(yaw: float) -> np.ndarray:
    """The rotation that shows SEEN to a camera on the side of -x, turned by a yaw (-pi to pi) of at
    most 0.3.
    """
    return np.asarray(pin.exp3(np.array([0.0, 0.0, math.pi + 0.1 * yaw])))


CORNERS = np.concatenate([one.corners for one in SEEN])


def pixels(view: View, rotation: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Where the corners of SEEN are in the picture."""
    return view.lens.project(view.inside(CORNERS @ rotation.T + position))


@given(position=places, yaw=yaws, turn=st.tuples(tilts, tilts))
def test_derivatives_are_those_of_small_steps(
    position: np.ndarray, yaw: float, turn: tuple[float, float]
) -> None:
    """Each of the six columns, against differences."""
    view = looking(position)
    rotation = pin.exp3(np.array([*turn, 0.0])) @ towards(yaw)
    at = pixels(view, rotation, position)
    off, slopes = _linear(view, CORNERS @ rotation.T, position, at)
    assert off == pytest.approx(np.zeros(len(off)), abs=1e-9)
    for k in range(6):
        step = np.zeros(6)
        step[k] = 1e-6
        moved = pin.exp3(step[3:]) @ rotation
        after, _ = _linear(view, CORNERS @ moved.T, position + step[:3], at)
        assert after / 1e-6 == pytest.approx(slopes[:, k], rel=1e-3, abs=0.1)


@given(
    position=places,
    yaw=yaws,
    off=st.tuples(*[st.floats(-0.05, 0.05)] * 3),
    spin=st.floats(-0.4, 0.4),
)
def test_a_standing_body_is_found_from_a_start_that_is_off(
    position: np.ndarray, yaw: float, off: tuple[float, float, float], spin: float
) -> None:
    """By 5 cm and 0.4 rad, without noise exactly; and it stands."""
    view, rotation = looking(position), towards(yaw)
    start = (pin.exp3(np.array([0.1, -0.1, spin])) @ rotation, position + off)
    found = fit(view, CORNERS, pixels(view, rotation, position), start, upright=True)
    assert found is not None
    assert found.position == pytest.approx(position, abs=1e-6)
    assert found.rotation == pytest.approx(rotation, abs=1e-6)
    assert found.rms_px < 1e-5
    assert found.rotation[2, 2] == 1.0


# almost from straight ahead
@example(position=np.array((1.125, 0.0, 1.1875)), yaw=0.0, turn=(0.0, 0.375))
@given(position=places, yaw=yaws, turn=st.tuples(tilts, tilts))
def test_a_tipped_body_is_found_from_its_largest_marker(
    position: np.ndarray, yaw: float, turn: tuple[float, float]
) -> None:
    """By one of the two poses that its marker alone gives."""
    view, rotation = looking(position), pin.exp3(np.array([*turn, 0.0])) @ towards(yaw)
    at = pixels(view, rotation, position)
    found = {one.number: at[4 * k : 4 * k + 4] for k, one in enumerate(SEEN)}
    number = largest(found)
    marker = next(one for one in SEEN if one.number == number)
    starts = poses(view, marker, found[number])
    assert len(starts) in (1, 2)
    assert starts[0][0][2, 2] >= starts[-1][0][2, 2]
    fits = [one for start in starts if (one := fit(view, CORNERS, at, start, upright=False))]
    best = min(fits, key=lambda one: one.rms_px)
    assert best.position == pytest.approx(position, abs=1e-5)
    assert best.rotation == pytest.approx(rotation, abs=1e-4)


@pytest.mark.parametrize("upright", [True, False])
def test_the_covariance_is_honest(upright: bool) -> None:
    """Of 400 fits with independent errors of the corners 95 % are in the 95 % region, give or take
    3 %.
    """
    rng = np.random.default_rng(4)
    position, rotation = np.array([0.9, 0.1, 1.0]), towards(0.5)
    view = looking(position)
    at = pixels(view, rotation, position)
    limit, inside = 7.815, 0  # chi squared of three, 95 %
    for _ in range(400):
        noisy = at + rng.normal(0, 0.3, at.shape)
        found = fit(view, CORNERS, noisy, (rotation, position), upright=upright)
        assert found is not None
        off = found.position - position
        inside += off @ np.linalg.solve(found.covariance()[:3, :3], off) < limit
    assert 0.90 < inside / 400 < 0.98
    assert found.covariance().shape == ((4, 4) if upright else (6, 6))


def test_no_corner_is_believed_beyond_the_floor() -> None:
    """Corners that fit perfectly have the covariance of those that are off by the floor. One corner
    alone tells no pose.
    """
    position, rotation = np.array([0.9, 0.1, 1.0]), towards(0.0)
    view = looking(position)
    at = pixels(view, rotation, position)
    found = fit(view, CORNERS, at, (rotation, position), upright=True)
    assert found is not None
    assert found.covariance() == pytest.approx(FLOOR_PX**2 * found.spread)
    widest = np.linalg.eigvalsh(found.spread[:2, :2]).max()
    assert found.sideways() == pytest.approx(math.sqrt(widest))
    assert fit(view, CORNERS[:1], at[:1], (rotation, position), upright=True) is None
