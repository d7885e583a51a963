"""What runs in C gives the results of the plain code, on any posture, target and world."""

import ctypes
from collections.abc import Callable
from typing import Any

import coal
import msgspec
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st

from velma import compiled, names
from velma.control import cartesian, grip
from velma.control.cartesian import CartesianImpedance, task_damping
from velma.control.dynamics import Dynamics
from velma.control.grip import Wrists
from velma.kinematics import collision, ik, robot, timing
from velma.kinematics.collision import Near, PlainChecks, World
from velma.kinematics.frames import standing
from velma.kinematics.ik import ArmGeometry
from velma.kinematics.robot import ROBOT_XML, Robot
from velma.kinematics.shapes import Box, Cylinder, Sphere, nearer
from velma.kinematics.timing import Spline

pytestmark = pytest.mark.skipif(
    compiled.library() is None,
    reason=(
        "needs velma.compiled (Debian: apt install gcc libc6-dev, then .venv/bin/python -m"
        " velma.compiled)"
    ),
)
MANY = settings(max_examples=60, deadline=None, phases=(Phase.explicit, Phase.generate))

seeds = st.integers(0, 2**32 - 1)
sides = st.sampled_from(names.SIDES)
poses = st.builds(
    lambda x, y, z, yaw: standing((x, y, z), yaw),
    *(st.floats(*ends) for ends in ((0.2, 1.0), (-0.8, 0.8), (0.4, 1.6), (-3.0, 3.0))),
)
sizes = st.floats(0.02, 0.4)
solids = (st.builds(Sphere, sizes), st.builds(Cylinder, sizes, sizes))
shapes = st.one_of(*solids, st.builds(Box, st.tuples(sizes, sizes, sizes)))
kinds = st.sampled_from(["furniture", "object"])
things = st.lists(st.tuples(shapes, poses, kinds), min_size=1, max_size=5)


