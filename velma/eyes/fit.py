"""The pose of a body by all corners of its markers that were found: Gauss-Newton on the pixels.

A body that stands has 4 unknowns (x, y, z, yaw), one that is held or has tipped over has 6. Poses
are in the world; the camera's pose is given.
"""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from velma.eyes.lens import Lens
from velma.model.markers import Marker

Array = NDArray[np.float64]

STEPS, CLOSE_M = 12, 1e-7  # a step below 0.1 um or urad is the last
FLOOR_PX = 0.1
"""Least error of a corner that is believed: with it 95-98 % of true poses are in the 95 % region
(measured).
"""


class View(NamedTuple):
    """The camera: its lens, and rotation (3, 3) and position (3,) of the optical frame in the
    world.
    """

    lens: Lens
    rotation: Array
    position: Array

    def inside(self, points: Array) -> Array:
        """Return points (n, 3) of the world in the optical frame."""
        return np.asarray((points - self.position) @ self.rotation)


class Fit(NamedTuple):
    """A fitted pose. `rms_px` of the corners' deviations along an axis of the picture; `spread` [m
    and rad per pixel, squared]: covariance for corners with an error of 1 pixel, of (x, y, z, yaw),
    or (x, y, z, rotation about x, y, z).
    """

    rotation: Array
    position: Array
    rms_px: float
    spread: Array

    def covariance(self) -> Array:
        """Return the covariance of the unknowns, m and rad."""
        return np.asarray(max(FLOOR_PX, self.rms_px) ** 2 * self.spread)

    def sideways(self) -> float:
        """Return the largest horizontal deviation [m] per pixel of the corners' error."""
        return float(np.sqrt(np.linalg.eigvalsh(self.spread[:2, :2])[-1]))


def fit(
    view: View, corners: Array, pixels: Array, start: tuple[Array, Array], upright: bool
) -> Fit | None:
    """Return the pose of a body whose corners (n, 3) are seen at pixels (n, 2); None where it is
    not determined.

    `start`: rotation and position to begin with; it is stood upright for the 4 unknowns.
    """
    if upright:
        return _fitted(view, corners, pixels, (_stood(start[0]), start[1]), [0, 1, 2, 5])
    return _fitted(view, corners, pixels, start, [0, 1, 2, 3, 4, 5])


def turn(view: View, points: Array, pixels: Array, pivot: Array) -> Fit | None:
    """Return the rotation about `pivot` (3,) that brings points (n, 3) of the world to pixels (n,
    2); None as of `fit`.

    `spread`: of the rotation about x, y, z.
    """
    return _fitted(view, points - pivot, pixels, (np.eye(3), pivot), [3, 4, 5])


def _fitted(
    view: View, corners: Array, pixels: Array, start: tuple[Array, Array], columns: list[int]
) -> Fit | None:
    """Return the pose by the unknowns in these columns of (x, y, z, rotation about x, y, z)."""
    rotation, position = start
    for _ in range(STEPS):
        off, slopes = _linear(view, corners @ rotation.T, position, pixels)
        slopes = slopes[:, columns]
        normal = slopes.T @ slopes
        if not np.isfinite(normal).all() or np.linalg.cond(normal) > 1e12:
            return None
        step = np.zeros(6)
        step[columns] = np.linalg.solve(normal, -slopes.T @ off)
        position, rotation = position + step[:3], np.asarray(cv2.Rodrigues(step[3:])[0]) @ rotation
        if np.abs(step).max() < CLOSE_M:
            break
    off, slopes = _linear(view, corners @ rotation.T, position, pixels)
    slopes = slopes[:, columns]
    rms = float(np.sqrt(off @ off / max(1, len(off) - len(columns))))
    spread: Array = np.asarray(np.linalg.inv(slopes.T @ slopes), np.float64)
    return Fit(rotation, position, rms, spread) if np.isfinite(rms) else None


def _linear(view: View, arms: Array, position: Array, pixels: Array) -> tuple[Array, Array]:
    """Return deviations (2n,) [pixels] and their derivatives (2n, 6) by shifts and turns in the
    world's axes.

    `arms` (n, 3): the corners from the body's origin, in the world's axes.
    """
    inside = view.inside(arms + position)
    depth = np.where(np.abs(inside[:, 2]) > 1e-6, inside[:, 2], 1e-6)
    inside = np.column_stack([inside[:, :2], depth])
    off = view.lens.project(inside) - pixels
    by_point = np.zeros((len(arms), 2, 3))
    by_point[:, 0, 0] = by_point[:, 1, 1] = view.lens.focal / depth
    by_point[:, :, 2] = -view.lens.focal * inside[:, :2] / depth[:, None] ** 2
    shift = by_point @ view.rotation.T
    turn = -shift @ _cross(arms)
    return off.ravel(), np.concatenate([shift, turn], axis=2).reshape(-1, 6)


def _cross(arms: Array) -> Array:
    """Return matrices (n, 3, 3) with which arm x v = matrix v."""
    x, y, z = arms.T
    nothing = np.zeros_like(x)
    return np.stack([nothing, -z, y, z, nothing, -x, -y, x, nothing], axis=1).reshape(-1, 3, 3)


def _stood(rotation: Array) -> Array:
    """Return the upright rotation with the same heading: that of the least turn, about the
    vertical.
    """
    yaw = np.arctan2(rotation[1, 0] - rotation[0, 1], rotation[0, 0] + rotation[1, 1])
    return np.array(
        [[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]]
    )


# --- A first pose of a body, by its largest marker alone. A square far away has two that fit almost
# alike


def poses(view: View, marker: Marker, pixels: Array) -> list[tuple[Array, Array]]:
    """Return the poses (rotation, position) in the world of the body whose marker is at pixels (4,
    2): both, the more upright one first, or the one that there is where it is seen from straight
    ahead.
    """
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
    """Return the number of the marker with the largest area, of corners (4, 2) [pixels] by
    number.
    """
    return max(found, key=lambda number: _area(found[number]))


def _area(corners: Array) -> float:
    one, other = corners[2] - corners[0], corners[3] - corners[1]
    return abs(float(one[0] * other[1] - one[1] * other[0])) / 2


def _frame(corners: Array) -> tuple[Array, Array, float]:
    """Return middle (3,), axes (3, 3) as columns (right, up, towards who looks) and side of a
    marker, in its body.
    """
    right, up = corners[1] - corners[0], corners[0] - corners[3]
    side = float(np.linalg.norm(right))
    return (
        corners.mean(axis=0),
        np.column_stack([right, up, np.cross(right, up) / side]) / side,
        side,
    )
