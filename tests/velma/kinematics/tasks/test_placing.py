"""Putting down: upright, on the spot, and with a way back for the open hand."""

from collections.abc import Iterator
from itertools import islice, pairwise

import numpy as np
import pinocchio as pin
import pytest

from velma import names
from velma.kinematics import ik
from velma.kinematics.collision import World
from velma.kinematics.frames import shifted, standing, tilt
from velma.kinematics.robot import Robot
from velma.kinematics.tasks import attaching
from velma.kinematics.tasks.placing import (
    ABOVE_M,
    BACK_M,
    CLEARANCE_M,
    UP_M,
    Placing,
    backwards,
    placings,
    retreat_poses,
)

SPOT = np.array([0.58, -0.52, 0.775])  # where the trial runs put the bowl
SPOTS = [("table_1", SPOT)]
FAR = ("table_2", np.array([3.0, 0.0, 0.775]))
NEAR = 1.5e-3  # m: three axes within the tolerance of the inverse kinematics
Held = tuple[World, np.ndarray, pin.SE3]


def tried(robot: Robot, with_bowl: Held, bowl, spots=SPOTS, tries: int = 500) -> Iterator[Placing]:
    """Placings of the bowl in the right hand."""
    world, q, held = with_bowl
    retreat, rng = backwards(bowl.found[0].steps), np.random.default_rng(3)
    return placings(robot, world, "right", q, "bowl_1", held, spots, retreat, rng, tries=tries)


@pytest.fixture
def found(robot: Robot, with_bowl: Held, bowl) -> list[Placing]:
    """Three placings on the table."""
    return list(islice(tried(robot, with_bowl, bowl), 3))


def test_the_thing_comes_down_upright_on_the_spot(
    robot: Robot, with_bowl: Held, found: list[Placing]
) -> None:
    """From above, straight down, to just over the surface; torso and other arm stay."""
    held = with_bowl[2]
    assert len(found) == 3
    for placing in found:
        assert placing.support == "table_1"
        assert placing.place.translation == pytest.approx(SPOT + np.array([0.0, 0.0, CLEARANCE_M]))
        assert (placing.way_down[0] == placing.above).all()
        way = [robot.grip(q, "right") * held for q in placing.way_down]
        above = shifted(placing.place, [0.0, 0.0, ABOVE_M])
        assert way[0].translation == pytest.approx(above.translation, abs=NEAR)
        assert way[-1].translation == pytest.approx(placing.place.translation, abs=NEAR)
        assert all(tilt(pose) < 5e-3 for pose in way)
        assert all(np.linalg.norm((pose.translation - SPOT)[:2]) < NEAR for pose in way)
        assert all(a.translation[2] > b.translation[2] for a, b in pairwise(way))
        still = np.setdiff1d(np.arange(15), names.ARM["right"])
        for q in (*placing.way_down, *placing.way_back):
            assert (q[still] == placing.above[still]).all()


def test_the_way_down_touches_only_what_the_thing_ends_on(
    with_bowl: Held, found: list[Placing]
) -> None:
    """Its end may be nearer to the table than the margin."""
    world = with_bowl[0]
    with attaching.allowed(world, ("bowl_1", "table_1")):
        assert all(world.free(q) for placing in found for q in placing.way_down)
    assert all(world.free(placing.above) for placing in found)


def test_the_hand_gets_away(robot: Robot, with_bowl: Held, bowl, found: list[Placing]) -> None:
    """Back through the steps of the approach, then further back and up, freely, and clear of the
    thing in the end.
    """
    world = with_bowl[0]
    retreat = backwards(bowl.found[0].steps)
    for placing in found:
        assert (placing.way_back[0] == placing.way_down[-1]).all()
        grips = [robot.grip(q, "right") for q in placing.way_back]
        for step in bowl.found[0].steps:
            wanted = (placing.place * step[0]).translation
            assert min(np.linalg.norm(grip.translation - wanted) for grip in grips) < 2 * NEAR
        last = grips[0] * retreat[-1][0]
        end = shifted(last, np.array([0.0, 0.0, UP_M]) - BACK_M * last.rotation[:, 2])
        assert grips[-1].translation == pytest.approx(end.translation, abs=NEAR)
        world.fingers("right", retreat[0][1])
        with attaching.stood(world, "bowl_1", placing.place, "right"):
            assert world.free(placing.way_back[-1])
            with attaching.allowed(world, ("bowl_1", "right_hand")):
                assert all(world.free(q) for q in placing.way_back)
        assert ik.comfortable(robot, placing.way_back[-1], "right")


def test_the_thing_stays_in_the_hand(robot: Robot, with_bowl: Held, bowl) -> None:
    """After each placing, also between two of them and where none is found, it is held as it
    was.
    """
    world, _, held = with_bowl
    for _ in islice(tried(robot, with_bowl, bowl), 2):
        assert world.held("bowl_1") == held
    assert not list(tried(robot, with_bowl, bowl, [FAR], tries=30))
    assert world.held("bowl_1") == held


def test_one_of_the_spots_is_taken(robot: Robot, with_bowl: Held, bowl) -> None:
    """A spot out of reach among them is passed over; the support told is that of the spot."""
    found = islice(tried(robot, with_bowl, bowl, [FAR, *SPOTS]), 3)
    assert {placing.support for placing in found} == {"table_1"}


def test_a_retreat_undoes_an_approach(taking) -> None:
    """From the grip that lets go it passes the approach's grips in reverse, however the thing lies
    in the hand.
    """
    approach = taking.found[0]
    stands = standing((0.5, -0.4, 0.8), 1.0)
    slipped = standing((0.01, 0.0, 0.02), 0.3)
    grips = [stands * T_object_grip for T_object_grip, _ in approach.steps]
    for let_go in (grips[-1], grips[-1] * slipped):
        poses = retreat_poses(let_go, backwards(approach.steps))
        moved = let_go * grips[-1].inverse()
        for pose, grip in zip(poses[:-1], grips[-2::-1], strict=True):
            assert pose.isApprox(moved * grip, 1e-9)
    backed = [fingers for _, fingers in backwards(approach.steps)]
    assert backed == [fingers for _, fingers in approach.steps[-2::-1]]


def test_a_retreat_without_steps_goes_back_and_up() -> None:
    """Nothing is known of how it was grasped: only the last part is left."""
    grip = standing((0.5, 0.0, 1.0))
    (end,) = retreat_poses(grip, [])
    assert end.translation == pytest.approx([0.5, 0.0, 1.0 + UP_M - BACK_M])
