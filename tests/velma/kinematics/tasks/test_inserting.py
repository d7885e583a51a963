"""Places behind an opening: a thing goes in from the front, over its place, and down, and the hand
gets out again.
"""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

from velma import names
from velma.kinematics.collision import World
from velma.kinematics.frames import shifted, standing, tilt
from velma.kinematics.robot import Robot
from velma.kinematics.tasks import attaching
from velma.kinematics.tasks.grasping import LIFT_M, GraspWay
from velma.kinematics.tasks.inserting import Opening, insertions
from velma.kinematics.tasks.placing import CLEARANCE_M, Placing, backwards

NEAR = 1.5e-3  # m: three axes within the tolerance of the inverse kinematics
TORSO = (-0.9, 0.9)


def opening(taking) -> Opening:
    """That of the cabinet."""
    return Opening("cabinet_2", taking.target.out, taking.target.distance)


def some(robot: Robot, world: World, taking, spots, ways=None) -> list[tuple[str, Placing]]:
    """Grasps and places for a thing that stands or is held."""
    about = taking.side, np.array(names.START), taking.target.name, opening(taking)
    rng = np.random.default_rng(3)
    return list(insertions(robot, world, *about, spots, ways or taking.ways, rng, torso=TORSO))


@pytest.fixture
def stood(taking) -> np.ndarray:
    """Position of the thing in the cabinet."""
    return taking.target.pose.translation


@pytest.fixture
def elsewhere(world: World, taking) -> World:
    """The thing stands on the table."""
    world.detach(taking.target.name, standing((0.58, -0.52, 0.9)))
    return world


def test_a_thing_that_stands_elsewhere_could_be_put_there(
    robot: Robot, elsewhere: World, taking, stood
) -> None:
    """By known grasps; each place is upright on the spot, with the thing in the hand as that grasp
    has it.
    """
    found = some(robot, elsewhere, taking, [stood])
    assert found
    in_hand = {way.name: way.steps[-1][0] for way in taking.ways}
    for grasp, placing in found:
        assert placing.support == "cabinet_2"
        assert placing.place.translation == pytest.approx(stood + np.array([0.0, 0.0, CLEARANCE_M]))
        assert tilt(placing.place) == pytest.approx(0.0, abs=1e-6)
        way = [robot.grip(q, taking.side) * in_hand[grasp] for q in placing.way_down]
        assert way[-1].translation == pytest.approx(placing.place.translation, abs=NEAR)
        first, over = (shifted(placing.place, offset).translation for offset in opening(taking).way)
        assert way[0].translation == pytest.approx(first, abs=NEAR)
        assert min(np.linalg.norm(pose.translation - over) for pose in way) < NEAR
        assert all(tilt(pose) < 5e-3 for pose in way)
        assert all(a.translation[2] > b.translation[2] - NEAR for a, b in pairwise(way))


def test_the_way_in_is_free_until_it_goes_down(
    robot: Robot, elsewhere: World, taking, stood
) -> None:
    """And so is the way of the empty hand, from the thing that stands there."""
    in_hand = {way.name: way.steps[-1][0] for way in taking.ways}
    name, hand = taking.target.name, f"{taking.side}_hand"
    for grasp, placing in some(robot, elsewhere, taking, [stood]):
        grip = in_hand[grasp]
        way = [(q, (robot.grip(q, taking.side) * grip).translation[2]) for q in placing.way_down]
        with attaching.held(elsewhere, name, taking.side, grip):
            high = placing.place.translation[2] + LIFT_M - NEAR
            assert all(elsewhere.free(q) for q, z in way if z > high)
        with attaching.stood(elsewhere, name, placing.place, taking.side):
            assert elsewhere.free(placing.way_back[-1])
            with attaching.allowed(elsewhere, (name, hand)):
                assert all(elsewhere.free(q) for q in placing.way_back)


def test_the_hand_is_drawn_straight_out_where_it_can_be(
    robot: Robot, elsewhere: World, taking, stood
) -> None:
    """On from the outermost step, through the end of the told retreat; a jar's hand, which is deep
    inside, far.
    """
    drawn = []
    for _, placing in some(robot, elsewhere, taking, [stood]):
        grips = [robot.grip(q, taking.side) for q in placing.way_back]
        last, outermost = (grips[0] * placing.retreat[k][0] for k in (-1, -2))
        way = last.translation - outermost.translation
        drawn.append(float(way @ taking.target.out))
        assert np.linalg.norm(way - drawn[-1] * taking.target.out) < 2 * NEAR
        assert min(np.linalg.norm(grip.translation - last.translation) for grip in grips) < 2 * NEAR
    assert min(drawn) > -NEAR
    assert max(drawn) > 0.09 or taking.target.name != "jar_1"


def test_a_held_thing_goes_in_as_it_is_held(robot: Robot, world: World, taking, stood) -> None:
    """Slipped a little and turned in the hand, it still arrives upright on the spot."""
    approach = taking.found[0]
    turn = pin.exp3(np.array([0.03, 0.0, 1.0]))
    slipped = taking.held(approach) * pin.SE3(turn, np.array([0.0, 0.0, 0.005]))
    back = reversed(backwards(approach.steps))
    steps = [(release.inverse() * slipped, fingers) for release, fingers in back]
    way = GraspWay("held", (*steps, (slipped, approach.steps[-1][1])))
    world.attach(taking.target.name, taking.side, slipped)
    found = some(robot, world, taking, [stood], [way])
    assert found
    for _, placing in found:
        end = robot.grip(placing.way_down[-1], taking.side) * slipped
        assert end.translation == pytest.approx(placing.place.translation, abs=NEAR)
        assert np.linalg.norm(pin.log3(end.rotation.T @ placing.place.rotation)) < 5e-3
        assert tilt(placing.place) == pytest.approx(0.0, abs=1e-6)
    assert world.held(taking.target.name) == slipped


def test_where_it_stands_it_stays(robot: Robot, elsewhere: World, taking, stood) -> None:
    """Whether places are found or not."""
    before = elsewhere.pose(taking.target.name)
    for spots in ([stood], [stood + np.array([0.0, 3.0, 0.0])]):
        some(robot, elsewhere, taking, spots)
        assert elsewhere.held(taking.target.name) is None
        assert elsewhere.pose(taking.target.name) == before


def test_several_spots_share_what_is_wanted(robot: Robot, elsewhere: World, taking, stood) -> None:
    """One of three spots gives a third at most, so that no spot takes all tries."""
    out = opening(taking).out
    beside = np.array([-out[1], out[0], 0.0]) * 0.03
    found = some(robot, elsewhere, taking, [stood, stood + beside, stood - beside])
    places = [tuple(np.round(placing.place.translation, 3)) for _, placing in found]
    assert len(set(places)) > 1
    assert max(places.count(place) for place in places) <= 2
