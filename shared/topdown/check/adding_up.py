"""Counts of communicates against the design: traffic has a channel, every direction is used,
answers match questions.

How many messages the two roles of a protocol exchange is bound by its table: over all complete
conversations, what the initiator says less what the participant says lies between two figures,
found as the cheapest and the dearest way through the product of both roles (shortest ways over
fipa_codec.exploration's configurations; questions asked again are left out). A run in which all
conversations ended cannot be outside of what they allow.
"""

import math
from collections import deque
from collections.abc import Iterator, Mapping

from fipa_codec.exploration import Configuration, Step, edges
from fipa_codec.tables import Protocol, Role, Way
from topdown.check.protocols import listed, restricted
from topdown.model import elements
from topdown.model.design import Design
from topdown.model.findings import Finding, Kind

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
