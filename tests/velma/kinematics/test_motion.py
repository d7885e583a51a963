"""Free motions: they end where asked, touch nothing in time, keep their condition, and are replayed
from a seed.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from velma import names
from velma.kinematics import ik, motion
from velma.kinematics.collision import World
from velma.kinematics.frames import standing
from velma.kinematics.motion import STEP, clear, grow, halving, rounder, shortened
from velma.kinematics.robot import Robot
from velma.kinematics.shapes import Box, Sphere
from velma.kinematics.timing import dense, timed

SPEED = 0.25
START = np.array(names.START)


def planned(robot: Robot, *args: Any, **options: Any) -> list[np.ndarray] | None:
    """The postures of a motion, which takes as long as it says."""
    found = motion.plan(robot, *args, **options)
    if found is None:
        return None
    speed = options.get("tool_speed", motion.TOOL_SPEED)
    assert abs(timed(robot, found.path, tool_speed=speed).duration - found.duration) < 0.05
    return found.path


def reaching(robot: Robot, side: str = "left") -> np.ndarray:
    """A posture with the hand in front of the robot, pointing forwards."""
    mirror = 1.0 if side == "left" else -1.0
    grip = standing((0.55, 0.35 * mirror, 1.1))
    grip.rotation = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    q = ik.sample(robot, side, grip, START, np.random.default_rng(5), torso=0.1, best=True)
    assert q is not None
    return q


def walled(robot: Robot) -> World:
    """A world with a board between the hanging left hand and the place it reaches to."""
    world = World(robot)
    world.put("board", [Box((0.3, 0.5, 0.02))], standing((0.45, 0.45, 0.85)))
    return world


def check(
    robot: Robot, world: World, path: list[np.ndarray], start: np.ndarray, goal: np.ndarray
) -> None:
    """Ends, density, joints that stay, and freedom in time, twice as finely as the planner
    looks.
    """
    np.testing.assert_array_equal(path[0], start)
    np.testing.assert_allclose(path[-1], goal, atol=1e-12)
    assert np.abs(np.diff(path, axis=0)).max() <= 0.05 + 1e-9
    assert np.all(np.array(path)[:, names.ARM["right"]] == start[names.ARM["right"]])
    trajectory = timed(robot, path, tool_speed=SPEED)
    world.margin -= 0.001  # states between those the planner looked at may come a little nearer
    assert all(world.free(q) for q in trajectory.q[::2])


def test_a_free_way_is_straight(robot: Robot) -> None:
    """The joints go straight if nothing is in the way."""
    goal = reaching(robot)
    path = planned(robot, World(robot), "left", START, goal)
    assert path is not None
    way = goal - START
    shares = (np.array(path) - START) @ way / (way @ way)
    np.testing.assert_allclose(path, START + shares[:, None] * way, atol=1e-9)


def test_a_blocked_way_goes_round(robot: Robot) -> None:
    """With a board across the straight way, the motion goes round it and touches nothing at any
    time.
    """
    world, goal = walled(robot), reaching(robot)
    straight = np.linspace(START, goal, 60)
    assert not all(world.free(q) for q in straight)
    path = planned(robot, world, "left", START, goal, tool_speed=SPEED)
    assert path is not None
    check(robot, world, path, START, goal)


def test_a_motion_is_replayed_in_one_process(robot: Robot) -> None:
    """The same seed goes the same way whatever was planned in between; another seed may go
    another.
    """
    world, goal = walled(robot), reaching(robot)
    ways = [planned(robot, world, "left", START, goal, seed=seed) for seed in (3, 4, 3)]
    first, other, again = ways
    assert first is not None
    assert other is not None
    np.testing.assert_array_equal(first, again)
    assert len(first) != len(other) or not np.array_equal(first, other)


def test_a_motion_out_of_the_cabinet(robot: Robot, furnished: Callable[[], World]) -> None:
    """From a posture with the hand between the shelves back to the side of the body."""
    world = furnished()
    world.remove("jar_1")
    out = standing((0.0, 0.0, 0.0), -2.9235).rotation[:, 0]
    grip = standing((0.80, 0.36, 1.281))
    up = np.array([0.0, 0.0, 1.0])
    grip.rotation = np.column_stack((up, np.cross(-out, up), -out))
    options = {"first": world.first_free, "best": True, "starts": 80}
    inside = ik.sample(robot, "left", grip, START, np.random.default_rng(1), **options)
    assert inside is not None
    goal = inside.copy()
    goal[names.ARM["left"]] = START[names.ARM["left"]]
    path = planned(robot, world, "left", inside, goal, tool_speed=SPEED)
    assert path is not None
    check(robot, world, path, inside, goal)


def test_a_condition_holds_all_the_way(robot: Robot) -> None:
    """With the hand's axis to stay within 40 degrees of the horizon, it does at each posture."""
    start, world = reaching(robot), World(robot)
    grip = robot.grip(start, "left")
    target = standing((0.3, 0.7, 1.2))
    target.rotation = standing((0.0, 0.0, 0.0), 1.2).rotation @ grip.rotation
    goal = ik.sample(robot, "left", target, start, np.random.default_rng(2), best=True)
    assert goal is not None
    middle = robot.grip((start + goal) / 2, "left").translation
    world.put("post", [Box((0.06, 0.06, 0.06))], standing(middle))

    def level(postures: np.ndarray) -> np.ndarray:
        upwards = np.array([robot.grip(q, "left").rotation[2, 2] for q in postures])
        return np.asarray(np.abs(upwards) < np.sin(np.radians(40.0)))

    assert world.free(start)
    assert world.free(goal)
    assert not world.free((start + goal) / 2)
    path = planned(robot, world, "left", start, goal, keep=level)
    assert path is not None
    assert level(timed(robot, path, tool_speed=0.25).q[::4]).all()


