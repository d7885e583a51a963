"""The composed model by itself, on a hand and a lamp: durable conversations, deaths, waits that are
over.
"""

import pytest
from small import (
    ASKER,
    FLICKERS,
    HAND,
    LAMP,
    STUCK,
    TOLD,
    design,
    fleet,
    instead,
    kinds,
    labels,
    less,
    questions,
    reached,
    row,
    steps,
    use,
    watching,
    wrong,
)

from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import REQUEST
from fipa_codec.tables import RECEIVE, START, Role, Table
from topdown.model.design import Design
from topdown.prove.engine import WRONG, explore
from topdown.prove.fleet import ANY, QUEUE_BOUND


def test_a_request_with_cancel_holds() -> None:
    """With every row needed, whatever dies; a durable conversation survives deaths, so faults add
    nothing.
    """
    for most in (0, 1, ANY):
        model = fleet(design(HAND, LAMP), most)
        assert explore(model).holds
        assert model.unused() == model.not_silent() == ()


def test_a_row_less_or_another_state_is_found() -> None:
    """Somebody waits for ever."""
    informed = '"switch inform", when = ["switch '
    for hand, lamp in (
        (less(HAND, "failure[cancel]"), LAMP),
        (less(HAND, f'{informed}overtaken"]', f'{informed}done"]'), LAMP),
        (less(HAND, "switch agree"), LAMP),
        (HAND, less(LAMP, "own lit")),
        (HAND, instead(LAMP, 'say = ["switch inform"], to = "idle"', 'say = ["switch inform"]')),
        (instead(HAND, '"switch inform[cancel]", to = "idle"', '"switch inform[cancel]"'), LAMP),
        (HAND, less(LAMP, "request")),
    ):
        assert kinds(design(hand, lamp)) & set(STUCK), (hand, lamp)
    # a cancel that no row takes waits for the end: then it came too late, which the runtime answers
    assert not kinds(design(HAND, less(LAMP, "switch cancel")))


def test_an_event_no_row_of_which_applies_is_wrong() -> None:
    """The word is taken, for a row names it; what then happens nobody has thought of."""
    rows = less(HAND, '"switch inform", when = ["switch overtaken"]')
    said = "no row of hand in waiting applies to switch inform; its conversations: "
    assert wrong(design(rows, LAMP)) == said + "{'switch': 'overtaken'}"


def test_a_message_that_only_rows_for_several_take_is_wrong() -> None:
    """It would be taken; and one conversation at a time is explored."""
    row = '{ in = ["waiting"], on = "switch agree", several = true }'
    said = "only rows for several at a time of hand in waiting take switch agree"
    assert wrong(design((*less(HAND, "switch agree"), row), LAMP)) == said
    assert not kinds(design((*HAND, row), LAMP))


def test_a_word_that_the_table_does_not_have_there_is_wrong() -> None:
    """A conversation that has ended for the hand, since it gave up in a table of its own."""
    table = """
[[table]]
name = "telling"
[table.initiator]
rows = [["start", "send", "request", "done"], ["lost", "receive", "inform", "done"]]
ended = ["done"]
[table.participant]
rows = [["start", "receive", "request", "on"], ["on", "send", "inform", "done"]]
ended = ["done"]
"""
    tell = use("tell", "telling", {"hand": "request", "lamp": "inform"})
    hand = (
        '{ in = ["idle"], on = "person wish", say = ["tell request"] }',
        '{ in = ["idle"], on = "tell inform" }',
    )
    lamp = ('{ in = ["idle"], on = "tell request", say = ["tell inform"] }',)
    made = design(hand, lamp, "ask", more=table + tell)
    assert wrong(made) == "hand in idle has tell in none and got tell inform"


