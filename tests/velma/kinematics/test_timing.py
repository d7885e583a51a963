"""Timed paths: limits held, none faster, path followed, ends exact and at rest, nothing lost
between the knots.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from velma import names
from velma.kinematics import timing
from velma.kinematics.robot import Robot
from velma.kinematics.timing import Spline

TOOL_SPEED = 0.35
# Rows of seed of `_varied`, tool speed [m/s] and duration [s] that toppra 0.6.10 found, before the
# moving average.
TOPPRA = json.loads((Path(__file__).parent / "toppra_durations.json").read_text())


def _path(seed: int, corners: int) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    ways = np.cumsum(rng.normal(0.0, 0.3, (corners, 15)), axis=0)
    return [
        np.array(names.START),
        *np.clip(names.START + ways, names.LOWER + 0.05, names.UPPER - 0.05),
    ]


def _varied(seed: int) -> list[np.ndarray]:
    """A path of one of three kinds: straight or with 3 to 5 corners for the left arm, with corners
    for all joints.
    """
    rng, kind = np.random.RandomState(seed), ("straight", "corners", "body")[seed % 3]
    ways = rng.normal(0.0, 0.5, (1 if kind == "straight" else int(rng.randint(3, 6)), 15))
    if kind != "body":
        ways[:, np.setdiff1d(np.arange(15), names.ARM["left"])] = 0.0
    points = names.START + np.cumsum(ways, axis=0)
    return [np.array(names.START), *np.clip(points, names.LOWER + 0.05, names.UPPER - 0.05)]


def _grip_speed(robot: Robot, trajectory: timing.Trajectory) -> float:
    tracks = [robot.chain[side].track(trajectory.q) for side in names.SIDES]
    ways = [np.linalg.norm(np.diff(track, axis=0), axis=1).max() for track in tracks]
    return float(max(ways)) / trajectory.dt


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000), corners=st.integers(1, 5))
def test_limits_hold_on_any_path(seed: int, corners: int) -> None:
    """Joints, accelerations and grips stay within limits, a little aside between grid points."""
    robot = Robot()
    found = timing.timed(robot, _path(seed, corners), tool_speed=TOOL_SPEED)
    assert np.all(np.abs(found.v) <= timing.JOINT_FRACTION * robot.speed * 1.05)
    assert np.all(np.abs(np.diff(found.v, axis=0)) / found.dt <= timing.ACCELERATION * 1.2)
    assert _grip_speed(robot, found) <= TOOL_SPEED * 1.05


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000), corners=st.integers(1, 5))
def test_the_path_is_followed(seed: int, corners: int) -> None:
    """Each knot lies within 0.02 rad of the path, and each point of the path is passed as near."""
    path = _path(seed, corners)
    found = timing.timed(Robot(), path, tool_speed=TOOL_SPEED)
    on_path = timing.dense(path, 0.005)
    apart = np.abs(found.q[:, None] - on_path).max(axis=2)
    assert apart.min(axis=1).max() < 0.02
    assert apart.min(axis=0).max() < 0.02


@pytest.mark.parametrize("plain", [False, True], ids=["in C", "plain"])
def test_durations_are_those_of_toppra(plain: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 60 recorded paths: the average adds its own width, and the last period is a whole one."""
    if plain:
        monkeypatch.setattr(timing, "library", lambda: None)
    elif timing.library() is None:
        pytest.skip("needs velma.compiled (Debian: apt install gcc libc6-dev)")
    robot, averaged = Robot(), 0.09
    for seed, tool_speed, duration in TOPPRA:
        found = timing.timed(robot, _varied(seed), tool_speed=tool_speed).duration - averaged
        assert abs(found - duration) <= timing.PERIOD_S, (seed, found, duration)


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 10_000), corners=st.integers(1, 4), size=st.sampled_from([1e-3, 0.1, 1.0])
)
def test_no_motion_along_the_path_is_faster(seed: int, corners: int, size: float) -> None:
    """At every grid point the squared speed is within all limits, and one of them forbids a larger
    one.
    """
    rng = np.random.default_rng(seed)
    points = timing.dense(size * np.cumsum(rng.normal(0.0, 0.3, (corners + 1, 15)), axis=0))
    along = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))))
    grid = np.linspace(0.0, along[-1], max(4 * len(points), 50))
    _, first, second = Spline(along, points).at(grid)
    largest = rng.uniform(0.05, 2.0, len(grid)) ** 2
    x = timing.path_speeds(first, second, timing.ACCELERATION, np.diff(grid), largest)
    assert x[0] == x[-1] == 0.0
    u = np.diff(x)[:, None] / (2.0 * np.diff(grid)[:, None])
    begins = np.abs(first[:-1] * u + second[:-1] * x[:-1, None]) / timing.ACCELERATION
    ends = np.abs(first[1:] * u + second[1:] * x[1:, None]) / timing.ACCELERATION
    used = np.maximum(begins, ends).max(axis=1)  # of each interval
    assert (x <= largest * (1 + 1e-9)).all()
    assert used.max() <= 1 + 1e-6
    at_a_limit = np.maximum(x[1:-1] / largest[1:-1], np.maximum(used[:-1], used[1:]))
    assert at_a_limit.min() >= 1 - 1e-6


