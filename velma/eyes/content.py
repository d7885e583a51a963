"""How much is in an open vessel, by the share of its opening that has the colour of the content.

One grain alone is seen; of a pile only the upper ones are. So the amount is right to some grains,
not to one, and of much content it is a lower bound.
"""

import math
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from velma.eyes.fit import View
from velma.model.kinds import Model, objects

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]

FIRST_HUE, LAST_HUE, LEAST_SATURATION, SPECK_PX = 14, 32, 90, 3
"""Colours of grains in light and shadow, on OpenCV's scales (0-180, 0-255), and width of the median
that takes noise away: with them no grain is ever seen in an empty bowl (trial).
"""
PER_SHARE, PER_SHARE_SQUARED = 128.0, 152.0
"""Grains by the share of the opening that they cover: one layer, and what is hidden below it.
Fitted to 68 piles of up to 30 grains that fell into the bowl from 2 to 12 cm, in its middle or
beside: rms 2.1, at most 5.3 grains off.
"""
LEAST_RISE, LOW_RISE = math.radians(47.0), math.radians(35.0)
"""From where a vessel is looked into, above the horizontal: from lower down its near wall hides too
much (piles were 10 grains off), and what is seen is a lower bound. From below the second one,
hardly anything is seen (at 37 degrees 3 to 23 of 30 grains).
"""
# from the rim's outer edge to the circle that is looked into; estimates
INSIDE_M, BELOW_M = 0.007, 0.004
CORNERS = 48  # of that circle


def opening(model: Model) -> tuple[float, float] | None:
    """Return radius and height [m] of the circle through which one looks into a vessel of this
    model.

    None for models that are looked through, or have no opening.
    """
    shape = objects()[model.value]
    return (
        (shape["rim_radius"] - INSIDE_M, shape["height"] - BELOW_M)
        if "rim_radius" in shape
        else None
    )


def circle(radius: float, height: float) -> Array:
    """Return points (CORNERS, 3) on an opening, in the vessel's frame."""
    around = np.linspace(0.0, 2 * np.pi, CORNERS, endpoint=False)
    return np.column_stack(
        [radius * np.cos(around), radius * np.sin(around), np.full(CORNERS, height)]
    )


class Content(NamedTuple):
    """The mass [kg] of what is seen in a vessel; `whole`: of all that is in it, else there may be
    more.
    """

    mass: float
    whole: bool


def seen_content(pixels: Pixels, view: View, edge: Array) -> Content | None:
    """Return the content seen through an opening; `edge` (n, 3): points on it in the world.

    `pixels`: (height, width, 3), red green blue. None where the opening is not in the picture as a
    whole, or is looked at from too low down.
    """
    above = rise(view.position, edge)
    if above < LOW_RISE:
        return None
    share = _covered(pixels, view, edge)
    return None if share is None else Content(mass(share), above >= LEAST_RISE)


def rise(eye: Array, edge: Array) -> float:
    """Return how high above the horizontal [rad] an eye (3,) is, seen from an opening with the
    `edge` (n, 3).
    """
    way = eye - edge.mean(axis=0)
    return math.atan2(way[2], math.hypot(way[0], way[1]))


def mass(share: float) -> float:
    """Return the mass [kg] of a pile that covers this share of an opening."""
    return float(objects()["grain"]["mass"] * (PER_SHARE * share + PER_SHARE_SQUARED * share**2))


def _covered(pixels: Pixels, view: View, edge: Array) -> float | None:
    """Return the share of the opening that shows content."""
    inside = view.inside(edge)
    if inside[:, 2].min() <= 0.0:
        return None
    corners = np.rint(view.lens.project(inside)).astype(np.int32)
    left, top = corners.min(axis=0)
    right, bottom = corners.max(axis=0) + 1
    if left < 0 or top < 0 or right > pixels.shape[1] or bottom > pixels.shape[0]:
        return None
    cut = cv2.cvtColor(np.ascontiguousarray(pixels[top:bottom, left:right]), cv2.COLOR_RGB2HSV)
    low, high = np.array([FIRST_HUE, LEAST_SATURATION, 0]), np.array([LAST_HUE, 255, 255])
    coloured = cv2.medianBlur(cv2.inRange(cut, low, high), SPECK_PX)
    within = np.zeros(coloured.shape, np.uint8)
    cv2.fillConvexPoly(within, corners - np.array([left, top], np.int32), 255)
    return float(np.mean(coloured[within > 0] > 0))
