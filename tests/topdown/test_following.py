"""Following from outside: what two roles that hold to their tables may do, in any crossing, is in
sequence.
"""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fipa_codec import protocols
from fipa_codec.exploration import explore
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import NOT_UNDERSTOOD, RECEIVE, SEND, START, Protocol, Role
from topdown.judge.follow import WINDOW, Followed, TableMessage

PROTOCOLS = [one for one in vars(protocols).values() if isinstance(one, Protocol)]
LENGTH = 40


def walk(
    protocol: Protocol, chance: random.Random, *, lossy: bool
) -> list[tuple[Role, TableMessage]]:
    """The words in the order they are said, by two roles that send and take at random times."""
    state = dict.fromkeys(Role, START)
    ahead: dict[Role, list[TableMessage]] = {role: [] for role in Role}
    said: list[tuple[Role, TableMessage]] = []
    for _ in range(LENGTH):
        role = chance.choice(list(Role))
        table, inbound = protocol.tables[role], ahead[role]
        if inbound and lossy and chance.random() < 0.2:
            inbound.pop(0)
        if inbound and state[role] not in table.urgent and chance.random() < 0.5:
            first = inbound.pop(0)
            row = table.find(state[role], RECEIVE, first.performative, first.kinds[0])
            if row is not None:
                state[role] = row.to
        elif rows := table.allowed(state[role], SEND):
            row = chance.choice(rows)
            state[role] = row.to
            one = TableMessage(row.performative, (row.kind,), sure=not lossy)
            said.append((role, one))
            ahead[role.other].append(one)
    return said


@pytest.mark.parametrize("durable", [True, False])
@pytest.mark.parametrize("protocol", PROTOCOLS, ids=lambda one: one.name)
@given(seed=st.integers(0, 2**32))
def test_what_holds_to_the_tables_is_in_sequence(
    protocol: Protocol, durable: bool, seed: int
) -> None:
    """No crossing of messages alarms; a wire that loses does not either."""
    followed = Followed(protocol, durable=durable)
    for role, said in walk(protocol, random.Random(seed), lossy=not durable):
        assert followed.take(role, said), (role, said, followed.states)


@pytest.mark.parametrize("protocol", PROTOCOLS, ids=lambda one: one.name)
def test_what_no_merge_explains_is_refused(protocol: Protocol) -> None:
    """In every state the exploration reaches with nothing on its way, exactly the rows of the table
    may be said.
    """
    assert explore(protocol).unspecified == ()
    for role, table in protocol.tables.items():
        followed = Followed(protocol, durable=True)
        may = {(row.performative, row.kind) for row in table.allowed(START, SEND)}
        for act in set(Performative) - {Performative.NOT_UNDERSTOOD}:
            for kind in Kind:
                fits = Followed(protocol, durable=True).take(role, TableMessage(act, (kind,)))
                assert fits == ((act, kind) in may)
        assert followed.states == (START, START)


def request() -> Followed:
    """A request that was agreed to."""
    followed = Followed(protocols.REQUEST, durable=True)
    assert followed.take(Role.INITIATOR, TableMessage(Performative.REQUEST, label="1"))
    assert followed.take(Role.PARTICIPANT, TableMessage(Performative.AGREE, answers="1"))
    assert followed.states == ("agreed", "agreed"), "where the rows lead once all was taken"
    return followed


SUBSCRIBE = TableMessage(Performative.SUBSCRIBE, label="1")
AGREE = TableMessage(Performative.AGREE, answers="1")
REFUSE = TableMessage(Performative.REFUSE, answers="1")


def subscribed(answer: TableMessage = AGREE) -> Followed:
    """A soft subscription that was answered."""
    followed = Followed(protocols.SUBSCRIBE, durable=False)
    assert followed.take(Role.INITIATOR, SUBSCRIBE)
    assert followed.take(Role.PARTICIPANT, answer)
    return followed


def test_a_cancel_may_cross_the_result_but_not_follow_its_own_answer() -> None:
    """Both merges of a crossing are kept, until what is said next tells which it was."""
    cancel = TableMessage(Performative.CANCEL, label="2")
    failed = TableMessage(Performative.FAILURE, (Kind.CANCEL,), answers="2")
    crossed = request()
    assert crossed.take(Role.PARTICIPANT, TableMessage(Performative.INFORM))
    assert crossed.take(Role.INITIATOR, cancel)  # it had not taken the result yet
    assert crossed.take(Role.PARTICIPANT, failed)
    assert crossed.states == ("settled", "settled")
    assert not crossed.take(Role.INITIATOR, cancel)


def test_what_is_meant_is_what_may_be_said() -> None:
    """A failure without a label answers the request or the cancel, which has none either; once the
    result was said, it can only answer the cancel.
    """
    followed = request()
    assert followed.take(Role.INITIATOR, TableMessage(Performative.CANCEL))
    for uses in ((Kind.PLAIN, Kind.CANCEL), (Kind.CANCEL,)):
        failed = followed.read(Role.PARTICIPANT, Performative.FAILURE, "", "", (Kind.PLAIN,))
        assert isinstance(failed, TableMessage)
        assert failed.kinds == (Kind.PLAIN, Kind.CANCEL)
        assert followed.sides[Role.PARTICIPANT].uses(failed) == uses
        followed.take(Role.PARTICIPANT, TableMessage(Performative.INFORM, answers="1"))


