"""Messages on their way outside the durable streams, and senders that repeat them: each operation,
and rest.
"""

from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st
from small import (
    ASKER,
    HAND,
    LAMP,
    WATCHED,
    WATCHER,
    design,
    fleet,
    kinds,
    labels,
    questions,
    reached,
    watching,
    wrong,
)

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import CFP, SUBSCRIBE
from fipa_codec.tables import RECEIVE, SEND, Role, Row, Table
from topdown.model.machines import ProtocolAct
from topdown.prove.fleet import Flat, Fleet
from topdown.prove.parts import Net
from topdown.prove.soft import _repeated

ASKED, ANSWER = (
    ProtocolAct("ask", P.QUERY_REF, Kind.PLAIN),
    ProtocolAct("ask", P.INFORM, Kind.PLAIN),
)
NEWS = ProtocolAct("watch", P.INFORM, Kind.PLAIN)
SLOW = (
    '{ in = ["idle"], on = "ask query-ref", to = "busy" }',
    '{ in = ["busy"], on = "own thought", say = ["ask inform"], to = "idle" }',
)
BORED = '{ in = ["asking"], on = "own bored", drop = ["ask"], to = "idle" }'
CALLER = (
    '{ in = ["idle"], on = "person wish", say = ["tender cfp"], to = "waiting" }',
    '{ in = ["waiting"], on = "tender propose", say = ["tender accept-proposal"], to = "asking" }',
    '{ in = ["asking"], on = "tender propose" }',
    '{ in = ["asking"], on = "tender inform", to = "idle" }',
    '{ in = ["waiting"], on = "own bored", drop = ["tender"], to = "idle" }',
)
CALLED = (
    '{ in = ["idle"], on = "tender cfp", say = ["tender propose"] }',
    '{ in = ["idle"], on = "tender accept-proposal", say = ["tender inform"] }',
)


@given(st.booleans(), st.booleans())
def test_each_operation(current: bool, stale: bool) -> None:
    """Each operation changes the words, the conversation they belong to, and the knowledge as
    stated.
    """
    net = Net(frozenset({ANSWER, NEWS}), current, stale)
    assert net.opened(ASKED) == Net(frozenset({ASKED}), False, stale)
    assert net.closed() == Net(frozenset(), False, stale)
    assert net.orphaned() == Net(net.words, False, stale)
    assert net.accepted() == Net(net.words, True, stale)
    assert net.added(ASKED) == Net(net.words | {ASKED}, current, stale)
    assert net.answered(ASKED) == (net.added(ASKED) if current else net)
    assert net.owed(NEWS) == Net(frozenset({ANSWER, NEWS} if current else {ANSWER}), current, True)
    assert net.known(NEWS) == Net(frozenset({ANSWER}), current, False)
    assert net.taken(ANSWER) == Net(frozenset({NEWS}), current, stale)
    assert net.taken(ANSWER, copy=True) == net


def with_net(model: Fleet, state: Flat, net: Net) -> Flat:
    """The state with something else on the way."""
    slot = model.soft[0].slot
    return (*state[:slot], model.parts.nets(net), *state[slot + 1 :])


def test_rest_is_without_words_news_and_with_a_live_subscription() -> None:
    """Each by itself keeps the system from it."""
    model = fleet(watching())
    assert model.at_rest(with_net(model, model.start, Net(current=True)))
    for net in (Net(current=False), Net(frozenset({NEWS}), True), Net(current=True, stale=True)):
        assert not model.at_rest(with_net(model, model.start, net))
    deaf = with_net(model, model.boot, Net(current=True))
    hand = model.parts.local(0, deaf[0])._replace(news=frozenset())
    assert not model.at_rest((model.parts.locals[0](hand), *deaf[1:]))


def test_rest_is_without_words_in_queues_and_news_of_peers() -> None:
    """A word that nobody has taken yet; a peer that came back and was not taken note of."""
    model = fleet(design(HAND, LAMP))
    queue = model.parts.queues((ProtocolAct("switch", P.CANCEL, Kind.PLAIN),))
    assert model.at_rest(model.start)
    assert not model.at_rest((*model.start[:2], queue, *model.start[3:]))
    hears = '{ in = ["idle"], on = "back lamp", say = ["ask query-ref"], to = "asking" }'
    again = fleet(questions((hears, *ASKER)))
    assert not again.at_rest(again.boot)
    assert again.at_rest(again.start)


def steps(model: Fleet, state: Flat, *words: str) -> Flat:
    """The state after moves whose labels hold these words."""
    for one in words:
        state = next(there for _, what, there, _, _ in model.moves(state) if one in what)
    return state


