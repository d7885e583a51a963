"""Approaches: what is found is a known grasp, reached freely, and takes the thing out of its
place.
"""

import math
from contextlib import suppress

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from velma import names
from velma.kinematics import ik
from velma.kinematics.collision import World
from velma.kinematics.frames import heading, shifted, standing, tilt
from velma.kinematics.robot import Robot
from velma.kinematics.shapes import Box
from velma.kinematics.tasks import attaching
from velma.kinematics.tasks.grasping import (
    AZIMUTH_SPREAD,
    LIFT_M,
    GraspWay,
    Target,
    approaches,
    grips,
)

angles = st.floats(-math.pi, math.pi)
JAR_M, JAR_RADIUS_M = 0.2, 0.04  # objects.yaml
BOARD_M, BOARD_DEEP_M = 0.02, 0.1
INTO_M = 0.004  # a step of the way out is 15 mm, the world's margin 6
# m: three axes within the tolerance of the inverse kinematics, 0.5 mm each, and of the line
NEAR = 1.5e-3


def same(a: pin.SE3, b: pin.SE3) -> bool:
    """Whether two poses agree as far as the inverse kinematics promises."""
    return bool(
        np.linalg.norm(a.translation - b.translation) < NEAR
        and np.linalg.norm(pin.log3(a.rotation.T @ b.rotation)) < 5e-3
    )


def found_again(taking, robot: Robot, world: World, seed: int = 1, target=None, **options):
    """Approaches from the start posture, with the chance of a seed."""
    q, rng = np.array(names.START), np.random.default_rng(seed)
    target = target or taking.target
    return approaches(robot, world, taking.side, q, target, taking.ways, rng, **options)


def test_some_are_found(taking) -> None:
    """In the canonical scene both things can be taken; the most comfortable comes first."""
    assert len(taking.found) == 3
    scores = [approach.score for approach in taking.found]
    assert scores == sorted(scores, reverse=True)


def test_each_is_a_known_grasp_turned_about_the_axis(taking) -> None:
    """Seen from the thing, every step is the published one but for a turn about the thing's own
    axis.
    """
    known = {way.name: way for way in taking.ways}
    for approach in taking.found:
        assert [f for _, f in approach.steps] == [f for _, f in known[approach.grasp].steps]
        pairs = zip(approach.steps, known[approach.grasp].steps, strict=True)
        turns = [found * published for (found, _), (published, _) in pairs]
        for turn in turns:
            assert turn.translation == pytest.approx(np.zeros(3), abs=1e-9)
            assert tilt(turn) == pytest.approx(0.0, abs=1e-6)
            assert same(turn, turns[0])


def test_the_way_in_leads_freely_through_the_steps(taking, robot: Robot, world: World) -> None:
    """It begins at the outermost step and ends at the grasp; only the arm moves. With the fingers
    open as at the grasp, nothing is touched but the thing itself, and that by the hand only. The
    arm can go on from both ends.
    """
    world.allow((taking.target.name, f"{taking.side}_hand"))
    for approach in taking.found:
        passed = [robot.grip(q, taking.side) for q in approach.way_in]
        for wanted, _ in approach.steps:
            assert any(same(taking.target.pose * wanted, grip) for grip in passed)
        assert same(passed[0], taking.target.pose * approach.steps[0][0])
        assert same(passed[-1], taking.target.pose * approach.steps[-1][0])
        still = np.setdiff1d(np.arange(15), names.ARM[taking.side])
        for q in (*approach.way_in, *approach.way_out):
            assert (q[still] == approach.way_in[0][still]).all()
            other = np.setdiff1d(still, [names.TORSO])
            assert (q[other] == names.START[other]).all()
        world.fingers(taking.side, approach.steps[-1][1])
        assert all(world.free(q) for q in approach.way_in)
        assert ik.comfortable(robot, approach.way_in[0], taking.side)
        assert ik.comfortable(robot, approach.way_out[-1], taking.side)


def test_the_way_out_lifts_and_pulls(taking, robot: Robot, world: World) -> None:
    """The thing goes up, then along `out` to its distance, and keeps its orientation. The lift
    itself leaves what the thing stands on; from its end on all is free.
    """
    lifted = taking.target.pose.translation[2] + LIFT_M - NEAR
    up = shifted(taking.target.pose, [0.0, 0.0, LIFT_M])
    for approach in taking.found:
        poses = [robot.grip(q, taking.side) * taking.held(approach) for q in approach.way_out]
        assert same(poses[0], taking.target.pose)
        assert any(same(pose, up) for pose in poses)
        assert same(poses[-1], shifted(up, taking.target.out * taking.target.distance))
        assert all(tilt(pose) < 5e-3 for pose in poses)
        world.fingers(taking.side, approach.steps[-1][1])
        with attaching.held(world, taking.target.name, taking.side, taking.held(approach)):
            pairs = zip(approach.way_out, poses, strict=True)
            free = [world.free(q) for q, pose in pairs if pose.translation[2] > lifted]
        assert all(free)
        assert len(free) > 5


