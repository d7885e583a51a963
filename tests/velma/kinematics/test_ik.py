"""Inverse kinematics: what comes back reaches its target, inside the limits, and failures are said
as such.
"""

import numpy as np
import pinocchio as pin
import pytest

from velma import names
from velma.kinematics import ik
from velma.kinematics.frames import standing
from velma.kinematics.robot import Robot


def _random_posture(robot: Robot, rng: np.random.Generator) -> np.ndarray:
    return rng.uniform(robot.lower, robot.upper) * 0.6


def _error(robot: Robot, q: np.ndarray, side: str, target: pin.SE3) -> float:
    return float(np.abs(pin.log6(target.actInv(robot.grip(q, side))).vector).max())


@pytest.mark.parametrize("side", names.SIDES)
def test_solve_reaches_what_it_claims(robot: Robot, side: str, rng: np.random.Generator) -> None:
    """A solution is within tolerance and 0.03 rad inside the limits; most near targets are reached,
    and none that is five metres away.
    """
    reached = 0
    for _ in range(60):
        start = _random_posture(robot, rng)
        near = np.clip(start + rng.normal(0, 0.25, 15), robot.lower, robot.upper) * 0.95
        target = robot.grip(near, side)
        q = ik.solve(robot, side, target, start)
        if q is None:
            continue
        reached += 1
        assert _error(robot, q, side, target) < 3e-3
        columns = names.COLUMNS[side]
        assert np.all(q[columns] >= robot.lower[columns] + 0.029)
        assert np.all(q[columns] <= robot.upper[columns] - 0.029)
    assert reached > 50
    assert ik.solve(robot, side, standing((5.0, 0.0, 1.0)), np.array(names.START)) is None


def test_solve_moves_only_the_columns_it_may(robot: Robot, rng: np.random.Generator) -> None:
    """With the arm's 7 columns the torso and the other arm stay as they are, and q itself is not
    changed.
    """
    start = _random_posture(robot, rng)
    kept = start.copy()
    grip = robot.grip(start, "left")
    target = pin.SE3(grip.rotation, grip.translation + np.array([0.02, -0.02, 0.02]))
    q = ik.solve(robot, "left", target, start, columns=names.ARM["left"])
    assert q is not None
    np.testing.assert_array_equal(start, kept)
    np.testing.assert_array_equal(q[:8], start[:8])


@pytest.mark.parametrize("side", names.SIDES)
def test_the_closed_form_reaches_the_pose_exactly(
    robot: Robot, side: str, rng: np.random.Generator
) -> None:
    """Every posture of the closed form has its grip at the target to a nanometre."""
    seen = 0
    for _ in range(30):
        target = robot.grip(rng.uniform(robot.lower, robot.upper), side)
        pairs = rng.uniform(-1, 1, 4), rng.uniform(-3, 3, 4)
        found = ik.geometry(robot, side).postures(target, *pairs)
        for angles in found:
            q = np.array(names.START)
            q[names.COLUMNS[side]] = angles
            assert _error(robot, q, side, target) < 1e-9
        seen += len(found)
    assert seen > 200


@pytest.mark.parametrize("side", names.SIDES)
def test_the_closed_form_finds_the_posture_it_came_from(
    robot: Robot, side: str, rng: np.random.Generator
) -> None:
    """Among the postures over a fine fan of swivels is one close to any posture the target was made
    from.
    """
    columns = names.COLUMNS[side]
    for _ in range(10):
        q = rng.uniform(robot.lower, robot.upper)
        # at zero the joints beside them are one axis, and the posture is not unique
        bends = columns[[2, 4, 6]]
        q[bends] = np.copysign(np.maximum(np.abs(q[bends]), 0.3), q[bends])
        swivels = np.linspace(-np.pi, np.pi, 721)
        found = ik.geometry(robot, side).postures(robot.grip(q, side), np.full(721, q[0]), swivels)
        assert np.abs(np.angle(np.exp(1j * (found - q[columns])))).max(axis=1).min() < 0.1


