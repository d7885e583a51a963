"""Pictures of the head camera and the markers found in them, which ex publishes beside its telemetry. Older recordings
have none."""

import numpy as np
import rerun as rr

from companion.telemetry import Picture
from operate.pictures.happenings import Happening
from operate.pictures.sheet import Sheet, images, outlines

CAMERA, MARKERS = "camera", "camera/markers"
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
            self._sheet.static(
                CAMERA, rr.EncodedImage.from_fields(magnification_filter=rr.components.MagnificationFilter.Linear)
            )
            # A negative radius is in points of the screen.
            look = rr.LineStrips2D.from_fields(colors=[MARKED], radii=[-1.0], show_labels=False)
            self._sheet.static(MARKERS, look)
        self._sheet.add(CAMERA, images, happening.at, picture.jpeg, picture.sim_time_s)
        found = [(one.thing, np.array(one.corners).reshape(4, 2)) for one in picture.markers]
        self._sheet.add(MARKERS, outlines, happening.at, found, picture.sim_time_s)
