"""Finds markers in a picture: OpenCV's ArUco detector with whole-pixel corners, which `edges` then makes finer.

The detector's own refinement (CORNER_REFINE_SUBPIX) is not used: its corners are off by 0.4 pixels, ten times as much
as those of an edge fit (docs/decisions/2026-11-25-eyes.md).
"""

from collections.abc import Iterable

import cv2
import numpy as np
from numpy.typing import NDArray

from velma.eyes import bits

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]


class Detector:
    """Finds the markers with these `numbers`; others are taken for wrong readings."""

    def __init__(self, numbers: Iterable[int]) -> None:
        self._numbers = frozenset(numbers)
        settings = cv2.aruco.DetectorParameters()
        settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_NONE
        dictionary = bits.dictionary(max(self._numbers, default=0) + 1)
        self._detector = cv2.aruco.ArucoDetector(dictionary, settings)

    def find(self, grey: Pixels) -> dict[int, Array]:
        """Return corners (4, 2) [pixels] by number, in the order of velma.model.markers; `grey` is (height, width).

        A number that is found twice is left out: one of them is wrong.
        """
        corners, numbers, _ = self._detector.detectMarkers(grey)
        read = [] if numbers is None else [int(number) for number in numbers.ravel()]
        return {
            number: np.asarray(at, np.float64).reshape(4, 2)
            for number, at in zip(read, corners, strict=True)
            if number in self._numbers and read.count(number) == 1
        }
