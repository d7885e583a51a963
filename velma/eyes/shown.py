"""Pictures of the head camera for people."""

import cv2
import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.uint8]


QUALITY = 80  # of 100; estimate: edges are still clean


def jpeg(pixels: Pixels) -> bytes:
    """Return a picture (height, width, 3), red green blue, as a JPEG file."""
    _, made = cv2.imencode(".jpg", pixels[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    return made.tobytes()


def smaller(pixels: Pixels, factor: int) -> Pixels:
    """Return a picture (height, width, 3) `factor` times smaller; a pixel is the mean of those it covers."""
    height, width = pixels.shape[0] // factor, pixels.shape[1] // factor
    return np.asarray(cv2.resize(pixels, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
