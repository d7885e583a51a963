"""A recording against the design: traffic it does not have, sizes and latencies over budget, what
was never heard.

A recorder of traffic writes observations; findings are gathered per act and content: how many, and
the worst. Must not know: a recorder, a wire.
"""

import math
from collections import Counter, defaultdict, deque
from collections.abc import Iterable, Iterator, Mapping

import msgspec

from fipa_codec.exploration import Configuration, Step, edges
from fipa_codec.performatives import Performative
from fipa_codec.tables import Protocol, Role, Way
from topdown.check.protocols import listed, restricted
from topdown.model import elements
from topdown.model.design import Design
from topdown.model.findings import Finding, Kind

# --- Counts: traffic has a channel, every direction is used, answers match questions --------------
# How many messages the two roles of a protocol exchange is bound by its table: over all complete
# conversations, what the initiator says less what the participant says lies between two figures,
# found as the cheapest and the dearest way through the product of both roles (shortest ways over
# fipa_codec.exploration's configurations; questions asked again are left out). A run in which all
# conversations ended cannot be outside of what they allow.


Counts = Mapping[tuple[str, str], int]
ON_THE_WAY = 1
"""Messages on their way to one role: enough for two that cross; more changed no bound (tried: 1 and
2).
"""
Walked = Mapping[Configuration, list[tuple[Step, Configuration]]]


def sums(design: Design, counts: Counts, where: str = "run") -> Iterator[Finding]:
    """Of any counts: (sender, receiver) -> how many."""
    pairs = {frozenset(channel.ends): channel.id for channel in design.channels.values()}
    for (sender, receiver), count in counts.items():
        if count and frozenset((sender, receiver)) not in pairs:
            wrong = f"{count} communicates from {sender} to {receiver}, and no channel joins them"
            right = "give them a channel, or send it another way"
            yield Finding(Kind.NO_CHANNEL, where, wrong, right)
    for channel in design.channels.values():
        uses = [use for use in design.file.protocol if use.channel == channel.id]
        yield from _directions(where, channel.ends, counts, uses)
        if uses and all(use.follows in design.tables for use in uses):
            yield from _balance(design, where, uses, counts)


def _directions(
    where: str, ends: tuple[str, str], counts: Counts, uses: list[elements.Protocol]
) -> Iterator[Finding]:
    """Directions with messages in the design and none in the run, though the peer did talk."""
    for sender, receiver in (ends, ends[::-1]):
        acts = sorted({m.performative for use in uses for m in use.message if m.sender == sender})
        heard, told = counts.get((sender, receiver)), counts.get((receiver, sender))
        if (acts or not uses) and told and not heard:
            listed_acts = f"which says {', '.join(acts)} in the design"
            said = listed_acts if acts else "although a channel joins them"
            wrong = f"{receiver} is never told anything by {sender}, {said}"
            right = f"{counts[receiver, sender]} went the other way"
            yield Finding(Kind.NEVER_HEARD, where, wrong, right)


def _balance(
    design: Design, where: str, uses: list[elements.Protocol], counts: Counts
) -> Iterator[Finding]:
    """Compare the surplus of one end's messages with the bounds of the protocols between them."""
    one, other = uses[0].initiator, uses[0].participant
    said, heard = counts.get((one, other), 0), counts.get((other, one), 0)
    if not (said and heard):
        return
    lows, highs = [], []
    for use in uses:
        least, most = difference(_asked_once(restricted(design.tables[use.follows], listed(use))))
        turned = use.initiator != one
        lows.append(-most if turned else least)
        highs.append(-least if turned else most)
    low, high = _least(lows), -_least([-most for most in highs])
    if low <= said - heard <= high:
        return
    wrong = f"{one} says {said} to {other} and hears {heard}"
    names = " and ".join(use.name for use in uses)
    right = f"conversations of {names} that end have {_range(one, other, low, high)}"
    yield Finding(Kind.UNBALANCED, where, wrong, right)


def _least(bounds: list[float]) -> float:
    """The least of any number (one or more) of conversations, each of which is at least one of
    `bounds`.
    """
    return min(bounds) if min(bounds) >= 0 else -math.inf


def _range(one: str, other: str, low: float, high: float) -> str:
    if low == high == 0:
        return f"as many of {one} as of {other}"
    if low > -math.inf and low > 0:
        return f"more of {one} than of {other}"
    if high < 0:
        return f"more of {other} than of {one}"
    return f"at least as many of {one}" if low == 0 else f"at most as many of {one}"


def _asked_once(protocol: Protocol) -> Protocol:
    """The protocol without questions that are asked again while no answer came."""
    initiator = protocol.tables[Role.INITIATOR]
    again = [row for row in initiator if row.way is Way.SEND and row.to == row.state]
    return protocol.with_tables(
        initiator=initiator.only(row for row in initiator if row not in again)
    )


def difference(protocol: Protocol) -> tuple[float, float]:
    """Least and most of what the initiator says more than the participant over complete
    conversations (infinite where a cycle adds to it).
    """
    walked = edges(protocol, ON_THE_WAY)
    return _cheapest(protocol, walked, 1), -_cheapest(protocol, walked, -1)


def _cheapest(protocol: Protocol, walked: Walked, sign: int) -> float:
    """The least of sign x (initiator's sends - participant's) at an end. No way without a cycle
    costs less than minus the number of configurations; one that does comes through a negative
    cycle.
    """
    start = next(iter(walked))
    least, waiting = {start: 0}, deque([start])
    while waiting:
        here = waiting.popleft()
        for step, there in walked[here]:
            worth = 0 if step.row.way is not Way.SEND else 1 if step.role is Role.INITIATOR else -1
            cost = least[here] + sign * worth
            if cost < least.get(there, math.inf):
                least[there] = cost
                waiting.append(there)
                if cost < -len(walked):
                    return -math.inf
    # Both roles ended, nothing on its way; the beginning is not a conversation.
    ended = {role: protocol.tables[role].ended for role in Role}
    quiet = (here for here in least if not (here.to_initiator or here.to_participant))
    complete = (here for here in quiet if all(here.state(role) in ended[role] for role in Role))
    return min((least[here] for here in complete), default=-math.inf)


# --- A recording ----------------------------------------------------------------------------------


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
    """The use of a protocol a communicate belongs to; None: the design has no such message, or it
    is a guest's.
    """
    rule = design.rules.get((one.sender, one.receiver, one.protocol, one.performative))
    return None if rule is None else design.protocols.get(rule.use)


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
    said = tuple(
        one for one in run.communicates if not {one.sender, one.receiver} & design.guests.keys()
    )
    own = (finding for part in (_strange, _sizes, _latencies) for finding in part(design, said))
    return (*own, *sums(design, counts(said)))


def _strange(design: Design, said: Iterable[Observation]) -> Iterator[Finding]:
    """Messages that the design does not have; between agents without a channel `sums` says it."""
    odd: dict[tuple[str, str, str, str], int] = defaultdict(int)
    pairs = {frozenset(channel.ends) for channel in design.channels.values()}
    for one in said:
        if use_of(design, one) is None and frozenset((one.sender, one.receiver)) in pairs:
            odd[one.sender, one.receiver, one.protocol, str(one.performative)] += 1
    for (sender, receiver, protocol, act), count in odd.items():
        allowed = ", ".join(sorted(design.allowed(sender, receiver, protocol))) or "nothing"
        right = f"allowed: {allowed}"
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
