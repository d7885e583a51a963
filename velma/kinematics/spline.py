"""A cubic spline through points: continuous up to the second derivative, and up to the third at the outermost knots
("not-a-knot", C. de Boor, A Practical Guide to Splines, chapter IV). Knows no robot."""

import numpy as np

from velma.names import Array


class Spline:
    """A curve through points (n, m) at increasing places (n,), n > 1; a straight line for two, a parabola for three."""

    def __init__(self, places: Array, points: Array) -> None:
        self._places = places
        lengths = np.diff(places)
        slopes = np.diff(points, axis=0) / lengths[:, None]
        speeds = _speeds(lengths, slopes)
        bend = (speeds[:-1] + speeds[1:] - 2.0 * slopes) / lengths[:, None]
        quadratic, cubic = (slopes - speeds[:-1]) / lengths[:, None] - bend, bend / lengths[:, None]
        self._parts = points[:-1], speeds[:-1], quadratic, cubic  # of each piece, in powers of the way from its start

    def at(self, places: Array) -> tuple[Array, Array, Array]:
        """Return value, first and second derivative, (k, m) each, at `places` (k,)."""
        piece = np.searchsorted(self._places[1:-1], places, side="right")
        t = (places - self._places[piece])[:, None]
        constant, linear, quadratic, cubic = (part[piece] for part in self._parts)
        return (
            ((cubic * t + quadratic) * t + linear) * t + constant,
            (3.0 * cubic * t + 2.0 * quadratic) * t + linear,
            6.0 * cubic * t + 2.0 * quadratic,
        )


def _speeds(lengths: Array, slopes: Array) -> Array:
    """Return the first derivatives (n, m) at the places, from lengths (n - 1,) and slopes (n - 1, m) of the pieces."""
    n = len(slopes) + 1
    if n == 2:
        return np.repeat(slopes, 2, axis=0)
    # A tridiagonal system: lower, diagonal and upper (n,), right (n, m).
    lower, diagonal, upper, right = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros((n, slopes.shape[1]))
    lower[1:-1], upper[1:-1] = lengths[1:], lengths[:-1]
    diagonal[1:-1] = 2.0 * (lengths[:-1] + lengths[1:])
    right[1:-1] = 3.0 * (lengths[1:, None] * slopes[:-1] + lengths[:-1, None] * slopes[1:])
    if n == 3:
        diagonal[[0, -1]] = upper[0] = lower[-1] = 1.0
        right[0], right[-1] = 2.0 * slopes[0], 2.0 * slopes[-1]
    else:
        diagonal[0], upper[0] = lengths[1], lengths[0] + lengths[1]
        right[0] = _end(lengths[0], lengths[1], slopes[0], slopes[1])
        diagonal[-1], lower[-1] = lengths[-2], lengths[-1] + lengths[-2]
        right[-1] = _end(lengths[-1], lengths[-2], slopes[-1], slopes[-2])
    return _tridiagonal(lower, diagonal, upper, right)


def _end(outer: float, inner: float, slope: Array, inner_slope: Array) -> Array:
    """Return the right side at an end: the third derivative does not change at the knot next to it."""
    both = outer + inner
    return np.asarray(((outer + 2.0 * both) * inner * slope + outer**2 * inner_slope) / both)


def _tridiagonal(lower: Array, diagonal: Array, upper: Array, right: Array) -> Array:
    """Return the solution (n, m) by elimination without pivots, which the systems above do not need."""
    n, ratios, found = len(diagonal), np.empty(len(diagonal)), np.empty_like(right)
    ratios[0], found[0] = upper[0] / diagonal[0], right[0] / diagonal[0]
    for k in range(1, n):
        pivot = diagonal[k] - lower[k] * ratios[k - 1]
        ratios[k], found[k] = upper[k] / pivot, (right[k] - lower[k] * found[k - 1]) / pivot
    for k in range(n - 2, -1, -1):
        found[k] -= ratios[k] * found[k + 1]
    return found
