"""The way of devices to their agent: what they post waits at the floor, what they publish goes onto the wire."""

from typing import Any

import msgspec

from agent_runtime.io import clock
from agent_runtime.io.floor import Floor
from agent_runtime.io.zenoh_wire import ZenohWire


class Posted(msgspec.Struct, frozen=True):
    """A device's word; `at` 0: now."""

    content: Any
    at: float


class Desk:
    """The outlet by which devices post and publish."""

    def __init__(self, floor: Floor, wire: ZenohWire) -> None:
        self._floor, self._wire = floor, wire

    def __call__(self, content: Any, delay_s: float = 0.0) -> None:
        self._floor.post(Posted(content, clock.now() + delay_s if delay_s > 0.0 else 0.0))

    def publish(self, kind: str, data: bytes) -> None:
        self._wire.publish(kind, data)
