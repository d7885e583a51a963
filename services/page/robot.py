"""The robot as the page reaches it over Zenoh, with the identity `page`: it may hear the telemetry,
watch, and order ta.

Calls of what is heard come from threads of Zenoh. The word to ta blocks: for threads only.
"""

import base64
import secrets
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial

import msgspec

from agent_runtime.core.control import KIND, Command, SetParameter
from agent_runtime.io import sessions
from agent_runtime.io.options import Options
from agent_runtime.io.secured import client_tls
from agent_runtime.io.sessions import close, open_client
from agent_runtime.io.tap import open_ear
from companion.autonomy import STEP, Permission, Verb
from companion.design import DESIGN, AgentName
from companion.telemetry import ASK_S, Camera, Frame, RobotState, Watch, decoded

IDENTITY = "page"
ROUTER_S = 3.0
"""Longest wait for the router [s] (estimate: it answers in milliseconds)."""


class RobotEye:
    """Gives each picture to `on_picture`: its name, a data URL ("": the one before is still true),
    and when it was true [unix s]; each change of the loop's mode to `on_mode`.
    """

    def __init__(
        self,
        options: Options,
        on_picture: Callable[[str, str, float], None],
        on_mode: Callable[[str], None],
    ) -> None:
        self._options = options
        self._on_picture, self._on_mode = on_picture, on_mode
        self._mode = ""
        self._large: frozenset[str] | None = None
        self._had: dict[Camera, int] = {}
        self._over, self._changed = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._serve, name="eye", daemon=True)

    def start(self) -> None:
        """Listen as soon as the router is there."""
        self._thread.start()

    def close(self) -> None:
        """Listen no more."""
        self._over.set()
        self._changed.set()
        self._thread.join(timeout=2.0)

    def watch(self, large: frozenset[str] | None) -> None:
        """From now on people look at the pictures, at those with these names as they move; None:
        nobody looks.
        """
        if large != self._large:
            self._large = large
            self._changed.set()

    def _serve(self) -> None:
        of_ex = partial(DESIGN.signal_key, system=self._options.system, owner=AgentName.EX)
        heard = open_ear(
            self._options, of_ex("telemetry"), self._heard, self._over.is_set, IDENTITY
        )
        if heard is None:
            return
        heard.hear(of_ex("frame", peer=IDENTITY), self._seen)
        asks = DESIGN.signal_key(
            "watch", system=self._options.system, owner=IDENTITY, peer=AgentName.EX
        )
        while not self._over.is_set():
            if (large := self._large) is not None:
                heard.put(asks, msgspec.msgpack.encode(self._wish(large)))
            self._changed.wait(ASK_S)
            self._changed.clear()
        heard.close()

    def _wish(self, large: frozenset[str]) -> Watch:
        return Watch(tuple(one for one in Camera if one in large), dict(self._had))

    def _heard(self, data: bytes) -> None:
        with suppress(msgspec.MsgspecError):
            state = decoded(data)
            if isinstance(state, RobotState) and state.mode != self._mode:
                self._mode = state.mode
                self._on_mode(state.mode)

    def _seen(self, data: bytes) -> None:
        with suppress(msgspec.MsgspecError):
            frame = msgspec.msgpack.decode(data, type=Frame)
            url = data_url(frame.jpeg) if frame.jpeg else ""
            if url or self._had.get(frame.camera) == frame.number:
                self._had[frame.camera] = frame.number
                self._on_picture(frame.camera, url, time.time() - frame.age_s)


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
