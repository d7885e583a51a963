"""Pictures of the head camera, with the errors of a real one, and as people get them."""

import cv2
import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.uint8]

QUALITY = 80  # of 100; estimate: edges are still clean


def disturbed(
    pixels: Pixels, noise: float, blur_px: float, gain: float, rng: np.random.Generator
) -> Pixels:
    """Return a picture (height, width, 3) that is blurred (standard deviation of the Gaussian in
    pixels), multiplied by `gain`, with noise (standard deviation in grey levels, each pixel by
    itself, alike in its three colours).
    """
    if blur_px > 0.0:
        pixels = np.asarray(cv2.GaussianBlur(pixels, (0, 0), blur_px), np.uint8)
    if noise <= 0.0 and gain == 1.0:
        return pixels
    levels = gain * pixels.astype(np.float32)
    levels += np.float32(noise) * rng.standard_normal((*pixels.shape[:2], 1), np.float32)
    return np.asarray(np.clip(np.rint(levels), 0, 255), np.uint8)


def jpeg(pixels: Pixels) -> bytes:
    """Return a picture (height, width, 3), red green blue, as a JPEG file."""
    _, made = cv2.imencode(".jpg", pixels[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    return made.tobytes()


def smaller(pixels: Pixels, factor: int) -> Pixels:
    """Return a picture (height, width, 3) `factor` times smaller; a pixel is the mean of those it
    covers.
    """
    height, width = pixels.shape[0] // factor, pixels.shape[1] // factor
    return np.asarray(cv2.resize(pixels, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
