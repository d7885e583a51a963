"""What an agent did, written down for people and for replaying in the next pause: log lines and the step log.

Nobody waits for it, so nothing of it stands between a message and its answer. A kill -9 takes what was not written.
"""

from typing import Any

import msgspec

from agent_runtime.effects import Effects
from agent_runtime.events import AnyEvent, Received
from agent_runtime.logs import Log
from agent_runtime.state import CoreState
from agent_runtime.steplog import StepLog
from agent_runtime.wiring import Delivery, Wiring
from fipa_codec.communicate import Communicate

MOST_UNWRITTEN = 64
"""Steps after which logs are written though there is no pause; the largest answer 16 times over is 14 MB (estimate)."""


class _Done(msgspec.Struct, frozen=True):
    """A step that is carried out and not written down yet; `sizes`: bytes of each communicate sent.

    It holds no decoded content: that may be as large as the message and is free for the next one at once.
    """

    event: AnyEvent
    at: float
    incarnation: int
    step: int
    effects: Effects
    sizes: list[int]
    received: Communicate | None


class Diary:
    """The steps of one agent that are not written down yet, and where they go."""

    def __init__(self, log: Log, steps: StepLog, wiring: Wiring) -> None:
        self._log, self._steps, self._wiring = log, steps, wiring
        self._unwritten: list[_Done] = []

    @property
    def pending(self) -> bool:
        """Whether something is to be written."""
        return bool(self._unwritten)

    @property
    def full(self) -> bool:
        """Whether it must be written without waiting for a pause."""
        return len(self._unwritten) >= MOST_UNWRITTEN

    def note(self, event: AnyEvent, at: float, after: CoreState, effects: Effects, sizes: list[int]) -> None:
        """Keep a step in mind; `sizes`: bytes of each communicate sent."""
        received = effects.handled.communicate if isinstance(effects.handled, Received) else None
        rest = msgspec.structs.replace(effects, handled=None)
        self._unwritten.append(_Done(event, at, after.incarnation, after.soft.step, rest, sizes, received))

    def write(self) -> None:
        """Write what is not written."""
        done, self._unwritten = self._unwritten, []
        for one in done:
            effects = one.effects
            lines = [(line.event, line.level, line.fields) for line in effects.logs]
            lines += [self._spoken("sent", *sent) for sent in zip(effects.sends, one.sizes, strict=True)]
            if one.received is not None:
                lines.insert(0, self._spoken("received", one.received, 0))
            if lines:
                self._log.write_all(lines, one.at)
            self._steps.step(one.incarnation, one.step, one.at, one.event, effects)

    def _spoken(self, event: str, communicate: Communicate, size: int) -> tuple[str, str, dict[str, Any]]:
        peer = communicate.receiver if event == "sent" else communicate.sender
        link = self._wiring.link(peer, communicate.protocol)
        durable = link is not None and link.delivery is Delivery.DURABLE
        fields = {
            "performative": str(communicate.performative),
            "peer": peer,
            "protocol": communicate.protocol,
            "language": communicate.language,
            "id": communicate.id,
            "bytes": size or None,
            "conversation": communicate.conversation,
        }
        return event, "info" if durable else "debug", fields
