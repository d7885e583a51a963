"""Tables of both roles from the arrows of a protocol diagram, with FIPA's cancel meta-protocol.

The cancel meta-protocol is the same in all specifications (SC00026H to SC00036H): only the initiator may cancel, at any
time between the opening and the end; the participant answers the cancel with inform (cancelled) or failure (not
cancelled). The diagrams do not show messages that cross. Exploration of both roles (`exploration.py`) requires:

- the initiator accepts messages that cross its cancel; if one ends the protocol, the answer to the cancel still
follows;
- a participant that has ended answers a late cancel with failure; it needs no memory of the conversation;
- while it stops, a participant may still end or send messages that change no state, but it must not advance.
"""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols.states import State as S
from fipa_codec.tables import RECEIVE, SEND, Protocol, Row, Table

PLAIN, CANCEL = Kind.PLAIN, Kind.CANCEL


class Pending(NamedTuple):
    """The states of both roles between the cancel and its answer, for one open state."""

    initiator: S
    participant: S


def pending(*states: S) -> dict[S, Pending]:
    """Return the states `cancelling-x` and `stopping-x` for each open state x."""
    return {state: Pending(S(f"cancelling-{state}"), S(f"stopping-{state}")) for state in states}


def mirrored(rows: Iterable[Row]) -> tuple[Row, ...]:
    """Return the same arrows from the view of the other role."""
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
    resting: Iterable[S] = (),
) -> Protocol:
    """Return the protocol of a diagram (`rows`, from the view of the initiator) with cancel.

    `ended`: final states of the diagram. `pending`: its open states after the opening. `failure_ends`: whether a failed
    cancel ends the conversation too; otherwise the conversation continues in its state. `resting`: open states that may
    last for ever.
    """
    arrows, ends, rests = tuple(rows), tuple(ended), tuple(resting)
    mirror, over = mirrored(arrows), (*ends, S.CANCELLED, S.SETTLED)
    return Protocol(
        name,
        initiator=Table((*arrows, *_initiator(arrows, pending, failure_ends)), ended=over, resting=rests),
        participant=Table(
            (*mirror, *_participant(mirror, ends, pending, failure_ends)),
            ended=over,
            urgent=(S.TOO_LATE,),
            resting=rests,
        ),
        aliases=aliases,
        rounds=rounds,
    )


def _initiator(arrows: tuple[Row, ...], pending: Mapping[S, Pending], failure_ends: bool) -> Iterable[Row]:
    for state, (cancelling, _) in pending.items():
        yield Row(state, SEND, P.CANCEL, PLAIN, cancelling)
        for row in arrows:
            if row.state == state and row.way is RECEIVE:
                known = pending.get(S(row.to))
                yield row._replace(state=cancelling, to=known.initiator if known else S.OVERTAKEN)
        yield Row(cancelling, RECEIVE, P.INFORM, CANCEL, S.CANCELLED)
        yield Row(cancelling, RECEIVE, P.FAILURE, CANCEL, S.CANCELLED if failure_ends else state)
    yield Row(S.OVERTAKEN, RECEIVE, P.FAILURE, CANCEL, S.SETTLED)


def _participant(
    arrows: tuple[Row, ...], ends: tuple[S, ...], pending: Mapping[S, Pending], failure_ends: bool
) -> Iterable[Row]:
    for state, (_, stopping) in pending.items():
        yield Row(state, RECEIVE, P.CANCEL, PLAIN, stopping)
        for row in arrows:
            if row.state == state and row.way is SEND and (row.to == state or row.to in ends):
                yield row._replace(state=stopping, to=stopping if row.to == state else S.TOO_LATE)
        yield Row(stopping, SEND, P.INFORM, CANCEL, S.CANCELLED)
        yield Row(stopping, SEND, P.FAILURE, CANCEL, S.CANCELLED if failure_ends else state)
    # A cancel that crossed the last message of the participant, or (start) of a forgotten conversation.
    reached = {row.to for row in arrows if row.way is SEND}
    for state in (S.START, *(end for end in ends if end in reached)):
        yield Row(state, RECEIVE, P.CANCEL, PLAIN, S.TOO_LATE)
    yield Row(S.TOO_LATE, SEND, P.FAILURE, CANCEL, S.SETTLED)
