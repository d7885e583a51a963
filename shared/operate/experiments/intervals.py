"""Intervals of 95 %: of a mean over runs, of a share of runs, of a difference between two sets.
Pure.

Means: Student's t over runs; differences: paired t over seeds that both sets have, else Welch's t;
shares: Wilson's score, their difference Newcombe's hybrid score (Statistics in Medicine 17, 1998,
method 10).
"""

import math
from collections.abc import Mapping, Sequence
from functools import cache
from statistics import NormalDist

import msgspec
import numpy as np

LEVEL = 0.95
LEAST = 3
"""Values that an interval of Student's or Welch's needs; of two its factor is 12.7, which tells
nobody anything.
"""


class Interval(msgspec.Struct, frozen=True):
    """`value`: mean or share of `n` runs; `low`, `high`: where it lies with 95 %; None: too few
    runs to say.
    """

    value: float
    low: float | None
    high: float | None
    n: int


class Difference(msgspec.Struct, frozen=True):
    """B less A; `low`, `high`: where it lies with 95 %, None: too few runs. `method`: how they were
    found.
    """

    value: float
    low: float | None
    high: float | None
    method: str


def mean(values: Sequence[float]) -> Interval | None:
    """The mean over runs with Student's interval; None without any."""
    if not values:
        return None
    middle, half = float(np.mean(values)), half_width(values)
    if half is None:
        return Interval(middle, None, None, len(values))
    return Interval(middle, middle - half, middle + half, len(values))


@cache
def _gauss() -> tuple[np.ndarray, np.ndarray]:
    return np.polynomial.legendre.leggauss(64)  # within 1e-10 of scipy up to 100,000 degrees


@cache
def student(freedom: float) -> float:
    """Student's factor: with `freedom` (>= 1) degrees of freedom, t is within it on both sides with
    LEVEL.

    With t = sqrt(freedom) tan(angle), the density of the angle is proportional to
    cos(angle)^(freedom - 1).
    """
    nodes, weights = _gauss()
    scale = (
        math.exp(math.lgamma((freedom + 1) / 2) - math.lgamma(freedom / 2)) * 2 / math.sqrt(math.pi)
    )
    # the factor is 12.71 for one degree, and less for more
    low, high = 0.0, math.atan(13.0 / math.sqrt(freedom))
    for _ in range(60):  # halvings: to rounding
        middle = (low + high) / 2
        within = scale * middle / 2 * weights @ np.cos(middle / 2 * (nodes + 1)) ** (freedom - 1)
        low, high = (middle, high) if within < LEVEL else (low, middle)
    return math.sqrt(freedom) * math.tan(low)


def half_width(values: Sequence[float]) -> float | None:
    """Half the width of Student's interval of the mean; None for fewer than LEAST runs."""
    n = len(values)
    return None if n < LEAST else float(student(n - 1) * np.std(values, ddof=1) / math.sqrt(n))


def band(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means over runs and half widths, (m,) each, of values (runs, m); without width for fewer than
    LEAST runs.
    """
    n = len(values)
    middle = values.mean(axis=0)
    if n < LEAST:
        return middle, np.zeros_like(middle)
    return middle, student(n - 1) * values.std(axis=0, ddof=1) / math.sqrt(n)


def share(yes: int, n: int) -> Interval | None:
    """The share of runs in which something was so, with Wilson's interval; None without runs."""
    if n == 0:
        return None
    z = NormalDist().inv_cdf((1 + LEVEL) / 2)
    middle = (yes + z**2 / 2) / (n + z**2)
    half = z / (n + z**2) * math.sqrt(yes * (n - yes) / n + z**2 / 4)
    # exactly, not to rounding
    low, high = (0.0 if yes == 0 else middle - half), (1.0 if yes == n else middle + half)
    return Interval(yes / n, low, high, n)


def difference(
    a: Mapping[int, float], b: Mapping[int, float], *, seeded: bool = True
) -> Difference | None:
    """Of means, seed -> value in each set; None where a set is empty.

    Seeds that both sets have are paired where they are LEAST or more, and at least half of the
    larger set. `seeded`: the numbers are seeds; else nothing is paired.
    """
    if not a or not b:
        return None
    common = sorted(set(a) & set(b)) if seeded else []
    half = half_width([b[seed] - a[seed] for seed in common])
    if half is None or 2 * len(common) < max(len(a), len(b)):
        return _welch([a[seed] for seed in sorted(a)], [b[seed] for seed in sorted(b)])
    middle = float(np.mean([b[seed] - a[seed] for seed in common]))
    return Difference(middle, middle - half, middle + half, "paired t")


def difference_of_shares(a: tuple[int, int], b: tuple[int, int]) -> Difference | None:
    """Of two shares, each (yes, n), by Newcombe's interval; None where a set is empty."""
    first, second = share(*a), share(*b)
    if first is None or second is None:
        return None
    apart = second.value - first.value
    if max(first.n, second.n) < 2:
        return Difference(apart, None, None, "one run")
    (down_a, up_a), (down_b, up_b) = _reach(first), _reach(second)
    low, high = math.hypot(down_b, up_a), math.hypot(up_b, down_a)
    return Difference(apart, apart - low, apart + high, "Newcombe")


def _reach(interval: Interval) -> tuple[float, float]:
    """Return how far an interval reaches below and above its value; zeros if it has no ends."""
    low = interval.value if interval.low is None else interval.low
    high = interval.value if interval.high is None else interval.high
    return interval.value - low, high - interval.value


def _welch(a: Sequence[float], b: Sequence[float]) -> Difference:
    apart = float(np.mean(b) - np.mean(a))
    if min(len(a), len(b)) < LEAST:
        return Difference(apart, None, None, "too few runs")
    spread = [float(np.var(one, ddof=1)) / len(one) for one in (a, b)]
    total = math.fsum(spread)
    if total == 0.0:
        return Difference(apart, apart, apart, "Welch's t")
    freedom = total**2 / math.fsum(
        s**2 / (len(one) - 1) for s, one in zip(spread, (a, b), strict=True)
    )
    half = student(freedom) * math.sqrt(total)
    return Difference(apart, apart - half, apart + half, "Welch's t")
