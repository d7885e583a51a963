"""Trees and shortcuts on a toy: a disc in the way, in eight dimensions."""

import numpy as np

from velma.kinematics.motion import STEP, clear, grow, halving, rounder, shortened
from velma.kinematics.timing import dense

START, GOAL = np.array([-1.0, *np.zeros(7)]), np.array([1.0, *np.zeros(7)])
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
    return grow(beside_the_disc, START, GOAL, LOWER, UPPER, iterations=iterations, seed=seed)


def test_a_tree_connects_the_ends_by_allowed_edges() -> None:
    """The found postures begin and end where asked and all states between them are allowed."""
    for seed in range(5):
        found = tree(seed)
        assert found is not None
        np.testing.assert_allclose(found[0], START)
        np.testing.assert_allclose(found[-1], GOAL)
        assert all(beside_the_disc(q) for q in dense(found, 0.1))


def test_a_tree_is_replayed_in_one_process() -> None:
    """The same seed gives the same tree, whatever grew in between; another seed another one."""
    first, other, again = tree(1), tree(2), tree(1)
    np.testing.assert_array_equal(first, again)
    assert len(first) != len(other) or not np.array_equal(first, other)


def test_iterations_are_counted() -> None:
    """A tree without iterations, and one around a wall without a gap, come back empty."""
    assert tree(1, iterations=0) is None
    walled = grow(lambda q: abs(q[0]) > 0.2, START, GOAL, LOWER, UPPER, iterations=300, seed=1)
    assert walled is None


def test_shortcuts_only_shorten() -> None:
    """A shortened path keeps its ends, stays allowed, is finely divided, and half of the detour is
    gone.
    """
    for seed in range(5):
        way = dense(tree(seed), STEP)
        short = shortened(way, all_beside, length, np.random.default_rng(seed))
        np.testing.assert_allclose(short[[0, -1]], [START, GOAL])
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
