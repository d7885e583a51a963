"""Events of a run in the order of time: from records as they come, or from a whole history.

Must not know: who draws or tells them.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import msgspec

from fipa_codec.communicate import UNREADABLE
from operate.recording.history import History, state_in
from operate.recording.records import House, Record, Spoken, Token, fault_in
from operate.system import System


class Lost(msgspec.Struct, frozen=True):
    """So many samples in all could not be shown: drawing was too slow. They are in the
    recording.
    """

    samples: int


What = Any
"""Spoken, Judged, Entered, Fault, Lost, or what the system tells on house keys
(Additions.telemetry).
"""


class Happening(msgspec.Struct, frozen=True):
    """Something at `at` [unix s]."""

    at: float
    what: What


class Reader:
    """Reads records as they come; remembers agents' states, to tell what is new."""

    def __init__(self, system: System) -> None:
        self._decoders: Mapping[str, Callable[[bytes], Any]] = system.addition("telemetry") or {}
        self._states: dict[str, tuple[str, bool]] = {}

    def read(self, record: Record) -> Iterator[Happening]:
        """Yield the events of a record; none for what is not drawn or cannot be read."""
        if isinstance(record, Spoken):
            yield Happening(record.received, record)
        elif (fault := fault_in(record)) is not None:
            yield Happening(fault.began if fault.ended is None else fault.ended, fault)
        elif isinstance(record, House) and record.kind in self._decoders:
            try:
                yield Happening(record.received, self._decoders[record.kind](record.data))
            except UNREADABLE:
                return
        elif isinstance(record, House | Token):
            yield from self._state(record)

    def _state(self, record: House | Token) -> Iterator[Happening]:
        now = state_in(record, self._states)
        if now is not None and self._states.get(now.agent) != (now.state, now.alive):
            self._states[now.agent] = (now.state, now.alive)
            yield Happening(now.at, now)


def of_history(history: History) -> list[Happening]:
    """Everything of a recorded run."""
    found = [Happening(one.received, one) for one in (*history.said, *history.copies)]
    found += [Happening(one.t, one) for one in history.judged]
    found += [Happening(at, one) for at, one in history.signals]
    found += [Happening(one.at, one) for one in history.entered]
    for fault in history.faults:
        found.append(Happening(fault.began, msgspec.structs.replace(fault, ended=None)))
        if fault.ended is not None:
            found.append(Happening(fault.ended, fault))
    return sorted(found, key=lambda one: one.at)
