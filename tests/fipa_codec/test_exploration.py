"""Exploration of protocols in both roles: FIPA's are sound, and each kind of defect is found."""

import pytest

from fipa_codec.errors import LocalProtocolError
from fipa_codec.exploration import explore, with_not_understood
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import CFP, FIPA_REQUEST, QUERY, REQUEST, SUBSCRIBE, named, register
from fipa_codec.protocols import State as S
from fipa_codec.tables import RECEIVE, SEND, START, Protocol, Role, Row, Table

PROTOCOLS = (REQUEST, QUERY, SUBSCRIBE)
INITIATOR, PARTICIPANT = Role.INITIATOR, Role.PARTICIPANT


@pytest.mark.parametrize("protocol", PROTOCOLS, ids=lambda p: p.name)
@pytest.mark.parametrize("capacity", [1, 2, 3])
def test_sound(protocol, capacity):
    """No reception without a row, no stuck configuration, all states reachable, for each capacity."""
    found = explore(protocol, capacity)
    assert not found.unspecified, str(found.unspecified[0])
    assert not found.stuck, str(found.stuck[0])
    if capacity > 1:
        assert found.sound, found.unreachable


@pytest.mark.parametrize("protocol", PROTOCOLS, ids=lambda p: p.name)
def test_not_understood_at_any_point_leaves_nobody_waiting(protocol):
    """The rule outside the tables is sound too: the sender ignores later messages, the receiver ends."""
    found = explore(with_not_understood(protocol), capacity=2)
    assert not found.unspecified, str(found.unspecified[0])
    assert not found.stuck, str(found.stuck[0])


@pytest.mark.parametrize("protocol", PROTOCOLS, ids=lambda p: p.name)
def test_the_only_unused_row_is_for_a_cancel_that_nobody_remembers(protocol):
    """An unused row is superfluous, except for the one that answers a cancel after the conversation was forgotten."""
    assert {(role, row.state, row.word) for role, row in explore(protocol).unused} <= {(PARTICIPANT, START, "cancel")}


def unspecified_words(protocol):
    """Return the unspecified receptions of a protocol in words."""
    return [f.text for f in explore(protocol).unspecified]


@pytest.mark.parametrize(
    ("protocol", "state"), [(REQUEST, S.DONE), (REQUEST, S.FAILED), (REQUEST, S.REFUSED), (SUBSCRIBE, S.REFUSED)]
)
def test_cancel_that_crosses_the_end_needs_a_row(protocol, state):
    """Diagrams omit this row; without it a participant that has ended cannot receive the cancel."""
    table = protocol.tables[PARTICIPANT].without(state, RECEIVE, P.CANCEL)
    found = explore(protocol.with_tables(participant=table))
    assert f"participant in state {state} has no row for cancel" in found.unspecified[0].text
    assert found.stuck
    assert [step.row.performative for step in found.unspecified[0].steps].count(P.CANCEL) == 1


@pytest.mark.parametrize("state", [S.DONE, S.FAILED, S.REFUSED])
def test_cancel_that_came_too_late_must_be_answered(state):
    """If the participant ignores it, the initiator waits for ever."""
    table = REQUEST.tables[PARTICIPANT].with_rows(Row(state, RECEIVE, P.CANCEL, Kind.PLAIN, state))
    found = explore(REQUEST.with_tables(participant=table))
    assert not found.unspecified
    assert {c.initiator for c, _, _ in found.stuck} >= {S.OVERTAKEN}


@pytest.mark.parametrize("crossing", [P.AGREE, P.REFUSE, P.FAILURE, P.INFORM])
def test_answers_that_cross_the_cancel_need_a_row(crossing):
    """Each answer to the request may be in transit when the initiator cancels."""
    table = REQUEST.tables[INITIATOR].without(S.CANCELLING_ASKED, RECEIVE, crossing)
    assert any(f"has no row for {crossing}" in text for text in unspecified_words(REQUEST.with_tables(initiator=table)))


def test_failure_in_reply_to_the_cancel_must_be_awaited():
    """An initiator that ends with the crossing result has no row for the answer to its cancel."""
    table = REQUEST.tables[INITIATOR].with_rows(Row(S.CANCELLING, RECEIVE, P.INFORM, Kind.PLAIN, S.DONE))
    assert "initiator in state done has no row for failure[cancel]" in unspecified_words(
        REQUEST.with_tables(initiator=table)
    )


def test_progress_that_crosses_the_cancel_needs_a_row():
    """A progress report may be in transit when the act is cancelled."""
    table = REQUEST.tables[INITIATOR].without(S.CANCELLING, RECEIVE, P.INFORM, Kind.PROGRESS)
    assert "has no row for inform[progress]" in unspecified_words(REQUEST.with_tables(initiator=table))[0]


def test_repeated_query_after_the_answer_needs_a_row():
    """The second copy of a query may arrive after the first was answered."""
    table = QUERY.tables[PARTICIPANT].without(S.DONE, RECEIVE, P.QUERY_REF)
    assert "participant in state done has no row for query-ref" in unspecified_words(
        QUERY.with_tables(participant=table)
    )


def test_a_free_step_does_not_count_as_a_way_to_the_end():
    """A participant that never answers is found, although a cancel would end the conversation."""
    table = REQUEST.tables[PARTICIPANT]
    for answer in (P.INFORM, P.FAILURE):
        table = table.without(S.AGREED, SEND, answer)
    found = explore(REQUEST.with_tables(participant=table))
    assert (S.AGREED, S.AGREED) in {(c.initiator, c.participant) for c, _, _ in found.stuck}


def test_unreachable_states_are_named():
    """A state that cannot be reached is an error in the table."""
    island = Row("island", SEND, P.INFORM, Kind.PLAIN, S.DONE)
    found = explore(REQUEST.with_tables(participant=REQUEST.tables[PARTICIPANT].with_rows(island)))
    assert found.unreachable == ((PARTICIPANT, "island"),)
    assert not found.sound


def test_contradictory_tables_are_rejected():
    """Two rows for one message in one state, and final states without a row."""
    row = Row(START, SEND, P.REQUEST, Kind.PLAIN, "a")
    with pytest.raises(LocalProtocolError, match="two rows"):
        Table([row, row._replace(to="b")], ended=["a"])
    with pytest.raises(LocalProtocolError, match="nowhere"):
        Table([row], ended=["nowhere"])
    with pytest.raises(LocalProtocolError, match="no row"):
        Table([row], ended=["a"]).without("a", SEND, P.CANCEL)


def test_protocols_are_known_by_name_and_alias():
    """fipa-contract-net is cfp; a name cannot be given to another protocol."""
    assert named("fipa-contract-net") is named("cfp") is CFP
    assert named("fipa-request") is FIPA_REQUEST
    with pytest.raises(LocalProtocolError, match=r"known are .*query.*subscribe"):
        named("small-talk")
    with pytest.raises(LocalProtocolError, match="already"):
        register(Protocol("request", **{role.value: table for role, table in FIPA_REQUEST.tables.items()}))
    assert register(REQUEST) is REQUEST
