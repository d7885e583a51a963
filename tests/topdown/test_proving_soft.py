"""Questions and subscriptions in the composed model: every fault of theirs, and what heals it."""

from small import (
    ASKER,
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
    watching,
    wrong,
)

from topdown.prove.engine import explore
from topdown.prove.fleet import ANY


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
    assert not kinds(questions(less(ASKER, "restart", "late ask")), 0)
    assert kinds(questions(less(ASKER, "restart", "late ask")), 1) & set(STUCK)


def test_a_server_that_takes_its_time() -> None:
    """It is asked once more only when it died, or the answer was lost; its own death makes it
    forget.
    """
    slow = (
        '{ in = ["idle"], on = "ask query-ref", to = "busy" }',
        '{ in = ["busy"], on = "own thought", say = ["ask inform"], to = "idle" }',
        '{ in = ["busy"], on = "restart", to = "idle" }',
    )
    hand = less(ASKER, "late ask", "restart")
    assert not kinds(questions(hand, less(slow, "restart")), 0)
    # the question is gone with the death, so no answer can be said to it
    assert kinds(questions(hand, less(slow, "restart")), 1) & set(STUCK)
    again = labels(questions(hand, slow), 0)
    assert "hand: ask query-ref -> lamp, again" not in again
    assert "hand: ask query-ref -> lamp, again" in labels(questions(hand, slow), 1)


def test_a_copy_is_asked_again_and_answered_by_the_runtime() -> None:
    """While the first is still thought about nothing is said; the behaviour does not see it."""
    slow = (
        '{ in = ["idle"], on = "ask query-ref", to = "busy" }',
        '{ in = ["busy"], on = "own thought", say = ["ask inform"], to = "idle" }',
    )
    assert "lamp: ask query-ref: asked again" in labels(questions(ASKER, slow), 1)
    assert "lamp: ask query-ref: asked again" not in labels(questions(ASKER, slow), 0)


def test_who_gives_a_question_up_hears_no_answer() -> None:
    """An answer on the way then belongs to nobody, whether the wait was over or a row dropped
    it.
    """
    bored = '{ in = ["asking"], on = "own bored", drop = ["ask"], to = "idle" }'
    hand = (*less(ASKER, "late ask"), bored)
    assert not kinds(questions(hand), 2)
    model = fleet(questions(hand))
    asked = next(there for _, what, there, _, _ in model.moves(model.start) if "wonder" in what)
    given_up = next(there for _, what, there, _, _ in model.moves(asked) if what == "bored")
    assert model.parts.net(given_up[model.soft[0].slot]).words == frozenset()
    assert model.at_rest(given_up)
    patient = fleet(questions(), 1)
    asked = next(there for _, what, there, _, _ in patient.moves(patient.start) if "wonder" in what)
    late = next(there for _, what, there, _, _ in patient.moves(asked) if what == "late ask")
    assert patient.at_rest(late)
    assert late[-1] == 0


def test_an_answer_that_no_row_applies_to_is_wrong() -> None:
    """It is not a late copy: its conversation is open."""
    hand = instead(ASKER, '"ask inform", to', '"ask inform", when = ["ask asked"], to')
    assert "no row of hand in asking applies to ask inform" in wrong(questions(hand))


def test_a_volatile_award_is_repeated_until_it_is_answered() -> None:
    """Of a conversation the newest word of who opened it, not its opening; what comes twice is
    dropped.
    """
    hand = (
        '{ in = ["idle"], on = "person wish", say = ["tender cfp"], to = "waiting" }',
        '{ in = ["waiting"], on = "tender propose", say = ["tender accept-proposal"] }',
        '{ in = ["waiting"], on = "tender inform", to = "idle" }',
    )
    lamp = (
        '{ in = ["idle"], on = "tender cfp", say = ["tender propose"] }',
        '{ in = ["idle"], on = "tender accept-proposal", say = ["tender inform"] }',
    )
    said = labels(design(hand, lamp, "tender"), 1)
    assert "hand: tender accept-proposal -> lamp, again" in said
    assert "hand: tender cfp -> lamp, again" in said
    assert "lamp: tender accept-proposal is dropped" in said


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
    once = instead(
        WATCHER, 'on = "back lamp", drop = ["watch"]', 'on = "back lamp", when = ["watch none"]'
    )
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
    hasty = instead(
        WATCHED,
        'owes = ["watch"], to = "lit"',
        'owes = ["watch"], when = ["watch unsettled"], to = "lit"',
    )
    assert not kinds(watching(lamp=hasty))
    never = instead(
        WATCHED,
        'owes = ["watch"], to = "lit"',
        'owes = ["watch"], when = ["watch settled"], to = "lit"',
    )
    assert kinds(watching(lamp=never)) & set(STUCK)


def test_what_is_lost_of_an_observation() -> None:
    """The observation itself, or its receipt; it is said again then, and only while somebody
    listens.
    """
    said = labels(watching(), 1)
    assert {"net: watch inform is lost", "hand: watch inform <- lamp; its receipt is lost"} <= said
    assert "lamp: watch inform -> hand, again" in said
    assert "lamp: watch inform -> hand, again" not in labels(watching(), 0)


STOPS = (
    *instead(
        WATCHER,
        'on = "back lamp", drop',
        'on = "back lamp", when = ["watch none|asked|live"], drop',
    ),
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
    hand = (
        *instead(
            STOPS, ', when = ["watch none|asked|live"], drop = ["watch"]', ', drop = ["watch"]'
        ),
        again,
    )
    for most in (0, 2, ANY):
        assert not kinds(watching(hand, STOPPED), most)


def test_how_a_cancel_of_a_subscription_is_answered() -> None:
    """By the row, by the runtime after a death, and again."""
    said = labels(watching(STOPS, STOPPED), 2)
    assert "lamp: watch cancel <- hand; watch inform[cancel] -> hand" in said
    assert "lamp: watch cancel <- hand, too late" in said
    assert "hand: watch cancel -> lamp, again" in said
    assert "hand: watch failure[cancel] <- lamp; watch subscribe -> lamp" in said
    assert "hand: watch cancel -> lamp, again" not in labels(watching(STOPS, STOPPED), 0)


def test_a_cancel_is_repeated_though_the_lamp_has_not_answered() -> None:
    """Its answer to the subscription is none to the cancel, which may be what it needs to hear."""
    slow = (
        '{ in = ["idle"], on = "watch subscribe" }',
        '{ in = ["idle"], on = "own yes", when = ["watch asked"], say = ["watch agree"] }',
        STOPPED[-1],
    )
    model = fleet(watching(STOPS, slow), 1, boot=True)
    way = (
        "back lamp; watch subscribe",
        "watch subscribe <- hand",
        "stops; watch cancel",
        "watch cancel is lost",
    )
    state = model.boot
    for words in way:
        state = next(there for _, what, there, _, _ in model.moves(state) if words in what)
    assert "watch cancel -> lamp, again" in {what for _, what, *_ in model.moves(state)}


def test_a_wait_of_a_subscriber_may_be_over() -> None:
    """It gives the subscription up, and what is on the way with it."""
    late = '{ in = ["idle"], on = "late watch", say = ["watch subscribe"] }'
    assert "hand: late watch; watch subscribe -> lamp" in labels(watching((*WATCHER, late)), 1)
    assert not kinds(watching((*WATCHER, late)), 2)
    forgets = '{ in = ["idle"], on = "late watch" }'
    assert kinds(watching((*WATCHER, forgets)), 1) & set(STUCK)
