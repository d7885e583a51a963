"""What runs in C gives the results of the plain code, on any posture, target and world."""

from collections.abc import Callable
from typing import Any

import coal
import msgspec
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from velma import compiled, names
from velma.control import cartesian, grip, law
from velma.control.cartesian import CartesianImpedance, task_damping
from velma.control.dynamics import Dynamics
from velma.control.grip import Wrists
from velma.kinematics import chain, ik, near, timing
from velma.kinematics.collision import World
from velma.kinematics.frames import standing
from velma.kinematics.robot import ROBOT_XML, Robot
from velma.kinematics.shapes import Box, Cylinder, Sphere
from velma.kinematics.spline import Spline

pytestmark = pytest.mark.skipif(
    compiled.library() is None,
    reason="needs velma.compiled (Debian: apt install gcc libc6-dev, then .venv/bin/python -m velma.compiled)",
)
MANY = settings(max_examples=60, deadline=None, phases=(Phase.explicit, Phase.generate))

seeds = st.integers(0, 2**32 - 1)
sides = st.sampled_from(names.SIDES)
poses = st.builds(
    lambda x, y, z, yaw: standing((x, y, z), yaw),
    st.floats(0.2, 1.0),
    st.floats(-0.8, 0.8),
    st.floats(0.4, 1.6),
    st.floats(-3.0, 3.0),
)
sizes = st.floats(0.02, 0.4)
shapes = st.one_of(
    st.builds(Sphere, sizes), st.builds(Cylinder, sizes, sizes), st.builds(Box, st.tuples(sizes, sizes, sizes))
)
things = st.lists(st.tuples(shapes, poses, st.sampled_from(["furniture", "object"])), min_size=1, max_size=5)


