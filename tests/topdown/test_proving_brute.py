"""The composed model against brute force over the tables, and against layer 2, on `request` and
each spoilt one.
"""

from collections import deque
from collections.abc import Iterator

import pytest
from small import design, fleet, found

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import REQUEST
from fipa_codec.tables import RECEIVE, SEND, START, Protocol, Role, Table
from topdown.model.design import Design
from topdown.prove.engine import explore
from topdown.prove.pairs import explore_use


def general(role: Role, use: str = "switch") -> tuple[str, ...]:
    """Rows of an agent in one state that does all that its table of `request` allows, but for
    progress.
    """
    table = REQUEST.tables[role]
    rows: dict[str, None] = {}
    for row in table:
        if row.kind is Kind.PROGRESS or (row.state == START and row.performative is P.CANCEL):
            continue
        if row.way is SEND and row.state not in table.urgent:
            cause = "person" if row.performative in (P.REQUEST, P.CANCEL) else "own"
            rows[
                f'{{ in = ["idle"], on = "{cause} {row.performative}{row.kind}", say = ["{use}'
                f' {row.word}"] }}'
            ] = None
        elif row.way is RECEIVE and row.to not in table.urgent:
            rows[f'{{ in = ["idle"], on = "{use} {row.word}" }}'] = None
    crossed = (
        f'say = ["{use} inform", "{use} failure[cancel]"]',
        f'say = ["{use} failure", "{use} failure[cancel]"]',
    )
    if role is Role.PARTICIPANT:
        rows |= dict.fromkeys(f'{{ in = ["idle"], on = "own crossed", {one} }}' for one in crossed)
        refused = (
            f'{{ in = ["idle"], on = "own crossed", say = ["{use} refuse", "{use}'
            ' failure[cancel]"] }'
        )
        rows[refused] = None
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
    for row in table:
        if row.state != (here[side] or START) or row.kind is Kind.PROGRESS:
            continue
        queues = [here[2], here[3]]
        if row.way is RECEIVE:
            if not queues[side] or queues[side][0] != (row.performative, row.kind):
                continue
            queues[side] = queues[side][1:]
        else:
            queues[1 - side] = (*queues[1 - side], (row.performative, row.kind))
        yield from _settled(here, side, table, str(row.to), queues)


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
    met = {
        (
            *(model.parts.local(number, state[number]).talks[0] for number in (0, 1)),
            *(
                tuple((said.act, said.kind) for said in model.parts.queues.values[state[slot]])
                for slot in slots
            ),
        )
        for state in result.reached
    }
    assert met == walked()


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
    for role, row in SPOILT:
        monkeypatch.setattr(REQUEST, "tables", {**tables, role: tables[role].without(*row[:4])})
        pair, composed = explore_use(made, "switch", 0).exploration.findings, found(made).findings
        remembered = (
            role is Role.PARTICIPANT and row.way is RECEIVE and row.state in tables[role].ended
        )
        assert bool(pair) == (bool(composed) or remembered), (role, row, pair, composed)