def without(module: object, make: Callable[[], Any]) -> Any:
    """What `make` returns when the module finds no library."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "library", lambda: None)
        return make()


def plain_robot() -> Robot:
    """A robot whose chains run by Pinocchio."""
    made: Robot = without(robot, Robot)
    return made


ROBOT, PLAIN, DYNAMICS = Robot(), plain_robot(), Dynamics(ROBOT_XML)
ARMS = {side: ArmGeometry(ROBOT, side) for side in names.SIDES}
PLAIN_ARMS = {side: without(ik, lambda side=side: ArmGeometry(ROBOT, side)) for side in names.SIDES}


def postures(seed: int, count: int) -> np.ndarray:
    """Postures (count, 15) within limits: some anywhere, the others near the start."""
    rng = np.random.default_rng(seed)
    anywhere = rng.uniform(names.LOWER, names.UPPER, (count, 15))
    share = rng.choice([0.02, 0.2, 1.0], (count, 1))
    return np.clip(names.START + share * (anywhere - names.START), names.LOWER, names.UPPER)


def test_they_are_compared_with_something_else() -> None:
    """The one robot has chains in C, the other none."""
    assert {type(one) for one in ROBOT.chain.values()} == {robot.Chain}
    assert {type(one) for one in PLAIN.chain.values()} == {robot.PlainChain}


@MANY
@given(seeds, sides, st.sampled_from([0.05, 0.25, 2.0]))
def test_tracks_upward_parts_and_times_are_the_same(seed, side, tool_speed):
    """To rounding: places, the upward part of any direction fixed to a grip, and how long steps
    take, whether the tool or a joint needs longer; no step takes none.
    """
    q, direction = postures(seed, 20), np.random.default_rng(seed).normal(size=3)
    columns, speed = names.COLUMNS[side], 0.5 * names.SPEED[names.COLUMNS[side]]
    ours, theirs = ROBOT.chain[side], PLAIN.chain[side]
    for some in (q, q[:1]):
        np.testing.assert_allclose(ours.track(some), theirs.track(some), atol=1e-12)
        parts = (one.upward(direction)(some) for one in (ours, theirs))
        np.testing.assert_allclose(*parts, atol=1e-12)
        step = names.START, some[:, columns], columns, tool_speed, speed
        np.testing.assert_allclose(ours.times(*step), theirs.times(*step), rtol=1e-9)


@MANY
@given(seeds, st.integers(1, 4), st.sampled_from([1e-4, 0.02, 0.5]))
def test_path_speeds_are_the_same(seed, corners, size):
    """To the last bit, for paths that stand still in some joints and turn back in others."""
    rng = np.random.default_rng(seed)
    ways = rng.normal(0.0, size, (corners, 15)) * (rng.random(15) < 0.7) + 1e-9 * (
        rng.random() < 0.5
    )
    points = timing.dense(np.cumsum(np.concatenate((np.zeros((1, 15)), ways, -ways[-1:])), axis=0))
    if len(points) < 2:
        return
    along = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))))
    grid = np.linspace(0.0, along[-1], 4 * len(points))
    _, first, second = Spline(along, points).at(grid)
    largest = rng.uniform(0.0025, 4.0, len(grid))
    given_all = first, second, timing.ACCELERATION, np.diff(grid), largest
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


def followed(
    robot: Robot, side: str, start: np.ndarray, goal: Any
) -> tuple[list[np.ndarray], str, float]:
    """The postures of a line up to its end or where it is blocked, why, and how far it went."""
    accepted: list[np.ndarray] = []
    try:
        path = ik.line(robot, side, start, goal, accept=lambda q: accepted.append(q) or True)
    except ik.PathBlocked as blocked:
        return accepted, blocked.reason, blocked.fraction
    return path[1:], "", 1.0


@MANY
@given(seeds, sides, st.sampled_from([0.02, 0.2, 1.0]))
def test_lines_are_the_same(seed, side, far):
    """To near and far targets, to the end, out of reach, and where the elbow flips."""
    rng, (start,) = np.random.default_rng(seed), postures(seed, 1)
    goal = PLAIN.grip(np.clip(start + rng.normal(0.0, far, 15), names.LOWER, names.UPPER), side)
    (ours, *ended), (theirs, *expected) = (
        followed(robot, side, start, goal) for robot in (ROBOT, PLAIN)
    )
    assert ended == expected
    np.testing.assert_allclose(ours, theirs, atol=1e-6)


SQUARE = 9.0 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
ANYWHERE = np.full(7, -9.0), np.full(7, 9.0), 0.0, 99.0, SQUARE


def closed_forms(
    side: str, target: Any, torso: np.ndarray, swivel: np.ndarray, wanted: Any = None
) -> int:
    """Compare both closed forms, of all postures or those in which a motion may end; return how
    many there are.
    """
    q, columns = postures(0, 1)[0], names.COLUMNS[side]
    asked = wanted or ik.Wanted(*ANYWHERE, int(columns[1]))
    ours = ARMS[side].comfortable(target, torso, swivel, asked, q)
    found = PLAIN_ARMS[side].postures(target, torso, swivel)
    theirs = np.tile(q, (len(found), 1))
    theirs[:, columns] = found
    if wanted is not None:
        theirs = theirs[[ik.comfortable(ROBOT, one, side) for one in theirs]]
    assert len(ours) == len(theirs)
    turns = np.angle(np.exp(1j * (ours - theirs)))  # half a turn has two signs
    np.testing.assert_allclose(turns, 0.0, atol=1e-9)
    return len(ours)


@MANY
@given(seeds, sides, st.sampled_from([0.0, 0.3, 3.0]))
def test_closed_forms_are_the_same(seed, side, far):
    """Of four targets, with torsos as in a posture there and others: all, and those in which a
    motion may end.
    """
    rng = np.random.default_rng(seed)
    counts = []
    for q in postures(seed, 4):
        pairs = PLAIN.grip(q, side), q[0] + rng.normal(0.0, far, 24), rng.uniform(-np.pi, np.pi, 24)
        counts.append(closed_forms(side, *pairs))
        closed_forms(side, *pairs, ik._wanted(ROBOT, side))
    assert far > 0.0 or sum(counts) > 0


BESIDE = st.sampled_from([0.0, 1e-7, 1e-5, 0.2])
REACH = st.sampled_from([0.3, 1.0 - 1e-5, 1.0 - 1e-7, 1.0])


@MANY
@given(seeds, sides, BESIDE, REACH)
def test_closed_forms_agree_at_the_edge(seed, side, beside, reach):
    """The wrist beside the shoulder's axis by so many metres, at a share of the reach: where they
    branch.
    """
    rng, form = np.random.default_rng(seed), PLAIN_ARMS[side]
    away = reach * (form.upper + form.fore)
    way = np.array([beside, 0.0, np.sqrt(away**2 - beside**2)])
    torso = float(rng.uniform(-1.0, 1.0))
    turned = form.T_world_torso * standing(np.zeros(3), torso) * form.T_torso_shoulder
    wrist = pin.SE3(pin.exp3(rng.normal(size=3)), turned.act(way))
    target, swivel = wrist * form.T_grip_wrist.inverse(), rng.uniform(-np.pi, np.pi, 24)
    count = closed_forms(side, target, np.full(24, torso), swivel)
    assert count == (24 * 8 if reach < 1.0 - 1e-6 else 0)


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
    without(collision, lambda: both[1].free(np.array(names.START)))
    return both


holding, margins = st.sampled_from([None, *names.SIDES]), st.sampled_from([0.0, 0.006, 0.05])


@MANY
@given(things, seeds, holding, st.booleans(), margins)
def test_verdicts_and_what_touches_are_the_same(some, seed, held, allowed, margin):
    """With things in hands, allowed pairs and any margin; again after things were let go of. The
    same links and things touch at the same distances, nearest first, where it is not free.
    """
    ours, theirs = worlds(some, held, allowed, margin)
    for k, q in enumerate(postures(seed, 30)):
        assert ours.free(q) == theirs.free(q), ours.touching(q)
        if k < 5:
            found = ours.touching(q)
            expected = {(a, b): distance for a, b, distance in theirs.touching(q)}
            assert {(a, b): at for a, b, at in found} == pytest.approx(expected, abs=1e-9)
            assert [at for _, _, at in found] == sorted(at for _, _, at in found)
            assert ours.free(q) == (not found)
    assert (type(ours._checks), type(theirs._checks)) == (Near, PlainChecks)
    if held:
        for world in (ours, theirs):
            world.detach("thing 0", standing((0.7, 0.0, 0.9)))
    for q in postures(seed + 1, 10):
        assert ours.free(q) == theirs.free(q), ours.touching(q)


@settings(MANY, max_examples=20)
@given(things, seeds, st.sampled_from([None, *names.SIDES]), st.sampled_from([0.006, 0.05]))
def test_many_postures_have_the_verdicts_of_each(some, seed, held, margin):
    """The first one that is free, and whether all are, with as many checks as one after the
    other.
    """
    for world in worlds(some, held, False, margin):
        some_postures = postures(seed, 12)
        verdicts = [world.free(q) for q in some_postures]
        before = world.checks
        assert world.first_free(some_postures) == (verdicts.index(True) if any(verdicts) else None)
        assert world.checks - before == (verdicts.index(True) + 1 if any(verdicts) else 12)
        before = world.checks
        assert world.all_free(some_postures) == all(verdicts)
        assert world.checks - before == (12 if all(verdicts) else verdicts.index(False) + 1)


@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_an_angle_that_is_none_is_not_free(number: float) -> None:
    """Neither here nor there; the posture after it has its own verdict."""
    bad = np.array(names.START)
    bad[3] = number
    for world in worlds([(Sphere(0.1), standing((3.0, 0.0, 1.0)), "object")], None, False, 0.006):
        assert not world.free(bad)
        assert world.first_free(np.array([bad, names.START])) == 1


def left(world: World, number: int, q: np.ndarray) -> list[int] | None:
    """What C leaves of one pair: itself or nothing; None if it surely touches."""
    checks, one = world._checks, np.zeros(world._numbered.shape[1], dtype=bool)
    one[number] = True
    among, given = checks.among(one), np.array(q)
    q_at, found = given.ctypes.data, ctypes.byref(checks._left)
    checks._first(checks._itself, among.itself, world.margin, q_at, 1, 1, found)
    return None if checks._left.value < 0 else list(among.found[: checks._left.value])


def met(world: World, number: int) -> bool:
    """What coal says of a pair, as the shapes are placed."""
    a, b = (int(shape) for shape in world._numbered[:, number])
    checks = world._checks
    return nearer(checks.solids[a], checks.at(a), checks.solids[b], checks.at(b), world.margin)


@MANY
@given(things, seeds, st.sampled_from([0.0, 0.006, 0.05]))
def test_pairs_have_the_verdicts_of_coal(some, seed, margin):
    """Each pair of a shape of the robot and of a thing by itself: decided rightly, or left to the
    exact check.
    """
    world, _ = worlds(some, None, False, margin)
    for q in postures(seed, 2):
        world.free(q)
        first, second = world._numbered
        for number in np.flatnonzero(world._groups[second] == "thing 0"):
            found, meets = left(world, int(number), q), met(world, int(number))
            kinds = {type(world._checks.solids[int(k[number])]) for k in (first, second)}
            if coal.Cylinder in kinds or kinds == {coal.Box}:
                assert found == [number] or found == (None if meets else [])
            else:
                assert found == (None if meets else [])


@MANY
@given(seeds, st.integers(0, 2), st.floats(0.5, 1.5).filter(lambda share: abs(share - 1.0) > 1e-6))
def test_a_gap_within_the_margin_is_found(seed, axis, share):
    """A ball beside each ball of the robot, along an axis of the world, `share` of the margin
    away.
    """
    margin, radius = 0.05, 0.03
    world, _ = worlds([(Sphere(radius), standing((0.0, 0.0, 5.0)), "object")], None, False, margin)
    (q,) = postures(seed, 1)
    world.free(q)
    first, second = world._numbered
    for number in np.flatnonzero(world._groups[second] == "thing 0")[:40]:
        ball = world._checks.solids[int(first[number])]
        if not isinstance(ball, coal.Sphere):
            continue
        away = world._checks.at(int(first[number])).getTranslation().copy()
        away[axis] += ball.radius + radius + share * margin
        world.put("thing 0", [Sphere(radius)], standing(away), "object")
        assert left(world, int(number), q) == (None if share < 1.0 else [])


def apart(size: np.ndarray, other: np.ndarray, turn: np.ndarray, away: np.ndarray) -> float:
    """The widest gap [m] between the shadows of two boxes on an axis: they are at least so far
    apart.
    """
    axes = np.vstack((np.eye(3), turn.T, np.cross(np.eye(3)[:, None], turn.T[None]).reshape(9, 3)))
    lengths = np.linalg.norm(axes, axis=1)
    axes = axes[lengths > 1e-9] / lengths[lengths > 1e-9, None]
    shadows = np.abs(axes) @ size + np.abs(axes @ turn) @ other
    return float((np.abs(axes @ away) - shadows / 2).max())


@MANY
@example(1046893, 1e-4, 0.0)
@given(seeds, st.sampled_from([0.0, 1e-7, 1e-4, 0.5]), st.sampled_from([0.0, 0.006]))
def test_boxes_have_the_verdict_of_coal(seed, turned, margin):
    """Side by side with edges that are parallel, nearly or not at all, a little apart or into each
    other; and anyhow.

    coal says of boxes up to 1e-6 m apart that they touch; there, an axis with a gap shows that they
    do not.
    """
    rng, q, number = np.random.default_rng(seed), np.array(names.START), 0
    size, other = (rng.uniform(0.02, 0.6, 3) for _ in range(2))
    far = pin.SE3(pin.exp3(rng.normal(size=3)), np.array([0.0, 0.0, 9.0]))
    world, grip = World(ROBOT, margin), ROBOT.grip(q, "left").inverse()
    world.put("one", [Box(tuple(size))], far, "furniture")
    world.put("other", [Box(tuple(other))], far, "object")
    world.attach("other", "left", grip * far)
    world.free(q)
    (number,) = np.flatnonzero((world._groups[world._numbered] == [["one"], ["other"]]).all(axis=0))
    gaps = 10.0 ** rng.uniform(-5, -2, 20)
    for gap in (*gaps[:10], *-gaps[10:], *np.full(60, np.nan)):
        turn = pin.exp3(turned * rng.normal(size=3))
        away = rng.integers(-1, 2, 3) * ((size + np.abs(turn) @ other) / 2 + gap + margin)
        if np.isnan(gap):
            turn, away = pin.exp3(3.0 * rng.normal(size=3)), rng.normal(size=3)
            away *= rng.uniform(0.2, 0.6) * np.linalg.norm(size + other) / np.linalg.norm(away)
        world.attach("other", "left", grip * far * pin.SE3(turn, away))
        found = left(world, int(number), q)
        if found != [number]:
            meets = met(world, int(number)) and apart(size, other, turn, away) <= margin
            assert found == (None if meets else [])


@MANY
@given(seeds, st.booleans())
def test_torques_are_the_same(seed, some_weight):
    """At any posture, for any errors, over the cycles between two damping designs, to rounding of
    the inverses.
    """
    rng = np.random.default_rng(seed)
    ours, theirs = CartesianImpedance(), without(cartesian, CartesianImpedance)
    assert (ours._law is None, theirs._law is None) == (False, True)
    for q in postures(seed, 6):
        terms = DYNAMICS.terms(q)
        error, slip, stray, wrench = (
            rng.normal(0.0, s, n) for s, n in ((0.1, 12), (0.3, 15), (0.1, 15), (5.0, 12))
        )
        acting = error, slip, stray, wrench * some_weight
        expected = theirs.torque(terms, *acting)
        found = ours.torque(terms, *acting)
        np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())


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
    atol = 1e-9 * np.abs(expected).max()
    np.testing.assert_allclose(ours.damping(), expected, rtol=0.0, atol=atol)


@MANY
@given(seeds, st.sampled_from([0.0, 1e-9, 1e-3, 1.0, np.pi - 1e-9, np.pi]))
def test_errors_are_the_same(seed, angle):
    """Of hands anywhere, turned by this angle to their goals: no turn and half a turn, too."""
    rng, ours = np.random.default_rng(seed), cartesian.error()
    assert ours is not cartesian.task_error
    axes = rng.normal(size=(2, 3)) ** 3
    here = np.stack([pin.exp3(rng.normal(size=3)) for _ in range(2)])
    goal = np.stack(
        [pin.exp3(angle * a / np.linalg.norm(a)) @ r for a, r in zip(axes, here, strict=True)]
    )
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
    rng = np.random.default_rng(seed)
    ours = Wrists(0.002)
    theirs = without(grip, lambda: Wrists(0.002))
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
    for one in (CartesianImpedance(), without(cartesian, CartesianImpedance)):
        with pytest.raises(np.linalg.LinAlgError):
            one.torque(terms, np.zeros(12), np.zeros(15), np.zeros(15), np.zeros(12))
