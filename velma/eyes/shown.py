"""Pictures of the head camera for people."""

import cv2
import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.uint8]


def smaller(pixels: Pixels, factor: int) -> Pixels:
    """Return a picture (height, width, 3) `factor` times smaller; a pixel is the mean of those it covers."""
    height, width = pixels.shape[0] // factor, pixels.shape[1] // factor
    return np.asarray(cv2.resize(pixels, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
