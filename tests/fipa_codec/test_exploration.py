"""Exploration of protocols in both roles finds each kind of defect; protocols by their names."""

import pytest

from fipa_codec.errors import LocalProtocolError
from fipa_codec.exploration import explore
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import CFP, FIPA_REQUEST, QUERY, REQUEST, SUBSCRIBE, named, register
from fipa_codec.protocols import State as S
from fipa_codec.tables import RECEIVE, SEND, START, Protocol, Role, Row, Table

INITIATOR, PARTICIPANT = Role.INITIATOR, Role.PARTICIPANT


@pytest.mark.parametrize(
    ("protocol", "state"),
    [(REQUEST, S.DONE), (REQUEST, S.FAILED), (REQUEST, S.REFUSED), (SUBSCRIBE, S.REFUSED)],
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


def test_whatever_may_cross_needs_a_row():
    """The answers to a request, its progress, the answer to its cancel, the second copy of a
    query.
    """
    asks, answers = REQUEST.tables[INITIATOR], QUERY.tables[PARTICIPANT]
    ended = asks.with_rows(Row(S.CANCELLING, RECEIVE, P.INFORM, Kind.PLAIN, S.DONE))
    again = QUERY.with_tables(participant=answers.without(S.DONE, RECEIVE, P.QUERY_REF))
    assert_missing(again, "participant in state done has no row for query-ref")
    progress = asks.without(S.CANCELLING, RECEIVE, P.INFORM, Kind.PROGRESS)
    for table, missing in (
        (ended, "initiator in state done has no row for failure[cancel]"),
        (progress, "has no row for inform[progress]"),
        *(
            (asks.without(S.CANCELLING_ASKED, RECEIVE, act), f"has no row for {act}")
            for act in (P.AGREE, P.REFUSE, P.FAILURE, P.INFORM)
        ),
    ):
        assert_missing(REQUEST.with_tables(initiator=table), missing)


def assert_missing(protocol, text):
    """Check that a reception without a row is found."""
    assert any(text in found.text for found in explore(protocol).unspecified), text


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
    other, same = (
        Protocol("request", **{role.value: table for role, table in one.tables.items()})
        for one in (FIPA_REQUEST, REQUEST)
    )
    with pytest.raises(LocalProtocolError, match="'request' is already another protocol"):
        register(other)
    # A module that is read under two names is one system; the first protocol stays.
    assert register(same) is same
    assert named("request") is REQUEST
