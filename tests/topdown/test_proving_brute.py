"""The composed model against brute force over the tables, and against layer 2, on `request` and
each spoilt one.
"""

from collections import deque
from collections.abc import Iterator

import pytest
from small import design, fleet, found, row

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import REQUEST
from fipa_codec.tables import RECEIVE, SEND, START, Protocol, Role, Table
from topdown.model.design import Design
from topdown.prove.engine import explore
from topdown.prove.fleet import Flat
from topdown.prove.pairs import explore_use


def general(role: Role) -> tuple[str, ...]:
    """Rows of an agent in one state that does all that its table of `request` allows, but for
    progress.
    """
    table = REQUEST.tables[role]
    rows: dict[str, None] = {}
    for one in table:
        if one.kind is Kind.PROGRESS or (one.state == START and one.performative is P.CANCEL):
            continue
        if one.way is SEND and one.state not in table.urgent:
            cause = "person" if one.performative in (P.REQUEST, P.CANCEL) else "own"
            event = f"{cause} {one.performative}{one.kind}"
            rows[row("idle", event, say=f"switch {one.word}")] = None
        elif one.way is RECEIVE and one.to not in table.urgent:
            rows[row("idle", f"switch {one.word}")] = None
    for act in ("inform", "failure", "refuse") if role is Role.PARTICIPANT else ():
        rows[row("idle", "own crossed", say=f"switch {act}, switch failure[cancel]")] = None
    return tuple(rows)


Words = tuple[tuple[P, Kind], ...]
Walk = tuple[str, str, Words, Words]


def walked(protocol: Protocol = REQUEST) -> set[Walk]:
    """All configurations of both tables over two queues, by nothing but their rows: what has ended
    is forgotten.
    """
    seen: set[Walk] = {("", "", (), ())}
    waiting = deque(seen)
    while waiting:
        here = waiting.popleft()
        for side, role in enumerate(Role):
            for there in _stepped(here, side, protocol.tables[role]):
                if there not in seen:
                    seen.add(there)
                    waiting.append(there)
    return seen


def _stepped(here: Walk, side: int, table: Table) -> Iterator[Walk]:
    for one in table:
        if one.state != (here[side] or START) or one.kind is Kind.PROGRESS:
            continue
        queues = [here[2], here[3]]
        if one.way is RECEIVE:
            if not queues[side] or queues[side][0] != (one.performative, one.kind):
                continue
            queues[side] = queues[side][1:]
        else:
            queues[1 - side] = (*queues[1 - side], (one.performative, one.kind))
        yield from _settled(here, side, table, str(one.to), queues)


def _settled(
    here: Walk, side: int, table: Table, state: str, queues: list[Words]
) -> Iterator[Walk]:
    """Yield the walks after the words owed are said, in the same step."""
    if state in table.urgent:
        for row in table.allowed(state, SEND):
            said = list(queues)
            said[1 - side] = (*queues[1 - side], (row.performative, row.kind))
            yield from _settled(here, side, table, str(row.to), said)
        return
    talks = [here[0], here[1]]
    talks[side] = "" if state in table.ended else state
    yield talks[0], talks[1], queues[0], queues[1]


def general_design() -> Design:
    """Two agents that do all that `request` allows."""
    return design(general(Role.INITIATOR), general(Role.PARTICIPANT))


def test_the_model_has_the_states_that_the_tables_have() -> None:
    """Compared one by one with a walk over the tables that knows nothing of rows, nets or
    numbers.
    """
    model = fleet(general_design())
    result = explore(model, keep=True)
    assert result.holds, str(result.findings[0])
    slots = [model.parts.queue_of[pair] for pair in (("lamp", "hand"), ("hand", "lamp"))]

    def met(state: Flat) -> Walk:
        one, other = (model.parts.local(number, state[number]).talks[0] for number in (0, 1))
        queues = (model.parts.queues.values[state[slot]] for slot in slots)
        mine, theirs = (tuple((said.act, said.kind) for said in queue) for queue in queues)
        return one, other, mine, theirs

    assert set(map(met, result.reached)) == walked()


SPOILT = [
    (role, row)
    for role in Role
    for row in REQUEST.tables[role]
    if row.kind is not Kind.PROGRESS
    and not (row.way is SEND and (row.state == START or row.performative is P.CANCEL))
]


def test_a_spoilt_table_fails_here_and_in_layer_2(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each row of `request` taken away by itself: either both layers find something, or neither
    does.

    But for a cancel that meets an end which is still remembered: composed, as in the runtime, what
    has ended is forgotten.
    """
    made, tables = general_design(), REQUEST.tables
    for role, spoilt in SPOILT:
        less = {**tables, role: tables[role].without(*spoilt[:4])}
        monkeypatch.setattr(REQUEST, "tables", less)
        pair, composed = explore_use(made, "switch", 0).exploration.findings, found(made).findings
        ended = spoilt.way is RECEIVE and spoilt.state in tables[role].ended
        remembered = role is Role.PARTICIPANT and ended
        assert bool(pair) == (bool(composed) or remembered), (role, spoilt, pair, composed)
