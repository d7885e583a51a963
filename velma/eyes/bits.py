"""The patterns of markers: OpenCV's ArUco dictionaries of 4 x 4 bits. A small one is the beginning of a larger one."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

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
    raise ValueError(f"{numbers} markers of 4 x 4 bits, there are dictionaries of {list(_DICTIONARIES)}")


def plate(number: int, texels: int) -> Pixels:
    """Return the picture (n, n) of a marker's white plate, n = MODULES x `texels`; grey levels 0 and 255."""
    square = cv2.aruco.generateImageMarker(dictionary(number + 1), number, (MODULES - 2) * texels, borderBits=1)
    return np.pad(np.asarray(square, np.uint8), texels, constant_values=255)
