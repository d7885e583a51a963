"""Cubic splines: through the points, smooth, exact for cubics."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from velma.kinematics.timing import Spline

places = st.lists(st.floats(0.05, 2.0), min_size=1, max_size=12).map(
    lambda gaps: np.cumsum([0.0, *gaps])
)


@given(places, st.integers(0, 10_000))
def test_it_passes_the_points(at: np.ndarray, seed: int) -> None:
    """At each place its point."""
    points = np.random.default_rng(seed).normal(size=(len(at), 3))
    np.testing.assert_allclose(Spline(at, points).at(at)[0], points, atol=1e-9)


@given(places, st.integers(0, 10_000))
def test_it_is_smooth(at: np.ndarray, seed: int) -> None:
    """Just before and at a knot: the same value and derivatives."""
    spline = Spline(at, np.random.default_rng(seed).normal(size=(len(at), 3)))
    pairs = zip(spline.at(np.nextafter(at[1:-1], 0.0)), spline.at(at[1:-1]), strict=True)
    for before, there in pairs:
        near = 1e-6 * max(1.0, np.abs(there).max(initial=0.0))
        np.testing.assert_allclose(before, there, rtol=1e-6, atol=near)


@given(places, st.integers(0, 10_000))
def test_a_cubic_is_reproduced(at: np.ndarray, seed: int) -> None:
    """Of 2 points the line, of 3 the parabola, of more the cubic through them, with its
    derivatives.
    """
    degree = min(len(at) - 1, 3)
    curve = np.polynomial.Polynomial(np.random.default_rng(seed).normal(size=degree + 1))
    between = np.linspace(at[0], at[-1], 33)
    found = Spline(at, curve(at)[:, None]).at(between)
    for one, order in zip(found, range(3), strict=True):
        expected = curve.deriv(order)(between) if order else curve(between)
        near = 1e-6 * max(1.0, np.abs(expected).max())
        np.testing.assert_allclose(one[:, 0], expected, rtol=1e-6, atol=near)
