"""From the arrows of a protocol's drawing to the tables of both roles, with the cancel meta-protocol in them.

The cancel meta-protocol is the same in all documents (SC00026H to SC00036H): only the initiator may cancel, at any time
between the opening and the end it knows of; the participant answers inform (it is over) or failure (it is not), in
reply to the cancel. The drawings leave out what crosses on the way. Found by walking both roles (`exploration.py`):

- the initiator takes whatever crosses its cancel; if that is the end, the cancel's own answer still comes;
- a participant that has ended by its own word answers a late cancel with failure, and needs no memory for that;
- while it stops, a participant may still come to its end or say what changes nothing, but it begins nothing new.
"""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols.states import State as S
from fipa_codec.tables import RECEIVE, SEND, Protocol, Row, Table

PLAIN, CANCEL = Kind.PLAIN, Kind.CANCEL


class Pending(NamedTuple):
    """What an open state becomes for each role between the cancel and its answer."""

    initiator: S
    participant: S


def pending(*states: S) -> dict[S, Pending]:
    """The words `cancelling-x` and `stopping-x` for each open state x."""
    return {state: Pending(S(f"cancelling-{state}"), S(f"stopping-{state}")) for state in states}


def mirrored(rows: Iterable[Row]) -> tuple[Row, ...]:
    """The same arrows as the other role sees them."""
    return tuple(row._replace(way=RECEIVE if row.way is SEND else SEND) for row in rows)


def cancellable(
    name: str,
    rows: Iterable[Row],
    *,
    ended: Iterable[S],
    pending: Mapping[S, Pending],
    failure_ends: bool = False,
    aliases: tuple[str, ...] = (),
    rounds: Iterable[P] = (),
) -> Protocol:
    """The protocol of a drawing (`rows`, the initiator's view) with cancel.

    `ended`: how the drawing can end. `pending`: every open state after the opening. `failure_ends`: whether a cancel
    that failed ends the conversation too; else it is dropped and the conversation goes on where it stands.
    """
    drawing, ends = tuple(rows), tuple(ended)
    mirror, over = mirrored(drawing), (*ends, S.CANCELLED, S.SETTLED)
    return Protocol(
        name,
        initiator=Table((*drawing, *_initiator(drawing, pending, failure_ends)), ended=over),
        participant=Table(
            (*mirror, *_participant(mirror, ends, pending, failure_ends)), ended=over, urgent=(S.TOO_LATE,)
        ),
        aliases=aliases,
        rounds=rounds,
    )


def _initiator(drawing: tuple[Row, ...], pending: Mapping[S, Pending], failure_ends: bool) -> Iterable[Row]:
    for state, (cancelling, _) in pending.items():
        yield Row(state, SEND, P.CANCEL, PLAIN, cancelling)
        for row in drawing:
            if row.state == state and row.way is RECEIVE:
                known = pending.get(S(row.to))
                yield row._replace(state=cancelling, to=known.initiator if known else S.OVERTAKEN)
        yield Row(cancelling, RECEIVE, P.INFORM, CANCEL, S.CANCELLED)
        yield Row(cancelling, RECEIVE, P.FAILURE, CANCEL, S.CANCELLED if failure_ends else state)
    yield Row(S.OVERTAKEN, RECEIVE, P.FAILURE, CANCEL, S.SETTLED)


def _participant(
    drawing: tuple[Row, ...], ends: tuple[S, ...], pending: Mapping[S, Pending], failure_ends: bool
) -> Iterable[Row]:
    for state, (_, stopping) in pending.items():
        yield Row(state, RECEIVE, P.CANCEL, PLAIN, stopping)
        for row in drawing:
            if row.state == state and row.way is SEND and (row.to == state or row.to in ends):
                yield row._replace(state=stopping, to=stopping if row.to == state else S.TOO_LATE)
        yield Row(stopping, SEND, P.INFORM, CANCEL, S.CANCELLED)
        yield Row(stopping, SEND, P.FAILURE, CANCEL, S.CANCELLED if failure_ends else state)
    # A cancel that crossed the participant's last word, or (start) names a conversation nobody remembers.
    said = {row.to for row in drawing if row.way is SEND}
    for state in (S.START, *(end for end in ends if end in said)):
        yield Row(state, RECEIVE, P.CANCEL, PLAIN, S.TOO_LATE)
    yield Row(S.TOO_LATE, SEND, P.FAILURE, CANCEL, S.SETTLED)
