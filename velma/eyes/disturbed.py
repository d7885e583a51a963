"""Noise, blur and exposure of a real camera."""

import cv2
import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.uint8]


def disturbed(pixels: Pixels, noise: float, blur_px: float, gain: float, rng: np.random.Generator) -> Pixels:
    """Return a picture (height, width, 3) that is blurred (standard deviation of the Gaussian in pixels), multiplied by
    `gain`, with noise (standard deviation in grey levels, each pixel by itself, alike in its three colours)."""
    if blur_px > 0.0:
        pixels = np.asarray(cv2.GaussianBlur(pixels, (0, 0), blur_px), np.uint8)
    if noise <= 0.0 and gain == 1.0:
        return pixels
    levels = gain * pixels.astype(np.float32)
    levels += np.float32(noise) * rng.standard_normal((*pixels.shape[:2], 1), np.float32)
    return np.asarray(np.clip(np.rint(levels), 0, 255), np.uint8)
