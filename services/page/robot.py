"""The robot as the page reaches it over Zenoh, with the identity `page`: it may hear the telemetry,
and order ta.

Calls of what is heard come from threads of Zenoh. The word to ta blocks: for threads only.
"""

import base64
import secrets
import threading
import time
from collections.abc import Callable

import msgspec

from agent_runtime.core.control import KIND, Command, SetParameter
from agent_runtime.io import sessions
from agent_runtime.io.options import Options
from agent_runtime.io.secured import client_tls
from agent_runtime.io.sessions import close, open_client
from agent_runtime.io.tap import open_ear
from companion.autonomy import STEP, Permission, Verb
from companion.design import DESIGN, AgentName
from companion.telemetry import Picture, RobotState, decoded
from services.page.view import PICTURE, ROOM

IDENTITY = "page"
ROUTER_S = 3.0
"""Longest wait for the router [s] (estimate: it answers in milliseconds)."""


class RobotEye:
    """Gives each picture (its name, a data URL) to `on_picture`, each change of the loop's mode to
    `on_mode`.
    """

    def __init__(
        self,
        options: Options,
        on_picture: Callable[[str, str], None],
        on_mode: Callable[[str], None],
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


class RobotWord:
    """Sender of the operator's word. What hi tells next shows whether ta took it; a repeated word
    does nothing.
    """

    def __init__(self, options: Options) -> None:
        self._options = options
        self._key = DESIGN.signal_key(
            KIND, system=options.system, owner=IDENTITY, peer=AgentName.TA
        )

    def go(self, at: str) -> bool:
        """Let the act at this path of the plan begin. Return whether the router took the word."""
        until = time.monotonic() + ROUTER_S
        tls = client_tls(self._options.keys, IDENTITY) if self._options.keys else None
        session = open_client(self._options.connect, lambda: time.monotonic() > until, tls=tls)
        if session is None:
            return False
        order = SetParameter(STEP, str(Permission(Verb.GO, at)))
        command = Command(f"page-{secrets.token_hex(8)}", order)
        sessions.put(session, self._key, msgspec.msgpack.encode(command))
        close(session)
        return True
