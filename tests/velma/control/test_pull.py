"""A hand may open for a steady pull alone: no knock, no push, no weight and no faulty wrist is
one.
"""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from velma.control import grip
from velma.control.cartesian import GRAVITY
from velma.control.grip import HAND_KG, Pull

LEAST, WINDOW = 5.0, 150  # N; cycles: 0.3 s
AWAY, UP = (1.0, 0.0, 0.0), (0.0, 0.0, GRAVITY)
YIELDS = 2.0 / grip.STIFFNESS  # m/N: of the hand, more than it must
N = st.floats(-200.0, 200.0)
ANYTHING = st.floats(allow_nan=True, allow_infinity=True)
READING = st.tuples(*[ANYTHING] * 6)


def longest(pulls, least=LEAST, wrist=None, beside=None):
    """For how many cycles a pull was felt at most; `pulls` [N] that are made, as a wrist without
    filters reads them.

    `wrist(cycle, reading)`: what it reads instead; `beside` [m]: what the joints tell, None: the
    arm yields.
    """
    felt, most = Pull(), 0
    for cycle, size in enumerate(pulls):
        reading = (-size, 0.0, HAND_KG * GRAVITY, 0.0, 0.0, 1e-6 * (cycle % 7))
        reading = wrist(cycle, reading) if wrist else reading
        told = grip.size(reading[:3], UP, 0.0, AWAY)
        way = YIELDS * size if beside is None else beside
        felt = grip.pulled(felt, reading, told, told, way, least)
        most = max(most, felt.steady)
    return most


@given(st.floats(LEAST + 0.01, 100.0), st.integers(1, 400))
def test_a_steady_pull_is_felt_as_long_as_it_lasts(size, cycles):
    assert longest([0.0] * 10 + [size] * cycles) == cycles


@given(st.lists(st.tuples(N, st.integers(1, WINDOW - 1), st.integers(1, 20)), max_size=6))
def test_no_knock_that_is_shorter_than_the_window_opens_whatever_its_size(knocks):
    """Nor do several, with a moment between them."""
    series = [size for one, cycles, between in knocks for size in [one] * cycles + [0.0] * between]
    assert longest(series) < WINDOW


@given(st.floats(5.0, 1000.0), st.integers(1, WINDOW - 1))
def test_a_knock_does_not_last_longer_for_the_filters_before_it(size, cycles):
    """They still feel it when the reading itself does not any more."""
    felt, most = Pull(), 0
    for cycle in range(2 * WINDOW):
        now = size if cycle < cycles else 0.0
        reading = (-now, 0.0, 1.0 + 1e-6 * (cycle % 7), 0.0, 0.0, 0.0)
        felt = grip.pulled(felt, reading, size, now, 1.0, LEAST)
        most = max(most, felt.steady)
    assert most < WINDOW


@given(st.floats(-100.0, LEAST))
def test_what_is_no_pull_away_from_the_robot_is_not_felt(size):
    assert longest([size] * (2 * WINDOW)) == 0


@given(st.floats(0.0, 5.0), st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
def test_the_weight_and_forces_aside_are_no_pull(kg, aside, upwards):
    force = (0.0, aside, (HAND_KG + kg) * GRAVITY + upwards)
    assert grip.size(force, UP, kg, AWAY) == pytest.approx(0.0, abs=1e-9)


@given(st.lists(READING, max_size=300), ANYTHING)
def test_readings_that_are_no_numbers_or_nothing_open_never(readings, told):
    felt = Pull()
    for reading in readings:
        wrong = not all(map(math.isfinite, (*reading, told))) or not any(reading)
        felt = grip.pulled(felt, reading, told, told, 1.0, LEAST)
        assert felt.steady == 0 or not wrong


@given(st.integers(0, 300), st.floats(-100.0, 100.0), st.floats(-100.0, 100.0))
def test_a_wrist_that_is_stuck_opens_never(begun, size, other):
    """Whatever it read when it began to read the same, and whatever is done to the hand."""
    stuck = (-size, 0.0, HAND_KG * GRAVITY, 0.0, 0.0, 0.0)
    assert longest([other] * 50 + [size] * 500, wrist=lambda cycle, reading: stuck) < WINDOW


@given(st.floats(-100.0, 100.0), st.floats(-1.0, 0.49))
def test_a_wrist_that_is_off_opens_never_while_the_arm_does_not_yield(error, share):
    """Nor do joints that tell no number give permission."""
    assert longest([error] * 500, beside=share * LEAST / grip.STIFFNESS) == 0
    for beside in (math.nan, math.inf, -math.inf):
        assert longest([20.0] * 50, beside=beside) == 0


def test_the_pull_must_be_without_a_break():
    """One cycle without it begins the time anew."""
    series = np.array([10.0] * (2 * WINDOW))
    series[WINDOW - 1] = 0.0
    assert longest(series[: WINDOW - 1]) == WINDOW - 1
    assert longest(series) == WINDOW