def test_the_runtime_answers_a_late_cancel_in_any_state() -> None:
    """No row is needed; the answer is the table's."""
    assert "lamp: switch cancel <- hand, too late" in labels(design(HAND, LAMP))
    busy = (
        '{ in = ["idle"], on = "own nap", to = "lit" }',
        '{ in = ["lit"], on = "own waking", to = "idle" }',
    )
    assert not kinds(design(HAND, (*LAMP, *busy)))
    table = REQUEST.tables[Role.PARTICIPANT].without(START, RECEIVE, P.CANCEL)
    assert (
        wrong(with_table(LAMP, table))
        == "lamp knows no conversation of switch and got switch cancel"
    )


def test_an_answer_that_is_owed_is_said_in_the_same_step() -> None:
    """A row that leaves a conversation in an urgent state does not apply."""
    table = REQUEST.tables[Role.PARTICIPANT]
    hasty = Table([*table], ended=table.ended, urgent=(*table.urgent, "asked"))
    rows = less(LAMP, "refuse")
    assert not kinds(with_table(rows, hasty))
    later = instead(rows, 'say = ["switch agree"], moves = "switch", ', "")
    later = (*later, row("busy", "own yes", say="switch agree"))
    assert not kinds(design(HAND, later))
    assert "no row of lamp in idle applies to switch request" in wrong(with_table(later, hasty))


def with_table(lamp: tuple[str, ...], table: Table) -> Design:
    """The design with another table of the lamp's."""
    made = design(HAND, lamp)
    made.__dict__["own_tables"] = {"request": REQUEST.with_tables(participant=table)}
    return made


def test_a_word_that_may_be_said_is_not_in_the_model() -> None:
    """With it there would be a second inform, which nobody takes."""
    for more, stuck in (('"], may = ["switch inform"]', False), ('", "switch inform"]', True)):
        rows = instead(LAMP, 'say = ["switch refuse"]', f'say = ["switch refuse{more}')
        assert bool(kinds(design(HAND, less(rows, "switch agree") if stuck else rows))) is stuck


def test_rows_for_several_are_not_explored() -> None:
    """Else two wishes at a time would be; after a death such a row would forget the request."""
    again = '{ in = ["waiting"], on = "person again", say = ["switch cancel"], several = true }'
    forgets = '{ in = ["busy"], on = "restart", to = "idle", several = true }'
    made = design((*HAND, again), (*LAMP, forgets))
    assert not any("again;" in told for told in labels(made))
    assert not kinds(made)
    assert not kinds(made, 1)
    model = fleet(made)
    explore(model)
    assert model.unused() == ()


def test_an_act_is_begun_once_in_a_conversation() -> None:
    """Again after a death it is found; in the next conversation it is another act."""
    assert not kinds(design(HAND, LAMP), 1)
    again = row("busy", "restart", when="switch agreed", moves="switch")
    made = design(HAND, (*LAMP, again))
    assert wrong(made, 1) == "lamp begins an act twice in one conversation of switch"
    assert not kinds(made, 0)


def test_a_death_brings_the_first_row_that_applies_and_no_other_loss() -> None:
    """A durable conversation stays; a row for the death is taken where its guard holds."""
    forgets = row("busy", "restart", when="switch agreed", to="idle")
    assert kinds(design(HAND, (*LAMP, forgets)), 1) & {*STUCK, WRONG}
    assert not kinds(design(HAND, (*LAMP, forgets)), 0)
    assert not kinds(design(HAND, (*LAMP, forgets.replace("agreed", "none"))), 1)
    failing = (*LAMP, row("busy", "restart", when="switch agreed", say="switch failure", to="idle"))
    heard = '{ in = ["waiting"], on = "switch failure", to = "idle" }'
    told = labels(design((*HAND, heard), failing), 1)
    assert "lamp: dies and comes back; restart; switch failure -> hand" in told
    assert kinds(design(HAND, failing), 1)


def test_more_words_than_a_queue_holds_are_reported() -> None:
    """An agent that reports and never waits; five words may wait."""
    heard = TOLD.replace(" }", ', say = ["switch cancel"] }')
    hand = (*less(HAND, "regret"), heard, TOLD)
    text = wrong(design(hand, (*less(LAMP, "refuse"), FLICKERS)))
    words = "switch agree, switch inform[progress]"
    assert text.startswith(f"more than {QUEUE_BOUND} words wait: {words}")
    assert text.count(",") == QUEUE_BOUND