def without(module: object, make: Callable[[], Any]) -> Any:
    """What `make` returns when the module finds no library."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "library", lambda: None)
        return make()


def plain_robot() -> Robot:
    """A robot whose chains run by Pinocchio."""
    robot: Robot = without(chain, Robot)
    return robot


ROBOT, PLAIN, DYNAMICS = Robot(), plain_robot(), Dynamics(ROBOT_XML)


def postures(seed: int, count: int) -> np.ndarray:
    """Postures (count, 15) within limits: some anywhere, the others near the start."""
    rng = np.random.default_rng(seed)
    anywhere = rng.uniform(names.LOWER, names.UPPER, (count, 15))
    share = rng.choice([0.02, 0.2, 1.0], (count, 1))
    return np.clip(names.START + share * (anywhere - names.START), names.LOWER, names.UPPER)


def test_they_are_compared_with_something_else() -> None:
    """The one robot has chains in C, the other none."""
    assert all(ROBOT.chain.values())
    assert not any(PLAIN.chain.values())


@MANY
@given(seeds, sides)
def test_tracks_are_the_same(seed, side):
    """To rounding."""
    q = postures(seed, 20)
    np.testing.assert_allclose(ROBOT.track(q, side), PLAIN.track(q, side), atol=1e-12)


@MANY
@given(seeds, st.integers(1, 4), st.sampled_from([1e-4, 0.02, 0.5]))
def test_path_speeds_are_the_same(seed, corners, size):
    """To the last bit, for paths that stand still in some joints and turn back in others."""
    rng = np.random.default_rng(seed)
    ways = rng.normal(0.0, size, (corners, 15)) * (rng.random(15) < 0.7) + 1e-9 * (rng.random() < 0.5)
    points = timing.dense(np.cumsum(np.concatenate((np.zeros((1, 15)), ways, -ways[-1:])), axis=0))
    if len(points) < 2:
        return
    along = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))))
    grid = np.linspace(0.0, along[-1], 4 * len(points))
    _, first, second = Spline(along, points).at(grid)
    given_all = first, second, timing.ACCELERATION, np.diff(grid), rng.uniform(0.0025, 4.0, len(grid))
    expected = without(timing, lambda: timing.path_speeds(*given_all))
    np.testing.assert_array_equal(timing.path_speeds(*given_all), expected)


@MANY
@given(seeds, sides, st.booleans(), st.sampled_from([0.02, 0.3, 3.0]))
def test_solutions_are_the_same(seed, side, arm_only, far):
    """Of near and far targets, reached or not, the grip turned by up to half a turn."""
    rng, (start,) = np.random.default_rng(seed), postures(seed, 1)
    goal = PLAIN.grip(np.clip(start + rng.normal(0.0, far, 15), names.LOWER, names.UPPER), side)
    columns = names.ARM[side] if arm_only else None
    ours = ik.solve(ROBOT, side, goal, start, columns=columns)
    theirs = ik.solve(PLAIN, side, goal, start, columns=columns)
    assert (ours is None) == (theirs is None)
    if ours is not None:
        np.testing.assert_allclose(ours, theirs, atol=1e-7)


@MANY
@given(seeds, sides)
def test_half_a_turn_has_an_axis(seed, side):
    """A target turned by 180 degrees about any axis: what is claimed is reached."""
    axis = np.random.default_rng(seed).normal(size=3) ** 3
    here = PLAIN.grip(np.array(names.START), side)
    half = pin.exp3(axis / np.linalg.norm(axis) * (np.pi - 1e-9))
    goal = pin.SE3(half @ here.rotation, here.translation)
    found = ik.solve(ROBOT, side, goal, np.array(names.START), iterations=200)
    if found is not None:
        assert np.abs(pin.log6(goal.actInv(PLAIN.grip(found, side))).vector).max() < 0.005


def worlds(some: list, held: str | None, allowed: bool, margin: float) -> tuple[World, World]:
    """Two worlds with the same things, the first compiled."""
    both = World(ROBOT), World(ROBOT)
    for world in both:
        for number, (shape, pose, kind) in enumerate(some):
            world.put(f"thing {number}", [shape], pose, kind)
        world.margin = margin
        if held:
            world.attach("thing 0", held, standing((0.0, 0.0, 0.05)))
        if allowed:
            world.allow(("thing 0", "thing 1"), ("robot", "thing 0"))
    without(near, lambda: both[1].free(np.array(names.START)))
    return both


@MANY
@given(things, seeds, st.sampled_from([None, *names.SIDES]), st.booleans(), st.sampled_from([0.0, 0.006, 0.05]))
def test_verdicts_are_the_same(some, seed, held, allowed, margin):
    """With things in hands, allowed pairs and any margin; again after things were let go of."""
    ours, theirs = worlds(some, held, allowed, margin)
    for q in postures(seed, 30):
        assert ours.free(q) == theirs.free(q), ours.touching(q)
    assert (ours._near is None, theirs._near is None) == (False, True)
    if held:
        for world in (ours, theirs):
            world.detach("thing 0", standing((0.7, 0.0, 0.9)))
    for q in postures(seed + 1, 10):
        assert ours.free(q) == theirs.free(q), ours.touching(q)


@MANY
@given(things, seeds, st.sampled_from([0.0, 0.006, 0.05]))
def test_pairs_have_the_verdicts_of_coal(some, seed, margin):
    """Each pair of a shape of the robot and of a thing by itself: decided rightly, or left to the exact check."""
    world, _ = worlds(some, None, False, margin)
    for q in postures(seed, 2):
        world.free(q)
        shapes, placed, groups = world._shapes, world._placed, np.array(world._groups)
        first, second = world._numbered
        for number in np.flatnonzero(world._pairs[first, second] & (groups[second] == "thing 0")):
            one = np.zeros(len(first), dtype=bool)
            one[number] = True
            left = world._near.among(one).left(margin)
            meets = pin.computeCollision(shapes, placed, int(number))
            kinds = {type(shapes.geometryObjects[int(k[number])].geometry) for k in (first, second)}
            if coal.Cylinder in kinds or kinds == {coal.Box}:
                assert left == [number] or not (left or meets)
            else:
                assert left == (None if meets else [])


@MANY
@given(seeds, st.integers(0, 2), st.floats(0.5, 1.5).filter(lambda share: abs(share - 1.0) > 1e-6))
def test_a_gap_within_the_margin_is_found(seed, axis, share):
    """A ball beside each ball of the robot, along an axis of the world, `share` of the margin away."""
    margin, radius = 0.05, 0.03
    world, _ = worlds([(Sphere(radius), standing((0.0, 0.0, 5.0)), "object")], None, False, margin)
    (q,) = postures(seed, 1)
    world.free(q)
    first, second = world._numbered
    for number in np.flatnonzero(world._pairs[first, second] & (np.array(world._groups)[second] == "thing 0"))[:40]:
        ball = world._shapes.geometryObjects[int(first[number])].geometry
        if not isinstance(ball, coal.Sphere):
            continue
        away = world._placed.oMg[int(first[number])].translation.copy()
        away[axis] += ball.radius + radius + share * margin
        world.put("thing 0", [Sphere(radius)], standing(away), "object")
        world.free(q)
        one = np.zeros(len(first), dtype=bool)
        one[number] = True
        assert world._near.among(one).left(margin) == (None if share < 1.0 else [])


@MANY
@given(seeds, st.booleans())
def test_torques_are_the_same(seed, some_weight):
    """At any posture, for any errors, over the cycles between two damping designs, to rounding of the inverses."""
    rng, ours, theirs = np.random.default_rng(seed), CartesianImpedance(), without(law, CartesianImpedance)
    assert (ours._law is None, theirs._law is None) == (False, True)
    for q in postures(seed, 6):
        terms = DYNAMICS.terms(q)
        error, slip, stray, wrench = (rng.normal(0.0, s, n) for s, n in ((0.1, 12), (0.3, 15), (0.1, 15), (5.0, 12)))
        acting = error, slip, stray, wrench * some_weight
        expected = theirs.torque(terms, *acting)
        np.testing.assert_allclose(ours.torque(terms, *acting), expected, atol=1e-9 * np.abs(expected).max())


@MANY
@given(seeds, st.sampled_from([1e-3, 1.0, 1e3]), st.floats(0.05, 2.0))
def test_dampings_are_the_same(seed, scale, ratio):
    """Of any inertia and stiffness, also far from those of hands."""
    rng = np.random.default_rng(seed)
    root = rng.normal(0.0, scale, (12, 12))
    ours, stiffness = CartesianImpedance()._law, rng.uniform(1.0, 2000.0, 6)
    assert ours is not None
    inertia = root @ root.T + 1e-3 * scale**2 * np.eye(12)
    ours.set(inertia=inertia, stiffness=np.tile(stiffness, 2), twice_ratio=2.0 * ratio)
    expected = task_damping(inertia, stiffness, ratio)
    np.testing.assert_allclose(ours.damping(), expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())


@MANY
@given(seeds, st.sampled_from([0.0, 1e-9, 1e-3, 1.0, np.pi - 1e-9, np.pi]))
def test_errors_are_the_same(seed, angle):
    """Of hands anywhere, turned by this angle to their goals: no turn and half a turn, too."""
    rng, ours = np.random.default_rng(seed), cartesian.error()
    assert ours is not cartesian.task_error
    axes = rng.normal(size=(2, 3)) ** 3
    here = np.stack([pin.exp3(rng.normal(size=3)) for _ in range(2)])
    goal = np.stack([pin.exp3(angle * a / np.linalg.norm(a)) @ r for a, r in zip(axes, here, strict=True)])
    terms = msgspec.structs.replace(DYNAMICS.terms(np.array(names.START)), rotation=here)
    at = rng.normal(size=(2, 3))
    found, expected = ours(terms, goal, at), cartesian.task_error(terms, goal, at)
    if angle == np.pi:  # the sign of the axis is arbitrary
        turns = [pin.exp3(e[k : k + 3]) for e in (found, expected) for k in (3, 9)]
        np.testing.assert_allclose(turns[:2], turns[2:], atol=1e-7)
    else:
        np.testing.assert_allclose(found, expected, atol=1e-12)


@MANY
@given(seeds, st.integers(1, 80), st.lists(st.integers(0, 79), max_size=2))
def test_wrists_feel_the_same(seed, cycles, restarts):
    """Over many cycles of any readings, with restarts; what they keep is the same, too."""
    rng, ours, theirs = np.random.default_rng(seed), Wrists(0.002), without(grip, lambda: Wrists(0.002))
    assert (ours._feel is None, theirs._feel is None) == (False, True)
    for k in range(cycles):
        rotation = np.stack([pin.exp3(rng.normal(size=3)) for _ in range(2)])
        reading = rng.normal(0.0, 5.0, (2, 6)), rotation, rng.normal(0.0, 1e-3, (2, 3))
        np.testing.assert_allclose(ours.feel(*reading), theirs.feel(*reading), atol=1e-9)
        if k in restarts:
            ours.restart(), theirs.restart()
    for name, part in ours.record.part.items():
        np.testing.assert_allclose(part, theirs.record.part[name], atol=1e-9, err_msg=name)


def test_a_mass_that_is_none_is_an_error_in_both():
    """Of the same type: the loop brakes then."""
    terms = msgspec.structs.replace(DYNAMICS.terms(np.array(names.START)), mass=np.zeros((15, 15)))
    for one in (CartesianImpedance(), without(law, CartesianImpedance)):
        with pytest.raises(np.linalg.LinAlgError):
            one.torque(terms, np.zeros(12), np.zeros(15), np.zeros(15), np.zeros(12))
