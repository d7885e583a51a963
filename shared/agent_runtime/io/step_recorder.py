"""The record of an agent's steps for people and for replay, written in the next pause: log lines
and the step log.

Nobody waits for it, so nothing of it stands between a message and its answer. A kill -9 takes what
was not written.
"""

from collections.abc import Iterator
from typing import Any

import msgspec

from agent_runtime.core.effects import Effects
from agent_runtime.core.events import AnyEvent, Arrived, Received
from agent_runtime.core.state import CoreState
from agent_runtime.core.wiring import Delivery, Wiring
from agent_runtime.io.logs import Log
from agent_runtime.io.steplog import StepLog, noted
from fipa_codec.communicate import Communicate

MOST_UNWRITTEN = 64
"""Steps after which logs are written though there is no pause; 6 to 11 us each, warm, for which who
asks next waits.
"""
MOST_HEARD = 512 * 1024
"""Bytes of content in such steps; with more they are copied into the step log's buffer at once.
Else the next message has to take other memory, which is in no cache: 852 kB took 1.50 instead of
1.43 of a get (benchmarks/as_shipped.py).
"""
MOST_SAID = 8 * 1024 * 1024
"""Bytes of communicates in such steps, after which logs are written, too: they wait longer, since
to hash them takes time of those who hear them. Estimate: ten of the largest answers (852 kB).
"""


class _Done(msgspec.Struct, frozen=True):
    """A step that is carried out and not written down yet; `sizes`: bytes of each communicate sent.

    It holds no decoded content: that may be as large as the message and is free for the next one at
    once.
    """

    event: AnyEvent
    at: float
    incarnation: int
    step: int
    effects: Effects
    sizes: list[int]
    received: Communicate | None


class StepRecorder:
    """The steps of one agent that are not written down yet, and where they go."""

    def __init__(self, log: Log, steps: StepLog, wiring: Wiring) -> None:
        self._log, self._steps, self._wiring = log, steps, wiring
        self._without_log = wiring.groups
        self._unwritten: list[_Done] = []
        self._noted = self._heard = self._said = 0

    @property
    def pending(self) -> bool:
        """Whether something is to be written."""
        return bool(self._unwritten) or self._steps.waiting > 0

    @property
    def trouble(self) -> str:
        """The reason why steps are not written down, in words; "" if they are."""
        steps = self._steps
        return f"{steps.trouble}; steps that its log lacks: {steps.lost}" if steps.trouble else ""

    @property
    def full(self) -> bool:
        """Whether it must be written without waiting for a pause."""
        return self._noted >= MOST_UNWRITTEN or self._said >= MOST_SAID

    def note(
        self, event: AnyEvent, at: float, after: CoreState, effects: Effects, sizes: list[int]
    ) -> None:
        """Keep a step in mind; `sizes`: bytes of each communicate sent."""
        received = effects.handled.communicate if isinstance(effects.handled, Received) else None
        rest = msgspec.structs.replace(effects, handled=None)
        self._unwritten.append(
            _Done(event, at, after.incarnation, after.soft.step, rest, sizes, received)
        )
        heard = event.communicate if isinstance(event, Arrived) else received
        content = b"" if heard is None or heard.content is msgspec.UNSET else heard.content
        self._noted += 1
        self._heard += len(content)
        self._said += sum(sizes)
        if self._heard >= MOST_HEARD:
            self._put_down()

    def write(self) -> None:
        self._put_down()
        self._steps.flush()
        self._noted = 0

    def _put_down(self) -> None:
        done, self._unwritten, self._heard, self._said = self._unwritten, [], 0, 0
        lines = [line for one in done for line in self._lines(one)]
        if lines:
            self._log.write_all(lines)
        self._steps.write(
            noted(
                one.incarnation,
                one.step,
                one.at,
                one.event,
                one.effects,
                one.received,
                one.sizes,
                self._without_log,
            )
            for one in done
        )

    def _lines(self, one: _Done) -> Iterator[tuple[float, str, str, dict[str, Any]]]:
        if one.received is not None:
            yield one.at, *self._spoken("received", one.received, 0)
        for line in one.effects.logs:
            yield one.at, line.event, line.level, line.fields
        for sent, size in zip(one.effects.sends, one.sizes, strict=True):
            yield one.at, *self._spoken("sent", sent, size)

    def _spoken(
        self, event: str, communicate: Communicate, size: int
    ) -> tuple[str, str, dict[str, Any]]:
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
