"""Exchanges of a run as plain rows: sender, receiver, act, subject, size, time. Pure."""

import re
from collections.abc import Callable

import msgspec

from operate.recording.history import History
from operate.recording.records import Spoken

_NUMBERS = re.compile(r"\d+(\.\d+)?")


class Said(msgspec.Struct, frozen=True):
    """A communicate. `t`: s after the first one; `kind`: class of its content; `text`: its content in a few words."""

    t: float
    channel: str
    sender: str
    receiver: str
    protocol: str
    performative: str
    conversation: str
    kind: str
    size: int
    text: str

    @property
    def meaning(self) -> tuple[str, ...]:
        """The part by which two runs are compared: who says what to whom; numbers, conversation names and sizes may
        differ.
        """
        return self.sender, self.receiver, self.protocol, self.performative, self.kind, _NUMBERS.sub("#", self.text)


def said(history: History, words: Callable[[object], str]) -> tuple[Said, ...]:
    """Return the communicates of a history in the order of time; `words`: a content in a few words."""
    return tuple(_row(one, history.begin, words) for one in history.said)


def _row(one: Spoken, begin: float, words: Callable[[object], str]) -> Said:
    content = one.content
    return Said(
        t=one.received - begin,
        channel=one.channel,
        sender=one.sender,
        receiver=one.receiver,
        protocol=one.protocol,
        performative=one.performative,
        conversation=one.conversation,
        kind="" if content is None else type(content).__name__,
        size=one.size,
        text=words(content),
    )
