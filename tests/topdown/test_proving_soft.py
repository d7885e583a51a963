"""Questions and subscriptions in the composed model: every fault of theirs, and what heals it."""

from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st
from small import (
    ASKER,
    BORED,
    HAND,
    LAMP,
    SLOW,
    STUCK,
    WATCHED,
    WATCHER,
    design,
    fleet,
    found,
    instead,
    kinds,
    labels,
    less,
    questions,
    reached,
    steps,
    watching,
    wrong,
)

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import CFP, SUBSCRIBE
from fipa_codec.tables import RECEIVE, SEND, Role, Row, Table
from topdown.model.machines import ProtocolAct
from topdown.prove.engine import explore
from topdown.prove.fleet import ANY, Flat, Fleet, _repeated
from topdown.prove.parts import Net

ASKED, ANSWER = (ProtocolAct("ask", act, Kind.PLAIN) for act in (P.QUERY_REF, P.INFORM))
NEWS = ProtocolAct("watch", P.INFORM, Kind.PLAIN)
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
AGREES_LATER = (
    '{ in = ["idle"], on = "watch subscribe" }',
    '{ in = ["idle"], on = "own yes", when = ["watch asked"], say = ["watch agree"] }',
)
FORGETS = '{ in = ["busy"], on = "restart", to = "idle" }'


def test_questions_hold_whatever_happens() -> None:
    """Lost, doubled, either side dead: asked again."""
    for most in (0, 2, ANY):
        model = fleet(questions(), most)
        assert explore(model).holds
        assert (model.unused() == ()) is (most != 0)


def test_every_fault_of_a_volatile_channel_is_there() -> None:
    """And the repetition that heals it, which is none."""
    assert labels(questions(), ANY) == {
        "hand: wonder; ask query-ref -> lamp",
        "hand: ask query-ref -> lamp, again",
        "hand: late ask",
        "hand: dies and comes back; restart; ask query-ref -> lamp",
        "hand: ask inform <- lamp",
        "hand: ask inform <- lamp (a copy)",
        "lamp: ask query-ref <- hand; ask inform -> hand",
        "lamp: ask query-ref <- hand; ask inform -> hand (a copy)",
        "net: ask query-ref is lost",
        "net: ask inform is lost",
    }


def test_a_question_forgotten_in_a_death_is_found() -> None:
    """The asker waits for an answer to a question that is not under way any more."""
    hand = less(ASKER, "restart", "late ask")
    assert not kinds(questions(hand), 0)
    assert kinds(questions(hand), 1) & set(STUCK)
    # a lamp that takes its time: its own death makes it forget
    assert not kinds(questions(hand, SLOW), 0)
    assert kinds(questions(hand, SLOW), 1) & set(STUCK)


def test_a_copy_is_asked_again_and_answered_by_the_runtime() -> None:
    """Only where a death or a loss may be; while the first is thought about nothing is said."""
    forgetful = (*SLOW, FORGETS)
    for hand, lamp, said in (
        (ASKER, SLOW, "lamp: ask query-ref: asked again"),
        (less(ASKER, "late ask", "restart"), forgetful, "hand: ask query-ref -> lamp, again"),
    ):
        assert said not in labels(questions(hand, lamp), 0)
        assert said in labels(questions(hand, lamp), 1)


def test_who_gives_a_question_up_hears_no_answer() -> None:
    """An answer on the way then belongs to nobody, whether the wait was over or a row dropped
    it.
    """
    hand = (*less(ASKER, "late ask"), BORED)
    assert not kinds(questions(hand), 2)
    model = fleet(questions(hand))
    given_up = steps(model, model.start, "wonder", "bored")
    assert model.parts.net(given_up[model.soft[0].slot]).words == frozenset()
    assert model.at_rest(given_up)
    patient = fleet(questions(), 1)
    late = steps(patient, patient.start, "wonder", "late ask")
    assert patient.at_rest(late)
    assert late[-1] == 0


def test_an_answer_that_no_row_applies_to_is_wrong() -> None:
    """It is not a late copy: its conversation is open."""
    hand = instead(ASKER, '"ask inform", to', '"ask inform", when = ["ask asked"], to')
    assert "no row of hand in asking applies to ask inform" in wrong(questions(hand))


def test_a_volatile_award_is_repeated_until_it_is_answered() -> None:
    """Of a conversation the newest word of who opened it, not its opening; what comes twice, or too
    late for its conversation, is dropped.
    """
    assert labels(design(CALLER, CALLED, "tender"), 1) >= {
        "hand: tender accept-proposal -> lamp, again",
        "hand: tender cfp -> lamp, again",
        "lamp: tender accept-proposal is dropped",
        "hand: tender propose is dropped",
    }


