"""Intervals of 95 % cover what they should, and do not depend on the order of runs."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from operate.experiments import intervals

VALUES = st.lists(st.floats(-1e6, 1e6), min_size=3, max_size=40)
TRIALS = 3000


@pytest.mark.parametrize("n", [3, 10, 30])
def test_students_interval_covers_the_true_mean_in_95_of_100_sets(n: int) -> None:
    """Of 3000 sets drawn from a normal distribution; the count's own spread is 0.4 %, four times
    that is allowed.
    """
    draw = np.random.default_rng(n)
    sets = draw.normal(7.0, 2.0, (TRIALS, n))
    covered = sum(
        i.low <= 7.0 <= i.high for one in sets if (i := intervals.mean(list(one))) is not None
    )  # type: ignore[operator]
    assert covered / TRIALS == pytest.approx(0.95, abs=0.016)


@pytest.mark.parametrize(
    ("freedom", "printed"),
    [
        (1, 12.706),
        (2, 4.303),
        (3, 3.182),
        (5, 2.571),
        (10, 2.228),
        (30, 2.042),
        (60, 2.000),
        (120, 1.980),
    ],
)
def test_students_factor_is_that_of_printed_tables(freedom: int, printed: float) -> None:
    """The column for 0.975; NIST/SEMATECH e-Handbook of Statistical Methods, 1.3.6.7.2."""
    assert intervals.student(freedom) == pytest.approx(printed, abs=5e-4)
    assert intervals.student(freedom + 0.5) < intervals.student(freedom)


@pytest.mark.parametrize(("n", "p"), [(30, 0.97), (30, 0.5), (10, 0.9)])
def test_wilsons_interval_covers_the_true_share(n: int, p: float) -> None:
    """On the whole nominal; a discrete count makes it somewhat more or less (Wilson's: at least
    0.92 here).
    """
    draw = np.random.default_rng(n)
    found = {k: intervals.share(k, n) for k in range(n + 1)}
    covered = sum(found[k].low <= p <= found[k].high for k in draw.binomial(n, p, TRIALS))  # type: ignore[operator, union-attr]
    assert 0.92 <= covered / TRIALS <= 0.995


def test_wilsons_interval_of_a_textbook() -> None:
    """29 of 30 by the closed formula with z = 1.959964."""
    z, n, p = 1.959964, 30, 29 / 30
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    found = intervals.share(29, 30)
    assert found is not None
    assert (found.low, found.high) == pytest.approx((middle - half, middle + half), abs=1e-6)


def test_newcombes_interval_as_printed() -> None:
    """His example (a): 56/70 and 48/80, difference 0.2, interval 0.0524 to 0.3339 (table II, method
    10).
    """
    found = intervals.difference_of_shares((48, 80), (56, 70))
    assert found is not None
    assert (found.value, found.low, found.high) == pytest.approx((0.2, 0.0524, 0.3339), abs=1e-4)


def test_welchs_interval_covers_the_true_difference() -> None:
    """Of sets of unlike size and spread."""
    draw, covered = np.random.default_rng(5), 0
    for _ in range(TRIALS):
        a = dict(enumerate(draw.normal(10.0, 1.0, 8)))
        b = dict(enumerate(draw.normal(11.5, 4.0, 15), start=100))
        found = intervals.difference(a, b)
        assert found is not None
        assert found.method == "Welch's t"
        assert found.low is not None
        assert found.high is not None
        covered += found.low <= 1.5 <= found.high
    assert covered / TRIALS == pytest.approx(0.95, abs=0.016)


def test_the_same_seeds_are_compared_seed_by_seed() -> None:
    """Variation that the seed decides does not widen the interval."""
    draw = np.random.default_rng(3)
    scene = draw.normal(100.0, 20.0, 20)
    a, b = dict(enumerate(scene)), dict(enumerate(scene + 1.0 + draw.normal(0.0, 0.1, 20)))
    paired = intervals.difference(a, b)
    apart = intervals.difference(a, {seed + 100: value for seed, value in b.items()})
    assert paired is not None
    assert apart is not None
    assert (paired.method, apart.method) == ("paired t", "Welch's t")
    assert paired.high is not None
    assert apart.high is not None
    assert paired.high - paired.value < 0.1 < 5.0 < apart.high - apart.value


@given(VALUES, st.randoms())
def test_the_order_of_runs_does_not_matter(values: list[float], shuffling: object) -> None:
    """Nor does the order in which seeds are given."""
    again = list(values)
    shuffling.shuffle(again)  # type: ignore[attr-defined]
    one, other = intervals.mean(values), intervals.mean(again)
    assert one is not None
    assert other is not None
    assert (other.value, other.low, other.high) == pytest.approx(
        (one.value, one.low, one.high), rel=1e-6, abs=1e-6
    )
    numbered = dict(enumerate(values))
    assert intervals.difference(numbered, dict(reversed(numbered.items()))) == intervals.difference(
        numbered, numbered
    )


@given(VALUES)
def test_the_value_lies_inside_and_both_ends_are_as_far(values: list[float]) -> None:
    """And the band of a figure is the same interval."""
    found = intervals.mean(values)
    assert found is not None
    assert found.low is not None
    assert found.high is not None
    assert found.low <= found.value <= found.high
    middle, half = intervals.band(np.array(values)[:, None])
    assert (middle[0] - half[0], middle[0] + half[0]) == pytest.approx(
        (found.low, found.high), rel=1e-9, abs=1e-6
    )


@given(st.integers(0, 40), st.integers(1, 40))
def test_a_share_stays_between_none_and_all(yes: int, n: int) -> None:
    """Also where all runs succeeded, or none."""
    found = intervals.share(min(yes, n), n)
    assert found is not None
    assert found.low is not None
    assert found.high is not None
    assert 0.0 <= found.low <= found.value <= found.high <= 1.0


def test_more_runs_say_more() -> None:
    """The interval of a share grows narrower with the runs, at the same share."""
    wide = [
        found.high - found.low for n in (10, 20, 40, 80) if (found := intervals.share(n // 2, n))
    ]  # type: ignore[operator]
    assert all(later < before for before, later in pairwise(wide))


def test_one_or_two_runs_have_no_interval_and_none_has_nothing() -> None:
    """Their values are told, without pretending to know their spread."""
    for some in ([3.0], [3.0, 4.0]):
        found = intervals.mean(some)
        assert found == intervals.Interval(sum(some) / len(some), None, None, len(some))
        assert intervals.band(np.array(some)[:, None])[1].tolist() == [0.0]
    assert intervals.mean([]) is None
    assert intervals.share(0, 0) is None
    assert intervals.difference({}, {1: 2.0}) is None
    for few in ({1: 2.0}, {1: 2.0, 2: 2.5}):
        apart = intervals.difference(few, {1: 5.0, 2: 6.0, 3: 7.0})
        assert apart is not None
        assert (apart.low, apart.high, apart.method) == (None, None, "too few runs")


@given(st.integers(0, 12), st.integers(0, 12))
def test_only_seeds_that_both_sets_have_are_paired(more: int, others: int) -> None:
    """Four of them, beside others: their own difference, or that of all runs where they are less
    than half.
    """
    a = {seed: 10.0 * seed for seed in range(4 + more)}
    b = {
        **{seed: 10.0 * seed + 1.0 for seed in range(4)},
        **{100 + seed: 7.0 for seed in range(others)},
    }
    found = intervals.difference(a, b)
    assert found is not None
    paired = max(len(a), len(b)) <= 2 * 4
    assert (found.method == "paired t") is paired
    if paired:
        assert (found.low, found.value, found.high) == pytest.approx((1.0, 1.0, 1.0))


def test_numbers_that_are_no_seeds_pair_nothing() -> None:
    """Runs of one folder whose seeds are not known are only counted."""
    a = {k: 10.0 * k for k in range(5)}
    found = intervals.difference(a, {k: value + 1.0 for k, value in a.items()}, seeded=False)
    assert found is not None
    assert (found.method, found.value) == ("Welch's t", 1.0)
