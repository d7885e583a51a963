"""Robot telemetry that people see: pictures of the head camera and of the robot, and the mode of the control loop.

Heard from Zenoh with the identity `page`, which may hear this key and nothing else. Calls come from threads of Zenoh.
"""

import base64
import threading
from collections.abc import Callable

import msgspec

from agent_runtime.io.options import Options
from agent_runtime.io.tap import open_ear
from companion.design import DESIGN, AgentName
from companion.telemetry import Picture, RobotState, decoded
from services.page.view import PICTURE, ROOM

IDENTITY = "page"


class RobotEye:
    """Gives each picture (its name, a data URL) to `on_picture`, each change of the loop's mode to `on_mode`."""

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
        key = DESIGN.signal_key("telemetry", system=self._options.system, owner=AgentName.EX)
        ear = open_ear(self._options, key, self._heard, self._over.is_set, IDENTITY)
        if ear is not None:
            self._over.wait()
            ear.close()

    def _heard(self, data: bytes) -> None:
        try:
            match decoded(data):
                case RobotState(mode=mode):
                    if mode != self._mode:
                        self._mode = mode
                        self._on_mode(mode)
                case Picture(jpeg=seen, room=room):
                    self._on_picture(PICTURE, data_url(seen))
                    self._on_picture(ROOM, data_url(room))
        except msgspec.MsgspecError:
            return


def data_url(jpeg: bytes) -> str:
    """Return a picture as an address (RFC 2397)."""
    return f"data:image/jpeg;base64,{base64.b64encode(jpeg).decode()}"