@pytest.mark.parametrize("side", names.SIDES)
def test_sampled_postures_are_comfortable(
    robot: Robot, side: str, rng: np.random.Generator
) -> None:
    """Every posture meets the filters, keeps the other arm, and the torso when it is given."""
    target = robot.grip(np.array(names.START) * 0.8, side)
    found = ik.postures(robot, side, target, np.array(names.START), rng, starts=40, torso=0.2)
    assert len(found) > 5
    other = names.ARM["left" if side == "right" else "right"]
    for q in found:
        assert ik.comfortable(robot, q, side)
        assert ik.margin(robot, q, side)[0] >= 0.08
        assert q[0] == 0.2
        np.testing.assert_array_equal(q[other], names.START[other])


def test_sampling_takes_only_what_is_accepted(robot: Robot) -> None:
    """`first` has the last word, and with `best` the most comfortable of the accepted comes
    back.
    """
    target = robot.grip(np.array(names.START) * 0.8, "left")
    start = np.array(names.START)

    def sampled(first, **options):
        rng = np.random.default_rng(1)
        return ik.sample(robot, "left", target, start, rng, first=first, **options)

    assert sampled(lambda found: None) is None
    found = ik.postures(robot, "left", target, start, np.random.default_rng(1))
    q = sampled(lambda found: int(np.flatnonzero(found[:, 0] > 0)[0]), best=True)
    assert q is not None
    best = ik.comfort(robot, found[found[:, 0] > 0], "left").max()
    assert ik.comfort(robot, q[None], "left")[0] == pytest.approx(best)


def test_the_wrist_polygon_of_the_left_mirrors_the_right(
    robot: Robot, rng: np.random.Generator
) -> None:
    """A posture is comfortable for the right arm exactly if its mirror image is for the left."""
    verdicts = set()
    for _ in range(200):
        q = rng.uniform(robot.lower, robot.upper)
        q[names.ARM["left"]] = -q[names.ARM["right"]]
        right = ik.comfortable(robot, q, "right")
        assert right == ik.comfortable(robot, q, "left")
        verdicts.add(right)
    assert verdicts == {True, False}


def test_a_line_is_straight_and_dense(robot: Robot) -> None:
    """Grips of a line lie on the line, neighbours at most a step apart, and it starts at q and ends
    at the target.
    """
    start = np.array(names.START) * 0.8
    grip = robot.grip(start, "right")
    target = pin.SE3(grip.rotation, grip.translation + np.array([0.06, 0.0, 0.08]))
    path = ik.line(robot, "right", start, target)
    assert path[0] is start
    assert _error(robot, path[-1], "right", target) < 3e-3
    assert all(q[0] == start[0] for q in path)
    places = np.array([robot.grip(q, "right").translation for q in path])
    along = (target.translation - grip.translation) / 0.1
    off = (places - grip.translation) - np.outer((places - grip.translation) @ along, along)
    assert np.abs(off).max() < 2e-3
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() < 0.0175


def test_a_blocked_line_says_where_and_why(robot: Robot) -> None:
    """Reach and collision are told apart, and the fraction says how far it came."""
    start = np.array(names.START)
    grip = robot.grip(start, "right")
    far = pin.SE3(grip.rotation, grip.translation + np.array([3.0, 0.0, 0.0]))
    with pytest.raises(ik.PathBlocked) as caught:
        ik.line(robot, "right", start, far)
    assert caught.value.reason in ("reach", "jump")
    assert 0.0 < caught.value.fraction < 1.0
    near = pin.SE3(grip.rotation, grip.translation + np.array([0.05, 0.0, 0.05]))
    with pytest.raises(ik.PathBlocked, match="collision") as caught:
        ik.line(robot, "right", start, near, accept=lambda q: False)
    assert caught.value.fraction == 0.0