def test_ends_are_exact_and_speeds_are_the_derivative(robot: Robot) -> None:
    """First and last knot are the path's ends, to the last bit, with no speed. Positions change
    between knots by the mean speed there.
    """
    path = _path(3, 3)
    found = timing.timed(robot, path, tool_speed=TOOL_SPEED)
    np.testing.assert_array_equal(found.q[[0, -1]], [path[0], path[-1]])
    assert np.abs(found.v[[0, -1]]).max() < 1e-12
    mean = (found.v[1:] + found.v[:-1]) / 2
    assert np.abs(np.diff(found.q, axis=0) / found.dt - mean).max() < 2e-3


def test_short_paths_are_timed(robot: Robot) -> None:
    """Also a path far shorter than the rounding of the speeds gets from end to end. A repeated
    point is one point, which takes no time: a trajectory of one knot at rest.
    """
    start = np.array(names.START)
    for way in (1e-6, 1e-4, 1e-2):
        goal = start + way * (np.arange(15) == 5)
        found = timing.timed(robot, [start, goal], tool_speed=TOOL_SPEED)
        np.testing.assert_array_equal(found.q[-1], goal)
        assert 0.0 < found.duration < 1.0
    found = timing.timed(robot, [start, start, start], tool_speed=TOOL_SPEED)
    assert found.duration == 0.0
    np.testing.assert_array_equal(found.at(1.0)[0], start)


def test_between_knots_it_is_interpolated(robot: Robot) -> None:
    """At a knot the knot is returned, between two their mean, outside the ends."""
    found = timing.timed(robot, _path(6, 1), tool_speed=TOOL_SPEED)
    q, v = found.at(10 * found.dt)
    np.testing.assert_allclose(q, found.q[10], atol=1e-12)
    np.testing.assert_allclose(v, found.v[10], atol=1e-12)
    between = found.at(10.5 * found.dt)[0]
    np.testing.assert_allclose(between, (found.q[10] + found.q[11]) / 2, atol=1e-12)
    np.testing.assert_array_equal(found.at(-1.0)[0], found.q[0])
    np.testing.assert_array_equal(found.at(found.duration + 1.0)[0], found.q[-1])


# --- Cubic splines: through the points, smooth, exact for cubics ----------------------------------


places = st.lists(st.floats(0.05, 2.0), min_size=1, max_size=12).map(
    lambda gaps: np.cumsum([0.0, *gaps])
)


@given(places, st.integers(0, 10_000))
def test_it_passes_the_points(at: np.ndarray, seed: int) -> None:
    """At each place its point."""
    points = np.random.default_rng(seed).normal(size=(len(at), 3))
    np.testing.assert_allclose(Spline(at, points).at(at)[0], points, atol=1e-9)


@given(places, st.integers(0, 10_000))
def test_it_is_smooth(at: np.ndarray, seed: int) -> None:
    """Just before and at a knot: the same value and derivatives."""
    spline = Spline(at, np.random.default_rng(seed).normal(size=(len(at), 3)))
    pairs = zip(spline.at(np.nextafter(at[1:-1], 0.0)), spline.at(at[1:-1]), strict=True)
    for before, there in pairs:
        near = 1e-6 * max(1.0, np.abs(there).max(initial=0.0))
        np.testing.assert_allclose(before, there, rtol=1e-6, atol=near)


@given(places, st.integers(0, 10_000))
def test_a_cubic_is_reproduced(at: np.ndarray, seed: int) -> None:
    """Of 2 points the line, of 3 the parabola, of more the cubic through them, with its
    derivatives.
    """
    degree = min(len(at) - 1, 3)
    curve = np.polynomial.Polynomial(np.random.default_rng(seed).normal(size=degree + 1))
    between = np.linspace(at[0], at[-1], 33)
    found = Spline(at, curve(at)[:, None]).at(between)
    for one, order in zip(found, range(3), strict=True):
        expected = curve.deriv(order)(between) if order else curve(between)
        near = 1e-6 * max(1.0, np.abs(expected).max())
        np.testing.assert_allclose(one[:, 0], expected, rtol=1e-6, atol=near)
