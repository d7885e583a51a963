"""A first pose of a body, by its largest marker alone. A square far away has two that fit almost alike."""

import cv2
import numpy as np
from numpy.typing import NDArray

from velma.eyes.fit import View
from velma.model.markers import Marker

Array = NDArray[np.float64]


def poses(view: View, marker: Marker, pixels: Array) -> list[tuple[Array, Array]]:
    """Return the poses (rotation, position) in the world of the body whose marker is at pixels (4, 2): both, the more
    upright one first, or the one that there is where it is seen from straight ahead."""
    middle, axes, side = _frame(marker.corners)
    flat = side / 2 * np.array([(-1, 1, 0), (1, 1, 0), (1, -1, 0), (-1, -1, 0)], np.float64)
    matrix = view.lens.matrix()
    found = []
    for turn, shift in _solved(flat, pixels, matrix):
        rotation = view.rotation @ np.asarray(cv2.Rodrigues(turn)[0]) @ axes.T
        found.append((rotation, view.rotation @ shift.ravel() + view.position - rotation @ middle))
    return sorted(found, key=lambda pose: -pose[0][2, 2])


def _solved(flat: Array, pixels: Array, matrix: Array) -> list[tuple[Array, Array]]:
    """Return the poses (rotation vector, shift) of a square before the camera."""
    for method in (cv2.SOLVEPNP_IPPE_SQUARE, cv2.SOLVEPNP_ITERATIVE):
        _, turns, shifts, _ = cv2.solvePnPGeneric(flat, pixels, matrix, None, flags=method)
        # The first one gives NaN where both poses are one (OpenCV 5.0).
        found = [pose for pose in zip(turns, shifts, strict=True) if np.isfinite(pose).all()]
        if found:
            break
    return found


def largest(found: dict[int, Array]) -> int:
    """Return the number of the marker with the largest area, of corners (4, 2) [pixels] by number."""
    return max(found, key=lambda number: _area(found[number]))


def _area(corners: Array) -> float:
    one, other = corners[2] - corners[0], corners[3] - corners[1]
    return abs(float(one[0] * other[1] - one[1] * other[0])) / 2


def _frame(corners: Array) -> tuple[Array, Array, float]:
    """Return middle (3,), axes (3, 3) as columns (right, up, towards who looks) and side of a marker, in its body."""
    right, up = corners[1] - corners[0], corners[0] - corners[3]
    side = float(np.linalg.norm(right))
    return corners.mean(axis=0), np.column_stack([right, up, np.cross(right, up) / side]) / side, side