def test_an_answer_to_a_question_given_up_is_no_answer_to_the_next() -> None:
    """The lamp is slow, and the hand has asked again meanwhile."""
    model = fleet(questions((*ASKER, BORED), SLOW))
    state = steps(model, model.start, "wonder", "ask query-ref <-", "bored", "wonder", "thought")
    assert model.parts.net(state[model.soft[0].slot]) == Net(frozenset({ASKED}))
    forgets = '{ in = ["busy"], on = "restart", to = "idle" }'
    assert not kinds(questions((*ASKER, BORED), (*SLOW, forgets)), 2)


def test_a_question_in_place_of_another_is_no_copy_of_it() -> None:
    """Though the older one was not given up by name."""
    again = '{ in = ["asking"], on = "person insists", say = ["ask query-ref"] }'
    assert "lamp: ask query-ref: asked again" not in labels(questions((*ASKER, again), SLOW), 0)


def test_a_newer_call_takes_the_place_of_an_older_one() -> None:
    """The lamp has offered in a call that nobody holds any more."""
    model = fleet(design(CALLER, CALLED, "tender"))
    state = steps(model, model.start, "wish", "tender cfp <-", "bored", "wish")
    told = {what for who, what, *_ in model.moves(state) if who == "lamp"}
    assert told == {"tender cfp <- hand; tender propose -> hand"}


def test_a_copy_that_comes_too_late_for_its_conversation_is_dropped() -> None:
    """The offer is taken already; rows name the word, and the table has no place for it."""
    assert "hand: tender propose is dropped" in labels(design(CALLER, CALLED, "tender"), 1)


def test_an_observation_that_no_row_applies_to_is_wrong() -> None:
    """It would be taken, and nobody has thought of what then."""
    hand = tuple(
        row.replace('on = "watch inform"', 'on = "watch inform", when = ["watch none"]')
        for row in WATCHER
    )
    lamp = ('{ in = ["idle"], on = "person lights", owes = ["watch"] }', WATCHED[0])
    assert "no row of hand in idle applies to watch inform" in wrong(watching(hand, lamp))


def test_nothing_is_observed_before_the_subscription_is_agreed() -> None:
    """Observations owed wait until it is live."""
    slow = (
        '{ in = ["idle"], on = "watch subscribe" }',
        '{ in = ["idle"], on = "own yes", when = ["watch asked"], say = ["watch agree"] }',
        '{ in = ["idle"], on = "person lights", owes = ["watch"] }',
    )
    model = fleet(watching(lamp=slow), 1, boot=True)
    state = steps(model, model.boot, "lights", "watch subscribe ->", "watch subscribe <-")
    assert "watch inform -> hand, again" not in {what for _, what, *_ in model.moves(state)}
    agreed = steps(model, state, "yes")
    assert "watch inform -> hand, again" in {what for _, what, *_ in model.moves(agreed)}


def test_what_is_asked_again_in_each_state() -> None:
    """The newest word of who opened, until something is taken; a cancel until its answer."""
    cancel, agree = (
        ProtocolAct("use", P.CANCEL, Kind.PLAIN),
        ProtocolAct("use", P.ACCEPT_PROPOSAL, Kind.PLAIN),
    )
    subscribing = _repeated("use", SUBSCRIBE.tables[Role.INITIATOR])
    assert subscribing == {
        "asked": ProtocolAct("use", P.SUBSCRIBE, Kind.PLAIN),
        "cancelling-asked": cancel,
        "cancelling": cancel,
        "overtaken": cancel,
    }
    calling = _repeated("use", CFP.tables[Role.INITIATOR])
    assert (calling["called"], calling["awarded"]) == (ProtocolAct("use", P.CFP, Kind.PLAIN), agree)
    assert calling["cancelling-offered"] == calling["overtaken"] == cancel
    assert "offered" not in calling


def test_a_cancel_is_asked_again_however_much_crosses_it() -> None:
    """Through any number of states, up to the end."""

    def rows() -> Iterator[Row]:
        yield Row("start", SEND, P.REQUEST, Kind.PLAIN, "on")
        yield Row("on", SEND, P.CANCEL, Kind.PLAIN, "a")
        for here, there in (("a", "b"), ("b", "c"), ("c", "done")):
            yield Row(here, RECEIVE, P.INFORM, Kind.PLAIN, there)

    found = _repeated("use", Table(rows(), ended=("done",)))
    assert {state for state, said in found.items() if said.act is P.CANCEL} == {"a", "b", "c"}


def test_a_live_subscription_asked_again_is_agreed_again() -> None:
    """The first word of the table that leads there, not the news."""
    (soft,) = fleet(watching()).soft
    assert {state: said.act for state, said in soft.answers.items()}["live"] is P.AGREE


@pytest.mark.parametrize("most", [1, 2, -1])
def test_each_fault_is_counted(most: int) -> None:
    """And nothing else; where any number may come there is no count."""
    model = fleet(watching(), most)
    for here in reached(model):
        for _, what, there, fair, fault in model.moves(here):
            assert there[-1] == (here[-1] - 1 if fault and most > 0 else here[-1]), what
            assert not (fair and fault)
