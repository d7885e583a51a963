"""Pictures of the head camera and the markers found in them, which ex publishes beside its
telemetry. Older recordings have none.

The camera is a part of the robot, so the 3D view has its field of view, with the picture across it.
"""

import math

import numpy as np
import rerun as rr

from companion.telemetry import Picture
from companion.tools.pictures import robot
from companion.tools.pictures.velma import entity
from operate.pictures.sheet import GREY, Sheet, images, outlines
from operate.pictures.stage import Happening
from velma.names import CAMERA_BODY

CAMERA = f"{entity(next(link for link in robot.links() if link.name == CAMERA_BODY))}/camera"
MARKERS = f"{CAMERA}/markers"
SIZE = (400, 300)
"""Pixels of a picture for people: half of velma.eyes.lens.WIDTH and HEIGHT
(services.executor.telemetry.SHRINK).
"""
FOCAL = SIZE[0] / 2 / math.tan(1.047 / 2)  # velma.eyes.lens.HALF_WIDTH
BEFORE_M = 0.22
"""Distance of the picture from the camera in the 3D view; estimate: readable, and before the head,
not the hands.
"""
MARKED = (64, 220, 120)  # a green that neither wood, glass nor the bowl has


class Camera:
    """Draws the pictures."""

    def __init__(self, sheet: Sheet) -> None:
        self._sheet = sheet
        self._any = False

    def take(self, happening: Happening) -> None:
        """Draw a picture."""
        picture = happening.what
        if not isinstance(picture, Picture):
            return
        if not self._any:  # enlarged smoothly: its pixels are larger than the screen's
            self._any = True
            linear = rr.components.MagnificationFilter.Linear
            self._sheet.static(CAMERA, rr.EncodedImage.from_fields(magnification_filter=linear))
            # A negative radius is in points of the screen.
            lens = rr.Pinhole(
                resolution=SIZE, focal_length=FOCAL, image_plane_distance=BEFORE_M, color=GREY
            )
            self._sheet.static(CAMERA, lens)
            look = rr.LineStrips2D.from_fields(colors=[MARKED], radii=[-1.0], show_labels=False)
            self._sheet.static(MARKERS, look)
        self._sheet.add(CAMERA, images, happening.at, picture.jpeg, picture.sim_time_s)
        found = [(one.thing, np.array(one.corners).reshape(4, 2)) for one in picture.markers]
        self._sheet.add(MARKERS, outlines, happening.at, found, picture.sim_time_s)