def test_subscriptions_hold_whatever_happens() -> None:
    """Subscribed again after every death; the newest observation comes in the end."""
    for most in (0, 2, ANY):
        model = fleet(watching(), most)
        assert explore(model).holds
        assert model.unused() == ()
        assert model.at_rest(model.start)
        assert not model.at_rest(model.boot)


def test_the_start_of_all_agents_is_not_at_rest() -> None:
    """Nobody has subscribed yet; from there on everything holds as well."""
    assert not kinds(watching(), 0, boot=True)
    assert found(watching(), 0, boot=True).states > found(watching(), 0).states


def test_a_subscription_that_is_not_renewed_is_found() -> None:
    """One death of who is watched; of who watches, too."""
    old = 'on = "back lamp", drop = ["watch"]'
    once = instead(WATCHER, old, 'on = "back lamp", when = ["watch none"]')
    assert not kinds(watching(once), 0)
    assert kinds(watching(once), 1) & set(STUCK)


def test_news_in_a_state_without_a_row_are_lost() -> None:
    """A peer's coming back is told once: nothing is said for it later."""
    hand = (
        *WATCHER,
        '{ in = ["waiting"], on = "watch agree" }',
        '{ in = ["waiting"], on = "watch inform" }',
        '{ in = ["idle"], on = "person sits", to = "waiting" }',
        '{ in = ["waiting"], on = "own stands", to = "idle" }',
    )
    assert "hand: news of lamp is dropped" in labels(watching(hand), 1)
    assert kinds(watching(hand), 1) & set(STUCK)
    heard = instead(hand, '{ in = ["idle"], on = "back', '{ in = ["idle", "waiting"], on = "back')
    assert not kinds(watching(heard), 1)


def test_what_is_owed_is_settled_when_it_was_taken() -> None:
    """Not before: the guard holds the lamp back; and it survives a death of either side."""
    model = fleet(watching(), ANY)
    for state in reached(model):
        lamp = model.parts.local(1, state[1])
        net = model.parts.net(state[model.soft[0].slot])
        assert lamp.state != "idle" or not lamp.owed
        assert net.stale or not lamp.owed
        for _, what, there, _, _ in model.moves(state):
            if what == "seen":
                assert "watch" not in lamp.owed
            if "dies" in what:
                assert model.parts.local(1, there[1]).owed == lamp.owed


def test_unsettled_is_the_other_way_round() -> None:
    """A row for when something is due applies then only; owed in the same step counts."""
    for word, stuck in (("unsettled", False), ("settled", True)):
        guarded = f'owes = ["watch"], when = ["watch {word}"], to = "lit"'
        lamp = instead(WATCHED, 'owes = ["watch"], to = "lit"', guarded)
        assert bool(kinds(watching(lamp=lamp)) & set(STUCK)) is stuck, word


def test_what_is_lost_of_an_observation() -> None:
    """The observation itself, or its receipt; it is said again then, and only while somebody
    listens.
    """
    said = labels(watching(), 1)
    assert {"net: watch inform is lost", "hand: watch inform <- lamp; its receipt is lost"} <= said
    assert "lamp: watch inform -> hand, again" in said
    assert "lamp: watch inform -> hand, again" not in labels(watching(), 0)


STOPS = (
    *instead(WATCHER, '"back lamp", drop', '"back lamp", when = ["watch none|asked|live"], drop'),
    '{ in = ["idle"], on = "person stops", say = ["watch cancel"] }',
    '{ in = ["idle"], on = "watch inform[cancel]", say = ["watch subscribe"] }',
    '{ in = ["idle"], on = "watch failure[cancel]", say = ["watch subscribe"] }',
)
STOPPED = (
    *less(WATCHED, "own", "subscribe"),
    '{ in = ["idle"], on = "watch subscribe", say = ["watch agree"] }',
    '{ in = ["idle"], on = "watch cancel", say = ["watch inform[cancel]"] }',
)


def test_a_subscription_is_cancelled_till_it_is_over() -> None:
    """Asked again if it was lost; a lamp that knows no such subscription any more says failure."""
    again = '{ in = ["idle"], on = "restart", say = ["watch subscribe"] }'
    hand = (*instead(STOPS, ', when = ["watch none|asked|live"], drop', ", drop"), again)
    for most in (0, 2, ANY):
        assert not kinds(watching(hand, STOPPED), most)


