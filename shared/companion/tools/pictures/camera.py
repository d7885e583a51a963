"""Pictures of the head camera, which ex publishes beside its telemetry. Older recordings have none."""

import rerun as rr

from companion.telemetry import Picture
from operate.pictures.happenings import Happening
from operate.pictures.sheet import Sheet, images

CAMERA = "camera"


class Camera:
    """Draws the pictures."""

    def __init__(self, sheet: Sheet) -> None:
        self._sheet = sheet
        self._any = False

    def take(self, happening: Happening) -> None:
        """Draw a picture; one that says another size than it has is left out."""
        picture = happening.what
        if not isinstance(picture, Picture):
            return
        try:
            pixels = picture.pixels()
        except ValueError:
            return
        if not self._any:  # enlarged smoothly: its pixels are larger than the screen's
            self._any = True
            self._sheet.static(
                CAMERA, rr.Image.from_fields(magnification_filter=rr.components.MagnificationFilter.Linear)
            )
        self._sheet.add(CAMERA, images, happening.at, (picture.width, picture.height, pixels), picture.sim_time_s)
