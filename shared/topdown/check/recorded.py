"""A recording against the design: traffic it does not have, sizes and latencies over budget, what
was never heard.

A recorder of traffic writes observations; findings are gathered per act and content: how many, and
the worst. Must not know: a recorder, a wire.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator

import msgspec

from fipa_codec.performatives import Performative
from topdown.check.adding_up import sums
from topdown.model import elements
from topdown.model.design import Design
from topdown.model.findings import Finding, Kind


class Observation(msgspec.Struct, frozen=True, omit_defaults=True):
    """A communicate that was heard once, at `at` [s, of any one clock]; `bytes` of the whole;
    `content` as LANGUAGE.Class, "" for none.
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
    """A run: its communicates in the order they were heard, names of the events its report tells
    of.
    """

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
    """The opening of a conversation (the first word of its initiator; asked again is none), and
    what answers it.
    """
    opening = next((one for one in heard if one.sender == use.initiator), None)
    if opening is None:
        return
    replies = (one for one in heard if one.sender == use.participant and one.at >= opening.at)
    answers = (one for one in replies if not use.answer or one.performative in use.answer)
    answer = next(answers, None)
    yield Answered(opening, None if answer is None else answer.at - opening.at)


def counts(said: Iterable[Observation]) -> Counter[tuple[str, str]]:
    """(sender, receiver) -> how many."""
    return Counter((one.sender, one.receiver) for one in said)


# --- A recording against the design ---------------------------------------------------------------


def findings(design: Design, run: Observed) -> tuple[Finding, ...]:
    """All findings of one run."""
    said = run.communicates
    own = (finding for part in (_strange, _sizes, _latencies) for finding in part(design, said))
    return (*own, *sums(design, counts(said)))


def _strange(design: Design, said: Iterable[Observation]) -> Iterator[Finding]:
    """Messages that the design does not have; between agents without a channel adding_up says
    it.
    """
    odd: dict[tuple[str, str, str, str], int] = defaultdict(int)
    pairs = {frozenset(channel.ends) for channel in design.channels.values()}
    for one in said:
        if use_of(design, one) is None and frozenset((one.sender, one.receiver)) in pairs:
            odd[one.sender, one.receiver, one.protocol, str(one.performative)] += 1
    for (sender, receiver, protocol, act), count in odd.items():
        allowed = ", ".join(sorted(design.allowed(sender, receiver, protocol))) or "nothing"
        right = f"it may say {allowed} there"
        wrong = f"{count} {act} in {protocol}"
        yield Finding(Kind.NOT_DESIGNED, f"run, {sender} to {receiver}", wrong, right)


def _sizes(design: Design, said: Iterable[Observation]) -> Iterator[Finding]:
    over: dict[tuple[str, str, str, str, int], list[int]] = defaultdict(list)
    for one in said:
        rule = design.rules.get((one.sender, one.receiver, one.protocol, one.performative))
        if rule is None:
            continue
        budget = rule.sizes.get(one.content, rule.bytes)
        if 0 < budget < one.bytes:
            over[rule.use, one.sender, str(one.performative), one.content, budget].append(one.bytes)
    for (use, sender, act, content, budget), sizes in over.items():
        wrong = f"{len(sizes)} larger than {budget} B, the largest {max(sizes)} B"
        where = f"run, protocol {use}, {sender} {act}{' ' + content if content else ''}"
        right = "say it shorter, or allow more"
        yield Finding(Kind.TOO_LARGE, where, wrong, right, _place(design, use))


def _latencies(design: Design, said: Iterable[Observation]) -> Iterator[Finding]:
    for name, answered in answers(design, said).items():
        budget = design.protocols[name].latency_s
        latencies = (one.latency_s for one in answered if one.latency_s is not None)
        late = [latency for latency in latencies if 0 < budget < latency]
        if late:
            wrong = (
                f"{len(late)} of {len(answered)} answers took more than {budget:g} s, the longest"
                f" {max(late):.3g} s"
            )
            where, right = f"run, protocol {name}", "answer faster, or allow more"
            yield Finding(Kind.TOO_LATE, where, wrong, right, (*_place(design, name), "latency_s"))


def _place(design: Design, use: str) -> tuple[str | int, ...]:
    return "protocol", [entry.name for entry in design.file.protocol].index(use)
