"""Finds markers in a picture: OpenCV's ArUco detector with whole-pixel corners, refined by lines
that are fitted to the edges.

The detector's own refinement (CORNER_REFINE_SUBPIX) is not used: its corners are off by 0.4 pixels,
ten times as much as those of an edge fit (docs/decisions/2026-11-25-eyes.md).
"""

from collections.abc import Iterable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

# --- The patterns of markers: OpenCV's ArUco dictionaries of 4 x 4 bits ---------------------------

Pixels = NDArray[np.uint8]

MODULES = 8
"""Fields of a plate each way: 4 bits, the black rim and the white rim on both sides."""
_DICTIONARIES = {
    50: cv2.aruco.DICT_4X4_50,
    100: cv2.aruco.DICT_4X4_100,
    250: cv2.aruco.DICT_4X4_250,
}


def dictionary(numbers: int) -> Any:
    """Return the smallest dictionary that has `numbers` markers. Raises ValueError where none has.

    The fewer there are, the farther apart they are, and the fewer wrong ones are read.
    """
    for size, name in _DICTIONARIES.items():
        if numbers <= size:
            return cv2.aruco.getPredefinedDictionary(name)
    raise ValueError(
        f"{numbers} markers of 4 x 4 bits, there are dictionaries of {list(_DICTIONARIES)}"
    )


def plate(number: int, texels: int) -> Pixels:
    """Return the picture (n, n) of a marker's white plate, n = MODULES x `texels`; grey levels 0
    and 255.
    """
    square = cv2.aruco.generateImageMarker(
        dictionary(number + 1), number, (MODULES - 2) * texels, borderBits=1
    )
    return np.pad(np.asarray(square, np.uint8), texels, constant_values=255)


Array = NDArray[np.float64]


class Detector:
    """Finds the markers with these `numbers`; others are taken for wrong readings."""

    def __init__(self, numbers: Iterable[int]) -> None:
        self._numbers = frozenset(numbers)
        settings = cv2.aruco.DetectorParameters()
        settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_NONE
        known = dictionary(max(self._numbers, default=0) + 1)
        self._detector = cv2.aruco.ArucoDetector(known, settings)

    def find(self, grey: Pixels) -> dict[int, Array]:
        """Return corners (4, 2) [pixels] by number, in the order of velma.model.markers; `grey` is
        (height, width).

        A number that is found twice is left out: one of them is wrong.
        """
        corners, numbers, _ = self._detector.detectMarkers(grey)
        read = [] if numbers is None else [int(number) for number in numbers.ravel()]
        return {
            number: np.asarray(at, np.float64).reshape(4, 2)
            for number, at in zip(read, corners, strict=True)
            if number in self._numbers and read.count(number) == 1
        }


# --- Corners of markers by lines along their edges: to 0.04 pixels where the detector's are off by
# 0.6 (measured) Across each side of a marker the picture is read along short profiles; the middle
# of the rise from black to white is on the edge. A line is laid through these points, and
# neighbouring lines meet in the corners.


Flags = NDArray[np.bool_]

PROFILES, ENDS = 14, (0.12, 0.88)
"""Profiles across a side and where on it they begin and end: not near the corners."""
REACH_PX, REACH_SHARE, STEPS = 2.5, 0.12, 21
"""Profiles reach this far to both sides; on a small marker, or one seen from aside, this share of
its width across the side: a field is a sixth of it.
"""
LEAST_RISE = 25.0  # grey levels from black to white; less is no edge
ROUNDS, REJECTIONS, REJECT = 2, 3, 3.0  # a point is left out that is off by 3 times the median
MOST_MOVED_PX = 4.0  # a corner that moves farther belongs to something else
LEAST_POINTS = 4  # of a line


def refined(grey: NDArray[np.uint8], corners: Array) -> tuple[Array, Flags]:
    """Return finer corners (n, 4, 2) of markers and which of the markers (n,) have them, given the
    detector's.
    """
    picture, before = grey.astype(np.float64), corners
    good = np.ones(len(corners), dtype=bool)
    for _ in range(ROUNDS):
        points, weights = _edge_points(picture, corners)
        normals, offsets, enough = _lines(points, weights)
        corners, crossing = _crossings(normals, offsets, corners)
        good &= enough & crossing
    moved = np.linalg.norm(corners - before, axis=2).max(axis=1)
    return corners, np.asarray(good & (moved < MOST_MOVED_PX))


