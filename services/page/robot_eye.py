"""Robot telemetry that people see: pictures of the head camera and of the robot, and the mode of the control loop.

Heard from Zenoh with the identity `page`, which may hear this key and nothing else. Calls come from threads of Zenoh.
"""

import base64
import struct
import threading
import zlib
from collections.abc import Callable

import msgspec

from agent_runtime.io.options import Options
from agent_runtime.io.tap import open_ear
from companion.design import DESIGN, AgentName
from companion.telemetry import Picture, RobotState, RoomPicture, told
from services.page.view import PICTURE, ROOM

IDENTITY = "page"


class RobotEye:
    """Gives each picture (its name, a data URL) to `on_picture`, and each change of the control loop's mode to `on_mode`."""

    def __init__(
        self, options: Options, on_picture: Callable[[str, str], None], on_mode: Callable[[str], None]
    ) -> None:
        self._options = options
        self._on_picture, self._on_mode = on_picture, on_mode
        self._mode = ""
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="eye", daemon=True)

    def start(self) -> None:
        """Listen as soon as the router is there."""
        self._thread.start()

    def close(self) -> None:
        """Listen no more."""
        self._over.set()
        self._thread.join(timeout=2.0)

    def _serve(self) -> None:
        key = DESIGN.house_key("telemetry", system=self._options.system, owner=AgentName.EX)
        ear = open_ear(self._options, key, self._heard, self._over.is_set, IDENTITY)
        if ear is not None:
            self._over.wait()
            ear.close()

    def _heard(self, data: bytes) -> None:
        try:
            match told(data):
                case RobotState(mode=mode):
                    if mode != self._mode:
                        self._mode = mode
                        self._on_mode(mode)
                case Picture() as picture:
                    self._on_picture(PICTURE, data_url("png", png(picture)))
                case RoomPicture(jpeg=jpeg):
                    self._on_picture(ROOM, data_url("jpeg", jpeg))
        except (msgspec.MsgspecError, ValueError):
            return


def data_url(form: str, picture: bytes) -> str:
    """Return a picture in its place as an address (RFC 2397)."""
    return f"data:image/{form};base64,{base64.b64encode(picture).decode()}"


def png(picture: Picture) -> bytes:
    """Return a picture as PNG (RFC 2083); it is small, so that the standard library does. Raise ValueError."""
    pixels, row = picture.pixels(), 3 * picture.width
    rows = b"".join(b"\0" + pixels[at : at + row] for at in range(0, len(pixels), row))
    head = struct.pack(">IIBBBBB", picture.width, picture.height, 8, 2, 0, 0, 0)
    parts = ((b"IHDR", head), (b"IDAT", zlib.compress(rows)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data)) for name, data in parts
    )