@pytest.mark.parametrize(("above", "free"), [(-0.01, False), (0.02, True)])
def test_a_jar_that_meets_something_once_lifted_is_not_taken(
    jar, robot: Robot, world: World, above, free
) -> None:
    """A board behind the jar and higher than it, into whose edge the lift leads, and nothing before
    or after it.
    """
    behind = standing(np.zeros(3), heading(jar.target.out))
    top = np.add(jar.target.pose.translation, (0.0, 0.0, LIFT_M + JAR_M / 2 + BOARD_M / 2 + above))
    at = top - jar.target.out * (JAR_RADIUS_M - INTO_M + BOARD_DEEP_M / 2)
    behind.translation = at
    world.put("board", [Box((BOARD_DEEP_M, 0.4, BOARD_M))], behind)
    assert bool(found_again(jar, robot, world, wanted=1)) is free


def test_the_same_chance_gives_the_same_approaches(taking, robot: Robot, world: World) -> None:
    """The random source decides, nothing else."""
    again = found_again(taking, robot, world, wanted=3)
    assert [a.grasp for a in again] == [a.grasp for a in taking.found]
    for a, b in zip(again, taking.found, strict=True):
        assert (a.way_in[-1] == b.way_in[-1]).all()


def test_the_thing_stands_where_it_stood(taking, robot: Robot, world: World) -> None:
    """Whether grasps are found or not, the world is afterwards as it was."""
    name, before = taking.target.name, taking.target.pose.copy()
    far = Target(name, standing((5.0, 0.0, 1.0)), True, np.array([-1.0, 0.0, 0.0]), 0.2)
    for target in (taking.target, far):
        found = found_again(taking, robot, world, 2, target, wanted=1, tries=60)
        assert bool(found) is (target is taking.target)
        assert world.held(name) is None
        assert world.pose(name) == before
        touching = {a for a, b, _ in world.touching(taking.found[0].way_in[-1]) if b == name}
        assert touching, "the hand at the grasp counts as touching again"


def outwards(azimuth: float) -> np.ndarray:
    """A horizontal unit direction."""
    return np.array([math.cos(azimuth), math.sin(azimuth), 0.0])


TURNED = pin.SE3(pin.rpy.rpyToMatrix(0.0, math.pi / 2, 0.0), np.zeros(3))
WAY = GraspWay("g", ((standing((0.0, 0.1, 0.3)) * TURNED, 0.5),))


@given(yaw=angles, out=angles, azimuth=st.floats(-1.0, 1.0))
def test_a_symmetric_thing_is_grasped_from_where_it_is_open(
    yaw: float, out: float, azimuth: float
) -> None:
    """However it stands, the hand comes against `out`, turned by the azimuth."""
    target = Target("x", standing((0.8, 0.3, 1.0), yaw), True, outwards(out), 0.2)
    found = grips(target, WAY, azimuth)
    assert found is not None
    came = heading(found[-1].rotation[:, 2])
    assert math.remainder(came - (out + math.pi + azimuth), math.tau) == pytest.approx(
        0.0, abs=1e-6
    )
    assert np.linalg.norm(found[-1].translation - target.pose.translation) == pytest.approx(
        math.hypot(0.1, 0.3)
    )


@given(yaw=angles, out=angles, azimuth=st.floats(-1.0, 1.0))
def test_a_thing_with_sides_is_grasped_as_it_stands_or_not_at_all(
    yaw: float, out: float, azimuth: float
) -> None:
    """Its grasps are not turned about it: only those that come roughly against `out` are taken."""
    target = Target("x", standing((0.8, 0.3, 1.0), yaw), False, outwards(out), 0.2)
    own = target.pose * WAY.steps[-1][0].inverse()
    off = abs(math.remainder(heading(own.rotation[:, 2]) - (out + math.pi), math.tau))
    found = grips(target, WAY, azimuth)
    if off > 2 * AZIMUTH_SPREAD + 1e-9:
        assert found is None
    elif off < 2 * AZIMUTH_SPREAD - 1e-9:
        assert found is not None
        assert found[-1] == own


class Stop(Exception):
    """Raised in the middle."""


def test_what_was_tried_is_undone_also_after_an_error(world: World, jar, robot: Robot) -> None:
    """A thing held for a while stands again, one put down for a while is held again, contacts are
    contacts.
    """
    stood, held, approach = world.pose("jar_1"), jar.held(jar.found[0]), jar.found[0]
    grasp = approach.way_in[-1]
    world.fingers("left", approach.steps[-1][1])
    assert not world.free(grasp)
    with suppress(Stop), attaching.held(world, "jar_1", "left", held):
        assert world.held("jar_1") == held
        raise Stop
    assert world.held("jar_1") is None
    assert world.pose("jar_1") == stood
    with suppress(Stop), attaching.allowed(world, ("jar_1", "left_hand")):
        assert world.free(grasp)
        raise Stop
    assert not world.free(grasp)
    world.attach("jar_1", "left", held)
    with suppress(Stop), attaching.stood(world, "jar_1", standing((3.0, 0.0, 1.0)), "left"):
        assert world.held("jar_1") is None
        raise Stop
    assert world.held("jar_1") == held


def test_what_was_allowed_before_is_allowed_after(world: World, jar) -> None:
    """An exception within another one does not end that one."""
    approach = jar.found[0]
    world.fingers("left", approach.steps[-1][1])
    with attaching.allowed(world, ("jar_1", "left_hand")):
        with attaching.allowed(world, ("bowl_1", "left_hand")):
            pass
        assert world.free(approach.way_in[-1])
    assert not world.free(approach.way_in[-1])
