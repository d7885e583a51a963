"""Traffic of a run and its causes: messages, and conversations as the spans of a trace.

A span is one conversation of two agents. It stands below the conversation for whose sake it was opened. Pure.
"""

from collections import defaultdict
from collections.abc import Iterator
from enum import StrEnum
from functools import cached_property

import msgspec

Identity = tuple[str, str, str]
"""Sender, receiver and id of a communicate; re-sent copies share it."""

BAD = frozenset({"failure", "refuse", "not-understood", "reject-proposal"})
"""Performatives by which an agent says no."""

SETTLED = "Settled"
"""The event of a step that says what had to wait for receipts of observations: the cause had been taken before."""


class Known(StrEnum):
    """Origin of a link: the step log, the protocol (an answer to what was asked), or only the order in time."""

    STEP = "step"
    REPLY = "reply"
    TIME = "time"


class Step(msgspec.Struct, frozen=True):
    """A step of an agent: the communicate it took, and those it said. `parents`: opened conversation -> for whose sake.

    `event`: what happened, in the words of the design. `certain`: whether `took` is from the log and not inferred.
    """

    agent: str
    at: float
    event: str
    took: Identity | None = None
    said: tuple[Identity, ...] = ()
    parents: tuple[tuple[str, str], ...] = ()
    certain: bool = True


class Message(msgspec.Struct, frozen=True, omit_defaults=True):
    """A communicate; times in unix seconds. `text`: its content in a few words, `reason`: the one it gives.

    `cause`: the communicate that its sender took in the step in which it said this, else what it answers; `known`: how
    that is known ("": there is none). `event`: what happened in that step otherwise.
    """

    sender: str
    receiver: str
    id: str
    performative: str
    protocol: str
    channel: str
    conversation: str
    sent: float
    heard: float
    text: str = ""
    reason: str = ""
    cause: Identity | None = None
    event: str = ""
    known: str = ""

    @property
    def identity(self) -> Identity:
        """The key shared by re-sent copies."""
        return self.sender, self.receiver, self.id


class Span(msgspec.Struct, frozen=True, omit_defaults=True):
    """A conversation. `id` is unique in the trace, `parent` the id of the span above it ("": none), `known` from where.

    `ended`: whether both sides are at an end of their protocol. `beside`: messages to conversations of other traces
    which an answer in this one caused.
    """

    id: str
    conversation: str
    protocol: str
    channel: str
    initiator: str
    participant: str
    text: str
    start: float
    end: float
    ended: bool
    parent: str = ""
    known: str = ""
    messages: tuple[Message, ...] = ()
    beside: tuple[Message, ...] = ()

    @property
    def last(self) -> Message:
        """The newest message of the participant, else of the initiator."""
        theirs = [one for one in self.messages if one.sender == self.participant]
        return (theirs or self.messages)[-1]

    @property
    def bad(self) -> bool:
        """Whether it ended with a no."""
        return self.ended and self.last.performative in BAD


class Away(msgspec.Struct, frozen=True, omit_defaults=True):
    """An agent was gone from `start` to `end` (None: it did not come back); unix seconds. `fault`: done on purpose."""

    agent: str
    start: float
    end: float | None = None
    fault: str = ""


class Trace(msgspec.Struct, frozen=True, omit_defaults=True, dict=True):
    """All of a run. `begin`: the first communicate [unix s]."""

    system: str
    begin: float
    spans: tuple[Span, ...] = ()
    away: tuple[Away, ...] = ()

    @property
    def roots(self) -> tuple[Span, ...]:
        """Spans that no other one caused, oldest first."""
        return tuple(span for span in self.spans if not span.parent)

    @cached_property
    def _children(self) -> dict[str, list[Span]]:
        found: defaultdict[str, list[Span]] = defaultdict(list)
        for span in self.spans:
            found[span.parent].append(span)
        return dict(found)

    def children(self, span: Span) -> tuple[Span, ...]:
        """Spans right below one, oldest first."""
        return tuple(self._children.get(span.id, ()))

    def below(self, span: Span, depth: int = 0) -> Iterator[tuple[int, Span]]:
        """A span and all below it, depth first, each with its depth."""
        yield depth, span
        for one in self.children(span):
            yield from self.below(one, depth + 1)

    @cached_property
    def messages(self) -> dict[Identity, Message]:
        """All messages by identity."""
        return {one.identity: one for span in self.spans for one in span.messages}