def test_what_cannot_be_is_refused(robot: Robot) -> None:
    """No way to a goal that touches something or breaks the condition, nor from such a start."""
    world, goal = World(robot), reaching(robot)
    kept = {"keep": lambda some: some[:, 0] < 0.05}
    assert motion.plan(robot, world, "left", START, goal, **kept) is None
    world.put("ball", [Sphere(0.1)], standing(robot.grip(goal, "left").translation))
    assert motion.plan(robot, world, "left", START, goal) is None
    assert motion.plan(robot, world, "left", goal, START) is None


def test_a_closed_box_is_given_up(robot: Robot) -> None:
    """A hand behind a wall without a gap is not reached; the iterations end and the margin is as it
    was.
    """
    world, goal = World(robot), reaching(robot)
    world.put("wall", [Box((0.02, 8.0, 8.0))], standing((0.32, 0.0, 1.0)))
    world.allow(("wall", "robot"))
    assert world.free(START)
    assert world.free(goal)
    assert motion.plan(robot, world, "left", START, goal, iterations=50) is None
    assert world.margin == 0.006


def test_a_start_in_touch_is_left_first(robot: Robot) -> None:
    """With a thing in the hand that still stands on its shelf, the way begins straight upwards and
    is free after it.
    """
    world, start = World(robot), reaching(robot)
    goal = start.copy()
    goal[names.TORSO] += 0.4
    grip = robot.grip(start, "left")
    world.put("shelf", [Box((0.3, 0.3, 0.02))], standing(grip.translation - (0.0, 0.0, 0.111)))
    world.put("jar", [Sphere(0.1)], standing(grip.translation), "object")
    world.attach("jar", "left", grip.inverse() * standing(grip.translation))
    assert not world.free(start)
    path = planned(robot, world, "left", start, goal)
    assert path is not None
    np.testing.assert_array_equal(path[0], start)
    free = [world.free(q) for q in path]
    first = free.index(True)
    assert all(free[first:])
    heights = [robot.grip(q, "left").translation[2] for q in path[: first + 1]]
    assert min(heights) > grip.translation[2] - 1e-4


# --- Trees and shortcuts on a toy: a disc in the way, in eight dimensions -------------------------


BEGIN, END = np.array([-1.0, *np.zeros(7)]), np.array([1.0, *np.zeros(7)])
LOWER, UPPER = np.full(8, -2.0), np.full(8, 2.0)


def beside_the_disc(joints: np.ndarray) -> bool:
    """Whether a posture is outside a cylinder about the middle."""
    return float(joints[0] ** 2 + joints[1] ** 2) > 0.49


def all_beside(path: np.ndarray) -> bool:
    """Whether all postures of a path are."""
    return all(map(beside_the_disc, path))


def length(path: np.ndarray) -> np.ndarray:
    """Of each step."""
    return np.linalg.norm(np.diff(path, axis=0), axis=1)


def tree(seed: int, iterations: int = 2000) -> list[np.ndarray] | None:
    """A tree round the disc."""
    return grow(beside_the_disc, BEGIN, END, LOWER, UPPER, iterations=iterations, seed=seed)


def test_a_tree_connects_the_ends_by_allowed_edges() -> None:
    """The found postures begin and end where asked and all states between them are allowed."""
    for seed in range(5):
        found = tree(seed)
        assert found is not None
        np.testing.assert_allclose(found[0], BEGIN)
        np.testing.assert_allclose(found[-1], END)
        assert all(beside_the_disc(q) for q in dense(found, 0.1))


def test_a_tree_is_replayed_in_one_process() -> None:
    """The same seed gives the same tree, whatever grew in between; another seed another one."""
    first, other, again = tree(1), tree(2), tree(1)
    np.testing.assert_array_equal(first, again)
    assert len(first) != len(other) or not np.array_equal(first, other)


def test_iterations_are_counted() -> None:
    """A tree without iterations, and one around a wall without a gap, come back empty."""
    assert tree(1, iterations=0) is None
    walled = grow(lambda q: abs(q[0]) > 0.2, BEGIN, END, LOWER, UPPER, iterations=300, seed=1)
    assert walled is None


def test_shortcuts_only_shorten() -> None:
    """A shortened path keeps its ends, stays allowed, is finely divided, and half of the detour is
    gone.
    """
    for seed in range(5):
        way = dense(tree(seed), STEP)
        short = shortened(way, all_beside, length, np.random.default_rng(seed))
        np.testing.assert_allclose(short[[0, -1]], [BEGIN, END])
        assert length(short).sum() - 2.0 < (length(way).sum() - 2.0) / 2
        assert clear(all_beside, short)
        assert np.abs(np.diff(short, axis=0)).max() <= STEP + 1e-9


def test_rounding_keeps_the_ends_and_ends_with_the_path() -> None:
    """Every rounded path has the same ends; corners are missed by less and less, the last is the
    path itself.
    """
    corner, end = np.eye(8)[0], np.eye(8)[0] + np.eye(8)[1]
    path = dense([np.zeros(8), corner, end], STEP)
    rounded = list(rounder(path))
    for each in rounded:
        np.testing.assert_allclose(each[[0, -1]], path[[0, -1]])
    missed = [np.linalg.norm(each - corner, axis=1).min() for each in rounded]
    assert missed == sorted(missed, reverse=True)
    np.testing.assert_array_equal(rounded[-1], path)


def test_halving_visits_all_once() -> None:
    """Each index comes once, the middle first."""
    for count in (0, 1, 2, 7, 32):
        order = halving(count).tolist()
        assert sorted(order) == list(range(count))
        assert order[:1] == [count // 2][:count]