def test_how_a_cancel_of_a_subscription_is_answered() -> None:
    """By the row, by the runtime after a death, and again."""
    assert labels(watching(STOPS, STOPPED), 2) >= {
        "lamp: watch cancel <- hand; watch inform[cancel] -> hand",
        "lamp: watch cancel <- hand, too late",
        "hand: watch cancel -> lamp, again",
        "hand: watch failure[cancel] <- lamp; watch subscribe -> lamp",
    }
    assert "hand: watch cancel -> lamp, again" not in labels(watching(STOPS, STOPPED), 0)


def test_a_cancel_is_repeated_though_the_lamp_has_not_answered() -> None:
    """Its answer to the subscription is none to the cancel, which may be what it needs to hear."""
    model = fleet(watching(STOPS, (*AGREES_LATER, STOPPED[-1])), 1, boot=True)
    way = ("back lamp; watch", "watch subscribe <-", "stops; watch cancel", "watch cancel is lost")
    state = steps(model, model.boot, *way)
    assert "watch cancel -> lamp, again" in {what for _, what, *_ in model.moves(state)}


def test_a_wait_of_a_subscriber_may_be_over() -> None:
    """It gives the subscription up, and what is on the way with it."""
    late = '{ in = ["idle"], on = "late watch", say = ["watch subscribe"] }'
    assert "hand: late watch; watch subscribe -> lamp" in labels(watching((*WATCHER, late)), 1)
    assert not kinds(watching((*WATCHER, late)), 2)
    forgets = '{ in = ["idle"], on = "late watch" }'
    assert kinds(watching((*WATCHER, forgets)), 1) & set(STUCK)


# --- messages on their way, and senders that repeat them ------------------------------------------


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


def test_an_answer_to_a_question_given_up_is_no_answer_to_the_next() -> None:
    """The lamp is slow, and the hand has asked again meanwhile."""
    model = fleet(questions((*ASKER, BORED), SLOW))
    state = steps(model, model.start, "wonder", "ask query-ref <-", "bored", "wonder", "thought")
    assert model.parts.net(state[model.soft[0].slot]) == Net(frozenset({ASKED}))
    assert not kinds(questions((*ASKER, BORED), (*SLOW, FORGETS)), 2)


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


def test_an_observation_that_no_row_applies_to_is_wrong() -> None:
    """It would be taken, and nobody has thought of what then."""
    hand = instead(WATCHER, 'watch inform"', 'watch inform", when = ["watch none"]')
    lamp = ('{ in = ["idle"], on = "person lights", owes = ["watch"] }', WATCHED[0])
    assert "no row of hand in idle applies to watch inform" in wrong(watching(hand, lamp))


def test_nothing_is_observed_before_the_subscription_is_agreed() -> None:
    """Observations owed wait until it is live."""
    lights = '{ in = ["idle"], on = "person lights", owes = ["watch"] }'
    model = fleet(watching(lamp=(*AGREES_LATER, lights)), 1, boot=True)
    state = steps(model, model.boot, "lights", "watch subscribe ->", "watch subscribe <-")
    for place, told in ((state, False), (steps(model, state, "yes"), True)):
        moves = {what for _, what, *_ in model.moves(place)}
        assert ("watch inform -> hand, again" in moves) is told


def test_what_is_asked_again_in_each_state() -> None:
    """The newest word of who opened, until something is taken; a cancel until its answer, however
    much crosses it.
    """

    def rows() -> Iterator[Row]:
        yield Row("start", SEND, P.REQUEST, Kind.PLAIN, "on")
        yield Row("on", SEND, P.CANCEL, Kind.PLAIN, "a")
        for here, there in (("a", "b"), ("b", "c"), ("c", "done")):
            yield Row(here, RECEIVE, P.INFORM, Kind.PLAIN, there)

    subscribing, calling, crossed = (
        {state: said.act for state, said in _repeated("use", table).items()}
        for table in (
            SUBSCRIBE.tables[Role.INITIATOR],
            CFP.tables[Role.INITIATOR],
            Table(rows(), ended=("done",)),
        )
    )
    cancelled = dict.fromkeys(("cancelling-asked", "cancelling", "overtaken"), P.CANCEL)
    assert subscribing == {"asked": P.SUBSCRIBE} | cancelled
    assert (calling["called"], calling["awarded"]) == (P.CFP, P.ACCEPT_PROPOSAL)
    assert calling["cancelling-offered"] == calling["overtaken"] == P.CANCEL
    assert "offered" not in calling
    assert {state for state, act in crossed.items() if act is P.CANCEL} == {"a", "b", "c"}


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