def test_a_wait_may_be_over_as_a_fault() -> None:
    """Only of who opened the conversation, and only while it is open."""
    said = "hand: late switch; switch cancel -> lamp"
    late = row("waiting", "late switch", when="switch asked|agreed", say="switch cancel")
    hand = less(HAND, "person regret")
    assert said not in labels(design((*hand, late), LAMP), 0)
    assert said in labels(design((*hand, late), LAMP), 1)
    assert not kinds(design((*hand, late), LAMP), 1)
    idle = [row("idle", f"late {use}", to="asking") for use in ("switch", "ask")]
    other = [row(state, "late switch", to="lit") for state in ("idle", "busy")]
    assert not kinds(design((*hand, *idle), (*LAMP, *other), "switch", "ask"), ANY)


def test_who_waits_is_told_when_the_other_dies_for_good() -> None:
    """Only with a row for a wait that is over; which counts as what will happen once the other is
    dead.
    """
    patient = instead(less(HAND, "person regret"), '"person wish"', '"own wish"')
    gone = {"gone": "lamp", "waiting": ("hand",)}
    assert kinds(design(patient, LAMP), **gone) & set(STUCK)
    assert "lamp: dies for good" in labels(design(HAND, LAMP), **gone)
    asks = instead(less(ASKER, "late ask"), '"own wonder"', '"person wonder"')
    assert kinds(questions(asks), **gone) & set(STUCK)
    assert not kinds(questions(instead(ASKER, '"own wonder"', '"person wonder"')), **gone)


def test_who_is_gone_does_not_come_back() -> None:
    """Not even where other deaths may happen; and it takes and answers nothing any more."""
    for made, name in ((watching(), "hand"), (design(HAND, LAMP), "lamp")):
        model = fleet(made, 1, gone=name, waiting=("hand",))
        for here in reached(model):
            if model.describe(here)[name] == "gone":
                assert name not in {who for who, *_ in model.moves(here)}


def test_a_row_whose_words_the_table_forbids_does_not_apply() -> None:
    """Neither its words nor its state."""
    twice = '{ in = ["busy"], on = "own again", say = ["switch agree"], to = "lit" }'
    assert not any("again" in told for told in labels(design(HAND, (*LAMP, twice))))


@pytest.mark.parametrize(
    ("word", "waits", "holds"),
    [
        ("waiting", {}, False),
        ("waiting", {"waits": "later"}, True),
        ("served", {}, True),
        ("none", {}, False),
    ],
)
def test_a_guard_holds_for_its_own_word_only(word: str, waits: dict[str, str], holds: bool) -> None:
    """A request-when that was agreed is in the protocol's state "waiting", whether it waits for its
    turn or not.
    """
    hand = (
        '{ in = ["idle"], on = "person wish", say = ["later request-when"], to = "waiting" }',
        '{ in = ["waiting"], on = "later agree" }',
        '{ in = ["waiting"], on = "later inform", to = "idle" }',
    )
    lamp = (
        row("idle", "later request-when", say="later agree", to="busy", **waits),
        row("busy", "own lit", when=f"later {word}", say="later inform", to="idle"),
    )
    assert kinds(design(hand, lamp, "later")).isdisjoint(STUCK) is holds


def test_states_are_told_in_words() -> None:
    """Agent, state, open conversations and debts."""
    model = fleet(watching())
    assert model.describe(model.boot) == {"hand": "idle", "lamp": "idle"}
    assert model.describe(model.start) == {"hand": "idle; watch: live", "lamp": "idle; watch: live"}
    done = steps(model, model.start, "work", "done")
    assert model.describe(done)["lamp"] == "lit; watch: live; owes watch"
    assert model.describe(("wrong",)) == {}
