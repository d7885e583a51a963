"""Observations of a run, and what follows from them alone: who answered whom how fast.

A recorder of traffic writes observations; a design is compared with them. Nothing here knows a recorder, a wire or a
particular system.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator

import msgspec

from fipa_codec.performatives import Performative
from topdown.model import elements
from topdown.model.design import Design


class Observation(msgspec.Struct, frozen=True, omit_defaults=True):
    """A communicate that was heard once, at `at` [s, of any one clock]; `bytes` of the whole; `content` as
    LANGUAGE.Class, "" for none.
    """

    at: float
    sender: str
    receiver: str
    protocol: str
    performative: Performative
    bytes: int
    conversation: str = ""
    content: str = ""


class Observed(msgspec.Struct, frozen=True):
    """A run: its communicates in the order they were heard, names of the events its report tells of."""

    communicates: tuple[Observation, ...] = ()
    events: tuple[str, ...] = ()


class Answered(msgspec.Struct, frozen=True):
    """A conversation's opening and how long its answer took [s]; None: no answer was heard."""

    opening: Observation
    latency_s: float | None


def use_of(design: Design, one: Observation) -> elements.Protocol | None:
    """The use of a protocol a communicate belongs to; None: the design has no such message."""
    rule = design.rules.get((one.sender, one.receiver, one.protocol, one.performative))
    return None if rule is None else design.protocols[rule.use]


def answers(design: Design, said: Iterable[Observation]) -> dict[str, tuple[Answered, ...]]:
    """Use -> its openings, each with the time to its answer (elements.Protocol.answer)."""
    conversations: dict[tuple[str, str], list[Observation]] = defaultdict(list)
    for one in said:
        if (use := use_of(design, one)) is not None:
            conversations[use.name, one.conversation].append(one)
    found: dict[str, list[Answered]] = defaultdict(list)
    for (name, _), heard in conversations.items():
        found[name] += _answered(design.protocols[name], heard)
    return {name: tuple(some) for name, some in found.items()}


def _answered(use: elements.Protocol, heard: list[Observation]) -> Iterator[Answered]:
    """The opening of a conversation (the first word of its initiator; asked again is none), and what answers it."""
    opening = next((one for one in heard if one.sender == use.initiator), None)
    if opening is None:
        return
    replies = (one for one in heard if one.sender == use.participant and one.at >= opening.at)
    answer = next((one for one in replies if not use.answer or one.performative in use.answer), None)
    yield Answered(opening, None if answer is None else answer.at - opening.at)


def counts(said: Iterable[Observation]) -> Counter[tuple[str, str]]:
    """(sender, receiver) -> how many."""
    return Counter((one.sender, one.receiver) for one in said)