def test_an_answer_was_said_after_what_it_answers() -> None:
    """By its label; without one, the cancel might still be on its way when the result is said."""
    followed = request()
    assert followed.take(Role.INITIATOR, TableMessage(Performative.CANCEL, label="2"))
    for answers in ("2", ""):  # without a label: it was said already
        again = TableMessage(Performative.AGREE, answers=answers)
        assert not followed.take(Role.PARTICIPANT, again)


def test_not_understood_ends_it_at_any_point() -> None:
    """SC00037J: whoever says it is deaf from then on, and says nothing more."""
    followed = request()
    assert followed.take(Role.INITIATOR, TableMessage(Performative.NOT_UNDERSTOOD))
    # it had not heard it yet
    assert followed.take(Role.PARTICIPANT, TableMessage(Performative.INFORM))
    assert followed.states == (NOT_UNDERSTOOD, "done")
    assert not followed.take(Role.INITIATOR, TableMessage(Performative.CANCEL, label="2"))


def test_a_not_understood_is_not_answered_by_another() -> None:
    """Its label in in-reply-to proves that it was read, and so that the conversation had ended; two
    that cross are legal.
    """
    for answers, legal in (("", True), ("1", True), ("3", False)):
        followed = request()
        ended = TableMessage(Performative.NOT_UNDERSTOOD, label="3")
        assert followed.take(Role.PARTICIPANT, ended)
        act = Performative.NOT_UNDERSTOOD
        read = followed.read(Role.INITIATOR, act, "", answers, (Kind.PLAIN,))
        assert (not isinstance(read, str) and followed.take(Role.INITIATOR, read)) == legal


def test_a_question_asked_again_may_be_answered_again() -> None:
    """Each copy once: no journal numbers them."""
    query = TableMessage(Performative.QUERY_REF, label="1")
    answer = TableMessage(Performative.INFORM_REF, answers="1")
    followed = Followed(protocols.QUERY, durable=False)
    assert followed.take(Role.INITIATOR, query)
    assert [followed.take(Role.PARTICIPANT, answer) for _ in range(2)] == [True, False]
    followed.repeat(Role.INITIATOR, query)
    assert followed.take(Role.PARTICIPANT, answer)


def test_what_is_soft_is_forgotten_when_it_ends() -> None:
    """A subscription that was refused and is asked for again may be agreed to: whoever refused has
    forgotten it.
    """
    followed = subscribed(REFUSE)
    assert not followed.take(Role.PARTICIPANT, AGREE)
    followed.repeat(Role.INITIATOR, SUBSCRIBE)
    assert followed.take(Role.PARTICIPANT, AGREE)


@pytest.mark.parametrize("dies", [True, False])
def test_a_death_forgets_what_is_soft(dies: bool) -> None:
    """The side that lives says once more that it agreed; the side that died may also refuse, having
    forgotten it.
    """
    followed = subscribed()
    if dies:
        followed.sides[Role.PARTICIPANT].forget()
    followed.repeat(Role.INITIATOR, SUBSCRIBE)
    assert followed.take(Role.PARTICIPANT, REFUSE) == dies


def test_a_long_subscription_costs_no_more_than_a_short_one() -> None:
    """However many informs come by, only the newest are kept as not taken yet."""
    followed = subscribed()
    for _ in range(10 * WINDOW):
        assert followed.take(Role.PARTICIPANT, TableMessage(Performative.INFORM))
    assert len(followed.sides[Role.INITIATOR]._ahead) <= WINDOW
    assert followed.take(Role.INITIATOR, TableMessage(Performative.CANCEL, label="2"))


def test_a_doubtful_opening_does_not_spoil_what_follows() -> None:
    """One repeated under a wrong label was judged; the right one is still right after it."""
    followed = subscribed()
    followed.doubt(Role.INITIATOR, TableMessage(Performative.SUBSCRIBE, label="R9"))
    assert not followed.mislabelled(Role.INITIATOR, Performative.SUBSCRIBE, "1")


def test_a_doubtful_round_may_have_begun_or_not() -> None:
    """A proposal to either is not a fault of the bidder."""
    followed = Followed(protocols.ICFP, durable=True)
    assert followed.take(Role.INITIATOR, TableMessage(Performative.CFP, label="R1"))
    assert followed.take(Role.PARTICIPANT, TableMessage(Performative.PROPOSE, answers="R1"))
    followed.doubt(Role.INITIATOR, TableMessage(Performative.CFP, label="R2"))
    for answers in ("R1", "R2"):
        read = followed.read(Role.PARTICIPANT, Performative.PROPOSE, "", answers, (Kind.PLAIN,))
        assert not isinstance(read, str)
