"""First differences in the exchanges of two runs, aligned by conversation and not by time. Pure.

Conversations of the same kind (who opens, to whom, by which protocol, about what) are paired in the order in which they
were opened; within a pair each side's communicates are compared one by one by what they mean (saying.Said.meaning). So
neither another order of conversations side by side, nor two words that cross, nor a slow machine count as a difference.
"""

from collections.abc import Iterator, Sequence
from itertools import zip_longest

import msgspec

from operate.experiments.exchanges import Said

Kind = tuple[str, str, str]


class Divergence(msgspec.Struct, frozen=True):
    """The first communicate in which they differ: in A, in B (None: it was not said there).

    `of`: the kind of the conversation in words; `conversation`: which one of that kind, `position`: which communicate
    of its sender in it, both from 1.
    """

    of: str
    conversation: int
    position: int
    a: Said | None
    b: Said | None


def first(a: Sequence[Said], b: Sequence[Said]) -> Divergence | None:
    """The earliest difference by the time at which it was said in A (where only B said it: in B); None: none."""
    differing = list(_differences(conversations(a), conversations(b)))
    return min(differing, key=_when, default=None)


def conversations(said: Sequence[Said]) -> dict[Kind, list[list[Said]]]:
    """All conversations by kind, each kind's in the order of opening."""
    talks: dict[tuple[str, str], list[Said]] = {}
    for one in said:
        talks.setdefault((one.protocol, one.conversation), []).append(one)
    kinds: dict[Kind, list[list[Said]]] = {}
    for talk in talks.values():
        opening = talk[0]
        kinds.setdefault((opening.sender, opening.receiver, opening.protocol), []).append(talk)
    return kinds


def _differences(a: dict[Kind, list[list[Said]]], b: dict[Kind, list[list[Said]]]) -> Iterator[Divergence]:
    """The first one of each kind."""
    for kind in {**a, **b}:
        silence: list[Said] = []
        pairs = zip_longest(a.get(kind, []), b.get(kind, []), fillvalue=silence)
        found = (_in_pair(kind, number, one, other) for number, (one, other) in enumerate(pairs, start=1))
        divergence = next((one for one in found if one is not None), None)
        if divergence is not None:
            yield divergence


def _in_pair(kind: Kind, number: int, a: Sequence[Said], b: Sequence[Said]) -> Divergence | None:
    sender, receiver, protocol = kind
    found: list[Divergence] = []
    for side in (sender, receiver):
        ours, theirs = [one for one in a if one.sender == side], [one for one in b if one.sender == side]
        for position, (one, other) in enumerate(zip_longest(ours, theirs), start=1):
            if one is None or other is None or one.meaning != other.meaning:
                found.append(Divergence(f"{sender} to {receiver}, {protocol}", number, position, one, other))
                break
    return min(found, key=_when, default=None)


def _when(found: Divergence) -> float:
    one = found.a or found.b
    assert one is not None
    return one.t
