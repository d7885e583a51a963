"""What is seen in a picture: bodies by name with pose and covariance, and the markers that tell.

A body is believed only through a gate: two or more markers, corners that fit together, and a place
that is determined well. A single wrong reading passes none of them.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from velma.eyes import content, detect
from velma.eyes.detect import Detector
from velma.eyes.fit import FLOOR_PX, View, fit, largest, poses
from velma.model.kinds import FURNITURE
from velma.model.markers import Marker, of_scene
from velma.model.scene import Scene

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]

LEAST_MARKERS, MOST_RMS_PX, MOST_SIDEWAYS_M, MOST_DEVIATION_M = 2, 1.0, 0.020, 0.005
"""The gate: number of markers, corners' deviation, and how far the place moves to the side per
pixel of the corners' error (a wrong reading that put a thing 2.5 m away was stopped by this alone)
and in all: the pour needs 5 mm.
"""
TIPPED_PX, TIPPED_SHARE = 0.3, 0.5
"""Corners of a thing that fit worse than this, and by half better with 6 unknowns, are those of one
that is tipped.
"""


class Seen(NamedTuple):
    """A body: its pose (rotation, position) in the world, the covariance of (x, y, z, yaw) or, of a
    `tipped` one, of (x, y, z, rotation about x, y, z) [m, rad], the numbers of its markers that
    were found.
    """

    name: str
    rotation: Array
    position: Array
    covariance: Array
    tipped: bool
    rms_px: float
    numbers: tuple[int, ...]


def eyes_of(scene: Scene) -> "Eyes":
    """Return the eyes for the things of a scene."""
    furniture = frozenset(thing.id for thing in scene.of(*FURNITURE))
    openings = {
        thing.id: hole
        for thing in scene.things
        if (hole := content.opening(thing.model)) is not None
    }
    return Eyes(of_scene(scene), furniture, openings)


class Eyes:
    """Sees bodies with `markers` by name. `furniture`: those that always stand upright; `openings`:
    radius and height [m] of the circle through which one looks into a body.
    """

    def __init__(
        self,
        markers: Mapping[str, Sequence[Marker]],
        furniture: frozenset[str],
        openings: Mapping[str, tuple[float, float]],
    ) -> None:
        self._of = {name: {one.number: one for one in every} for name, every in markers.items()}
        self._furniture, self._openings = furniture, openings
        self._detector = Detector(number for every in self._of.values() for number in every)

    def owner(self, number: int) -> str:
        """Return the name of the body with the marker of this number."""
        return next(name for name, markers in self._of.items() if number in markers)

    def content(self, seen: Seen, pixels: Pixels, view: View) -> content.Content | None:
        """Return what is seen in a body; None for one that cannot be looked into from there."""
        hole = self._openings.get(seen.name)
        if hole is None or seen.tipped:
            return None
        edge = content.circle(*hole) @ seen.rotation.T + seen.position
        return content.seen_content(pixels, view, edge)

    def markers(self, pixels: Pixels) -> dict[int, Array]:
        """Return the markers in a picture (height, width, 3), red green blue: fine corners (4, 2)
        by number.
        """
        grey = np.asarray(cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY), np.uint8)
        rough = self._detector.find(grey)
        if not rough:
            return {}
        fine, good = detect.refined(grey, np.array(list(rough.values())))
        return {number: at for number, at, fits in zip(rough, fine, good, strict=True) if fits}

    def bodies(self, found: Mapping[int, Array], view: View) -> list[Seen]:
        """Return the bodies that the markers `found` tell of."""
        seen = (self._body(name, found, view) for name in self._of)
        return [one for one in seen if one is not None]

    def _body(self, name: str, found: Mapping[int, Array], view: View) -> Seen | None:
        markers = [one for number, one in self._of[name].items() if number in found]
        if len(markers) < LEAST_MARKERS:
            return None
        at = {one.number: found[one.number] for one in markers}
        main = largest(at)
        starts = poses(view, self._of[name][main], at[main])
        corners = np.concatenate([one.corners for one in markers])
        pixels = np.concatenate(list(at.values()))
        stands = fit(view, corners, pixels, starts[0], upright=True)
        best, tipped = stands, False
        if name not in self._furniture and (stands is None or stands.rms_px > TIPPED_PX):
            fits = (fit(view, corners, pixels, start, upright=False) for start in starts)
            leaning = (one for one in fits if one is not None)
            lies = min(leaning, key=lambda one: one.rms_px, default=None)
            tipped = lies is not None and (
                stands is None or lies.rms_px < TIPPED_SHARE * stands.rms_px
            )
            best = lies if tipped else stands
        if best is None or best.rms_px >= MOST_RMS_PX or best.sideways() >= MOST_SIDEWAYS_M:
            return None
        if best.sideways() * max(FLOOR_PX, best.rms_px) >= MOST_DEVIATION_M:
            return None
        return Seen(
            name, best.rotation, best.position, best.covariance(), tipped, best.rms_px, tuple(at)
        )
