"""Spans of a run from its messages and the steps of its agents: which conversation was opened for the sake of which.

By the step log: the agent names the parent when it opens a conversation; else it is the conversation in which it got
the message of that step, or, where that is an answer to itself, the parent of that one. Where a step took no message,
or without a log, the parent is the newest open conversation that others have with the agent: by time. Pure.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence

import msgspec
from msgspec.structs import replace

from operate.tracing.trace import SETTLED, Identity, Known, Message, Span, Step

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
        self._told = {(step.agent, opened): parent for step in steps for opened, parent in step.parents}
        self._talks = [replace(one, messages=tuple(self._all_caused(one))) for one in talks]
        self._talks.sort(key=lambda one: one.messages[0].sent)
        several = defaultdict(set)
        for one in self._talks:
            several[one.conversation].add(one.participant)
        self._ids = [
            one.conversation if len(several[one.conversation]) == 1 else f"{one.conversation}/{one.participant}"
            for one in self._talks
        ]
        self._where = {said.identity: n for n, one in enumerate(self._talks) for said in one.messages}
        self._with = {(one.conversation, one.participant): n for n, one in enumerate(self._talks)}
        self._parents: list[tuple[int | None, str]] = []

    def spans(self) -> tuple[Span, ...]:
        for talk in self._talks:  # in the order of time, so that the parent of an earlier one is known
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
            elif said.cause is None and asked is not None and said.event.partition(" ")[0] in OUTSIDE:
                said = replace(said, cause=asked.identity, known=Known.REPLY)
            yield said

    def _caused(self, said: Message) -> Message:
        step = self._step_of.get(said.identity)
        if step is None or step.event.startswith(SETTLED):
            before, event = self._before.get(said.identity), "" if step is None else step.event
            return said if before is None else replace(said, cause=before, event=event, known=Known.TIME)
        known = "" if step.took is None else Known.STEP if step.certain else Known.TIME
        return replace(said, cause=step.took, event=step.event, known=known)

    def _parent(self, talk: Talk) -> tuple[int | None, str]:
        """Return the index of the talk above, None for none, and how it is known."""
        opening = talk.messages[0]
        told = self._with.get((self._told.get((talk.initiator, talk.conversation), ""), talk.initiator))
        if told is not None and told < len(self._parents):
            return told, Known.STEP
        if opening.sender != talk.initiator:
            return self._by_time(talk)  # the opening was not recorded
        n = self._where.get(opening.cause) if opening.cause is not None and opening.known == Known.STEP else None
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