def _edge_points(picture: Array, corners: Array) -> tuple[Array, Array]:
    """Return points on the edges (n, 4, PROFILES, 2) and their weights (n, 4, PROFILES): 1, or 0
    where no edge is.
    """
    along = np.roll(corners, -1, axis=1) - corners
    length = np.maximum(np.linalg.norm(along, axis=2), 1e-9)
    # corners run clockwise
    outwards = np.stack([along[..., 1], -along[..., 0]], axis=2) / length[..., None]
    diagonals = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    area = (
        np.abs(diagonals[0][:, 0] * diagonals[1][:, 1] - diagonals[0][:, 1] * diagonals[1][:, 0])
        / 2
    )
    reach = np.minimum(REACH_PX, REACH_SHARE * area[:, None] / length)
    feet = corners[:, :, None] + np.linspace(*ENDS, PROFILES)[:, None] * along[:, :, None]
    steps = np.linspace(-1.0, 1.0, STEPS)
    offsets = reach[..., None] * steps
    places = feet[:, :, :, None] + offsets[:, :, None, :, None] * outwards[:, :, None, None]
    rise = np.maximum(np.diff(_read(picture, places), axis=3), 0.0)
    total = rise.sum(axis=3)
    middles = (offsets[..., 1:] + offsets[..., :-1]) / 2
    shift = (rise * middles[:, :, None]).sum(axis=3) / np.maximum(total, 1e-9)
    points = feet + shift[..., None] * outwards[:, :, None]
    return points, (total > LEAST_RISE).astype(np.float64)


def _read(picture: Array, places: Array) -> Array:
    """Return the grey levels at places (..., 2) between pixels, bilinear; outside the picture those
    of its rim.
    """
    height, width = picture.shape
    x, y = np.clip(places[..., 0], 0, width - 1.001), np.clip(places[..., 1], 0, height - 1.001)
    column, row = x.astype(np.intp), y.astype(np.intp)
    dx, dy = x - column, y - row
    upper = (1 - dx) * picture[row, column] + dx * picture[row, column + 1]
    lower = (1 - dx) * picture[row + 1, column] + dx * picture[row + 1, column + 1]
    return np.asarray((1 - dy) * upper + dy * lower)


def _lines(points: Array, weights: Array) -> tuple[Array, Array, Flags]:
    """Return unit normals (n, 4, 2), offsets (n, 4) of lines through points, and which markers (n,)
    have all four.
    """
    for _ in range(REJECTIONS + 1):
        total = np.maximum(weights.sum(axis=2), 1e-9)
        mean = (weights[..., None] * points).sum(axis=2) / total[..., None]
        apart = points - mean[:, :, None]
        spread = np.einsum("nsp,nspi,nspj->nsij", weights, apart, apart)
        normals = np.linalg.eigh(spread)[1][..., 0]
        off = np.abs(np.einsum("nspi,nsi->nsp", apart, normals))
        median = np.nanmedian(np.where(weights > 0, off, np.inf), axis=2)
        kept, weights = weights, weights * (off <= REJECT * np.maximum(median, 1e-6)[..., None])
    enough = (kept.sum(axis=2) >= LEAST_POINTS).all(axis=1)
    return normals, np.einsum("nsi,nsi->ns", normals, mean), enough


def _crossings(normals: Array, offsets: Array, corners: Array) -> tuple[Array, Flags]:
    """Return where the lines of neighbouring sides meet (n, 4, 2), and which markers (n,) have four
    such corners.

    Corner k is between side k - 1 and side k. Where lines are nearly parallel the corner stays.
    """
    pairs = np.stack([np.roll(normals, 1, axis=1), normals], axis=2)
    sides = np.stack([np.roll(offsets, 1, axis=1), offsets], axis=2)
    steep = np.abs(np.linalg.det(pairs)) > 0.1
    solvable = np.where(steep[..., None, None], pairs, np.eye(2))
    met = np.linalg.solve(solvable, sides[..., None])[..., 0]
    return np.where(steep[..., None], met, corners), np.asarray(steep.all(axis=1))
