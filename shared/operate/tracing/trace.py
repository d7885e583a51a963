"""Traffic of a run and its causes: messages, and conversations as the spans of a trace.

A span is one conversation of two agents. It stands below the conversation for whose sake it was
opened. Pure.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from enum import StrEnum
from functools import cached_property

import msgspec
from msgspec.structs import replace

Identity = tuple[str, str, str]
"""Sender, receiver and id of a communicate; re-sent copies share it."""

BAD = frozenset({"failure", "refuse", "not-understood", "reject-proposal"})
"""Performatives by which an agent says no."""

SETTLED = "Settled"
"""The event of a step that says what had to wait for receipts of observations: the cause had been
taken before.
"""


class Known(StrEnum):
    """Origin of a link: the step log, the protocol (an answer to what was asked), or only the order
    in time.
    """

    STEP = "step"
    REPLY = "reply"
    TIME = "time"


class Step(msgspec.Struct, frozen=True):
    """A step of an agent: the communicate it took, and those it said. `parents`: opened
    conversation -> for whose sake.

    `event`: what happened, in the words of the design. `certain`: whether `took` is from the log
    and not inferred.
    """

    agent: str
    at: float
    event: str
    took: Identity | None = None
    said: tuple[Identity, ...] = ()
    parents: tuple[tuple[str, str], ...] = ()
    certain: bool = True


class Message(msgspec.Struct, frozen=True, omit_defaults=True):
    """A communicate; times in unix seconds. `text`: its content in a few words, `reason`: the one
    it gives.

    `cause`: the communicate that its sender took in the step in which it said this, else what it
    answers; `known`: how that is known ("": there is none). `event`: what happened in that step
    otherwise.
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
    """A conversation. `id` is unique in the trace, `parent` the id of the span above it ("": none),
    `known` from where.

    `ended`: whether both sides are at an end of their protocol. `beside`: messages to conversations
    of other traces which an answer in this one caused.
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
    """An agent was gone from `start` to `end` (None: it did not come back); unix seconds. `fault`:
    done on purpose.
    """

    agent: str
    start: float
    end: float | None = None
    fault: str = ""


def is_meant(subject: str, conversation: str, participant: str) -> bool:
    """Whether a subject of `roco conversation`, `trace` or `why` names this conversation, or this
    part of one.
    """
    return subject in (conversation, f"{conversation}/{participant}")


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

    def named(self, subject: str) -> Span | None:
        """The conversation that a subject names; None where there is none."""
        meant = (one for one in self.spans if is_meant(subject, one.conversation, one.participant))
        return next(meant, None)

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


# --- Spans of a run from its messages and the steps of its agents: which conversation was opened
# for the sake of which By the step log: the agent names the parent when it opens a conversation;
# else it is the conversation in which it got the message of that step, or, where that is an answer
# to itself, the parent of that one. Where a step took no message, or without a log, the parent is
# the newest open conversation that others have with the agent: by time. Pure.


OWN = ("Started", "PeerChanged", "Ordered", "LinkChanged")
"""Events of an agent's own; what it opens then is for nobody's sake."""
OUTSIDE = ("Local", "Woken")
"""Events of a step that ends what was asked of the agent, after work of its own."""
RESTING = "subscribe"
"""A protocol whose conversations stay open while nothing is done for them."""


class Talk(msgspec.Struct, frozen=True):
    """A conversation without its place in the tree, its messages in the order of time."""

    conversation: str
    protocol: str
    channel: str
    initiator: str
    participant: str
    ended: bool
    messages: tuple[Message, ...]


def spans(talks: Sequence[Talk], steps: Iterable[Step]) -> tuple[Span, ...]:
    """Return all conversations as spans, in the order of time."""
    return _Linking(talks, tuple(steps)).spans()


class _Linking:
    def __init__(self, talks: Sequence[Talk], steps: Sequence[Step]) -> None:
        self._step_of = {said: step for step in steps for said in step.said}
        ordered = sorted((one for talk in talks for one in talk.messages), key=lambda one: one.sent)
        self._before = by_time(ordered)
        self._told = {
            (step.agent, opened): parent for step in steps for opened, parent in step.parents
        }
        self._talks = [replace(one, messages=tuple(self._all_caused(one))) for one in talks]
        self._talks.sort(key=lambda one: one.messages[0].sent)
        several = defaultdict(set)
        for one in self._talks:
            several[one.conversation].add(one.participant)
        self._ids = []
        for one in self._talks:
            alone = len(several[one.conversation]) == 1
            self._ids.append(one.conversation if alone else f"{one.conversation}/{one.participant}")
        self._where = {
            said.identity: n for n, one in enumerate(self._talks) for said in one.messages
        }
        self._with = {(one.conversation, one.participant): n for n, one in enumerate(self._talks)}
        self._parents: list[tuple[int | None, str]] = []

    def spans(self) -> tuple[Span, ...]:
        # in the order of time, so that the parent of an earlier one is known
        for talk in self._talks:
            self._parents.append(self._parent(talk))
        beside = self._beside()
        return tuple(self._span(n, talk, beside) for n, talk in enumerate(self._talks))

    def _span(self, n: int, talk: Talk, beside: Mapping[int, list[Message]]) -> Span:
        parent, known = self._parents[n]
        opening = talk.messages[0]
        return Span(
            id=self._ids[n],
            conversation=talk.conversation,
            protocol=talk.protocol,
            channel=talk.channel,
            initiator=talk.initiator,
            participant=talk.participant,
            text=opening.text if opening.sender == talk.initiator else "",
            start=opening.sent,
            end=max(one.sent for one in talk.messages),
            ended=talk.ended,
            parent="" if parent is None else self._ids[parent],
            known=known,
            messages=talk.messages,
            beside=tuple(beside.get(n, ())),
        )

    def _all_caused(self, talk: Talk) -> Iterator[Message]:
        asked: Message | None = None
        for one in talk.messages:
            said = self._caused(one)
            if one.sender == talk.initiator:
                asked = one
            elif (
                said.cause is None and asked is not None and said.event.partition(" ")[0] in OUTSIDE
            ):
                said = replace(said, cause=asked.identity, known=Known.REPLY)
            yield said

    def _caused(self, said: Message) -> Message:
        step = self._step_of.get(said.identity)
        if step is None or step.event.startswith(SETTLED):
            before, event = self._before.get(said.identity), "" if step is None else step.event
            if before is None:
                return said
            return replace(said, cause=before, event=event, known=Known.TIME)
        known = "" if step.took is None else Known.STEP if step.certain else Known.TIME
        return replace(said, cause=step.took, event=step.event, known=known)

    def _parent(self, talk: Talk) -> tuple[int | None, str]:
        """Return the index of the talk above, None for none, and how it is known."""
        opening = talk.messages[0]
        told = self._with.get(
            (self._told.get((talk.initiator, talk.conversation), ""), talk.initiator)
        )
        if told is not None and told < len(self._parents):
            return told, Known.STEP
        if opening.sender != talk.initiator:
            return self._by_time(talk)  # the opening was not recorded
        n = None
        if opening.cause is not None and opening.known == Known.STEP:
            n = self._where.get(opening.cause)
        if n is not None and n < len(self._parents):
            own = self._talks[n].participant == talk.initiator
            return (n if own else self._parents[n][0]), Known.STEP
        if opening.event.partition(" ")[0] in OWN:
            return None, ""
        return self._by_time(talk)

    def _by_time(self, talk: Talk) -> tuple[int | None, str]:
        at = talk.messages[0].sent
        for n in reversed(range(len(self._parents))):
            one = self._talks[n]
            open_then = not one.ended or at <= one.messages[-1].sent
            if one.participant == talk.initiator and one.protocol != RESTING and open_then:
                return n, Known.TIME
        return None, ""

    def _beside(self) -> dict[int, list[Message]]:
        """Messages to talks of another trace, by the talk in which their cause was said."""
        found: defaultdict[int, list[Message]] = defaultdict(list)
        for n, talk in enumerate(self._talks):
            for said in talk.messages[1:]:
                cause = None if said.cause is None else self._where.get(said.cause)
                if cause is not None and cause != n and self._root(cause) != self._root(n):
                    found[cause].append(said)
        return found

    def _root(self, n: int) -> int:
        parent = self._parents[n][0]
        return n if parent is None else self._root(parent)


def by_time(said: Sequence[Message]) -> dict[Identity, Identity]:
    """Return what may have caused each message: the newest one that its sender had heard.

    `said`: in the order of time.
    """
    causes: dict[Identity, Identity] = {}
    newest: dict[str, Identity] = {}
    for one in said:
        if one.sender in newest:
            causes[one.identity] = newest[one.sender]
        newest[one.receiver] = one.identity
    return causes
