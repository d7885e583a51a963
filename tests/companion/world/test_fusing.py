"""Two sights as one: never surer than is known, whatever their errors share; only where they
agree.
"""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from companion.languages.values import Pose, Uncertainty
from companion.world.observe import fused

Array = NDArray[np.float64]
AT = np.array([0.85, 0.37, 1.28])
UPPER = np.triu_indices(3)
TINY_M = 1e-7
"""Between two sights: within every gate."""
numbers = st.floats(-1.0, 1.0)
squares = st.lists(numbers, min_size=9, max_size=9).map(
    lambda values: np.array(values).reshape(3, 3)
)
roots = st.tuples(squares, st.floats(2e-4, 5e-3)).map(
    lambda given: given[1] * (given[0] + 3.0 * np.eye(3)) / 3.0
)
"""Square roots of covariances: some 0.1 mm to 1 cm, in any direction."""


def uncertain(covariance, turn=1e-5):
    """As it travels."""
    return Uncertainty(tuple(covariance[UPPER].tolist()), turn)  # type: ignore[arg-type]


def pose(xyz, about=0.0, tilt=0.0):
    """Turned about the vertical, then tilted about x."""
    a, b, c, d = math.cos(about / 2), math.sin(about / 2), math.cos(tilt / 2), math.sin(tilt / 2)
    return Pose((float(xyz[0]), float(xyz[1]), float(xyz[2])), (a * c, a * d, -b * d, b * c))


def whole(upper):
    """The symmetric matrix (3, 3)."""
    matrix = np.zeros((3, 3))
    matrix[UPPER] = upper
    return matrix + np.triu(matrix, 1).T


def gain(a, b):
    """The share (3, 3) of a deviation between two sights by which the fused one follows the newer;
    its covariance.
    """
    columns = []
    for axis in np.eye(3):
        one, known = fused((pose(AT), uncertain(a)), (pose(AT + TINY_M * axis), uncertain(b)))
        columns.append((np.array(one.xyz) - AT) / TINY_M)
    return np.array(columns).T, whole(known.xyz)


@given(roots, roots, squares)
def test_it_is_never_surer_than_what_is_known(root_a, root_b, shared):
    """Whatever correlation the errors of both have: the error of the fused place is within the told
    covariance.
    """
    a, b = root_a @ root_a.T, root_b @ root_b.T
    follow, told = gain(a, b)
    stay = np.eye(3) - follow
    cross = root_a @ (shared / max(1.0, np.linalg.norm(shared, 2))) @ root_b.T
    mixed = stay @ cross @ follow.T
    actual = stay @ a @ stay.T + follow @ b @ follow.T + mixed + mixed.T
    assert np.linalg.eigvalsh(told - actual)[0] > -1e-6 * np.trace(told)


@given(roots, roots)
def test_it_is_at_least_as_sure_as_the_better_one(root_a, root_b):
    """By the volume of the ellipsoid."""
    a, b = root_a @ root_a.T, root_b @ root_b.T
    _, told = gain(a, b)
    assert np.linalg.det(told) <= (1 + 1e-6) * min(np.linalg.det(a), np.linalg.det(b))


@given(roots)
def test_of_two_equal_ones_it_is_the_middle(root):
    """And not surer than one of them: the same camera errs the same way."""
    follow, told = gain(root @ root.T, root @ root.T)
    assert follow == pytest.approx(np.eye(3) / 2, abs=1e-5)
    assert told == pytest.approx(root @ root.T, rel=1e-6, abs=1e-15)


@given(roots, roots, squares)
def test_what_does_not_agree_was_moved(root_a, root_b, direction):
    """Then the newer one counts alone; within a deviation it does not."""
    a, b = root_a @ root_a.T, root_b @ root_b.T
    unit = direction[0] / max(1e-9, np.linalg.norm(direction[0]))
    one_deviation = 1.0 / math.sqrt(max(1e-9, unit @ np.linalg.solve(a + b, unit)))
    kept = pose(AT), uncertain(a)
    far, near = ((pose(AT + factor * one_deviation * unit), uncertain(b)) for factor in (4.5, 1.0))
    if np.linalg.norm(direction[0]) > 0.01:
        assert fused(kept, far) == far
        assert fused(kept, near)[0] != near[0] or np.linalg.det(a) > np.linalg.det(b)


@given(st.floats(-3.1, 3.1), st.floats(-0.004, 0.004), st.floats(1e-6, 1e-4), st.floats(1e-6, 1e-4))
def test_the_surer_rotation_counts(about, off, sure, unsure):
    """Also across half a turn."""
    covariance = 1e-6 * np.eye(3)
    kept = pose(AT, about), uncertain(covariance, sure)
    seen = pose(AT, about + off), uncertain(covariance, unsure)
    agree = off**2 / (sure + unsure) < 18
    one, told = fused(kept, seen)
    if agree:
        assert told.turn == min(sure, unsure)
        assert one.quat_wxyz == (kept if sure < unsure else seen)[0].quat_wxyz


@pytest.mark.parametrize(
    ("kept", "seen"),
    [
        ((pose(AT), None), (pose(AT + 0.001), uncertain(1e-6 * np.eye(3)))),
        ((pose(AT), uncertain(1e-6 * np.eye(3))), (pose(AT + 0.001), None)),
        ((pose(AT), uncertain(np.zeros((3, 3)))), (pose(AT), uncertain(1e-6 * np.eye(3)))),
        ((pose(AT), uncertain(-1e-6 * np.eye(3))), (pose(AT), uncertain(1e-6 * np.eye(3)))),
        (
            (pose(AT), uncertain(1e-6 * np.eye(3))),
            (pose(AT, tilt=0.1), uncertain(1e-6 * np.eye(3))),
        ),
        (
            (pose(AT), uncertain(1e-6 * np.eye(3))),
            (pose(AT + 5e-4, 0.1), uncertain(1e-6 * np.eye(3))),
        ),
    ],
    ids=["before unknown", "now unknown", "nothing", "no covariance", "tipped", "turned"],
)
def test_the_newer_one_counts_alone(kept, seen):
    """Where there is nothing to weigh by, or it stands otherwise."""
    assert fused(kept, seen) == seen
