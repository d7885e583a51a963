"""The composed model by itself, on a hand and a lamp: durable conversations, deaths, waits that are
over.
"""

import pytest
from small import (
    ASKER,
    HAND,
    LAMP,
    STUCK,
    design,
    fleet,
    instead,
    kinds,
    labels,
    less,
    questions,
    reached,
    watching,
    wrong,
)

from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import REQUEST
from fipa_codec.tables import RECEIVE, START, Role, Table
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
    for hand, lamp in (
        (less(HAND, "failure[cancel]"), LAMP),
        (
            less(
                HAND,
                '"switch inform", when = ["switch overtaken"]',
                '"switch inform", when = ["switch done"]',
            ),
            LAMP,
        ),
        (less(HAND, "switch agree"), LAMP),
        (HAND, less(LAMP, "own lit")),
        (HAND, instead(LAMP, 'say = ["switch inform"], to = "idle"', 'say = ["switch inform"]')),
        (instead(HAND, '"switch inform[cancel]", to = "idle"', '"switch inform[cancel]"'), LAMP),
        (HAND, less(LAMP, "request")),
    ):
        assert kinds(design(hand, lamp)) & set(STUCK), (hand, lamp)


def test_a_cancel_that_no_row_takes_waits_for_the_end() -> None:
    """Then it came too late, which the runtime answers: slow, but nothing is stuck."""
    assert not kinds(design(HAND, less(LAMP, "switch cancel")))


def test_an_event_no_row_of_which_applies_is_wrong() -> None:
    """The word is taken, for a row names it; what then happens nobody has thought of."""
    rows = less(HAND, '"switch inform", when = ["switch overtaken"]')
    said = (
        "no row of hand in waiting applies to switch inform; its conversations: {'switch':"
        " 'overtaken'}"
    )
    assert wrong(design(rows, LAMP)) == said


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

[[protocol]]
name = "tell"
channel = "C1"
follows = "telling"
initiator = "hand"
participant = "lamp"
durable = true
message = [
  { sender = "hand", performative = "request", language = "L" },
  { sender = "lamp", performative = "inform", language = "L" },
]
"""
    hand = (
        '{ in = ["idle"], on = "person wish", say = ["tell request"] }',
        '{ in = ["idle"], on = "tell inform" }',
    )
    lamp = ('{ in = ["idle"], on = "tell request", say = ["tell inform"] }',)
    assert (
        wrong(design(hand, lamp, "ask", more=table))
        == "hand in idle has tell in none and got tell inform"
    )


def test_the_runtime_answers_a_late_cancel_in_any_state() -> None:
    """No row is needed; the answer is the table's."""
    assert "lamp: switch cancel <- hand, too late" in labels(design(HAND, LAMP))
    busy = (
        '{ in = ["idle"], on = "own nap", to = "lit" }',
        '{ in = ["lit"], on = "own waking", to = "idle" }',
    )
    assert not kinds(design(HAND, (*LAMP, *busy)))
    table = REQUEST.tables[Role.PARTICIPANT].without(START, RECEIVE, P.CANCEL)
    made = design(HAND, LAMP)
    made.__dict__["own_tables"] = {"request": REQUEST.with_tables(participant=table)}
    assert wrong(made) == "lamp knows no conversation of switch and got switch cancel"


def test_an_answer_that_is_owed_is_said_in_the_same_step() -> None:
    """A row that leaves a conversation in an urgent state does not apply."""
    table = REQUEST.tables[Role.PARTICIPANT]
    hasty = Table([*table], ended=table.ended, urgent=(*table.urgent, "asked"))
    later = instead(less(LAMP, "refuse"), 'say = ["switch agree"], moves = "switch", ', "")
    later = (*later, '{ in = ["busy"], on = "own yes", say = ["switch agree"] }')
    for rows, fine in ((less(LAMP, "refuse"), True), (later, False)):
        assert not kinds(design(HAND, rows))
        made = design(HAND, rows)
        made.__dict__["own_tables"] = {"request": REQUEST.with_tables(participant=hasty)}
        assert fine or "no row of lamp in idle applies to switch request" in wrong(made)
        assert not fine or not kinds(made)


def test_a_word_that_may_be_said_is_not_in_the_model() -> None:
    """With it there would be a second inform, which nobody takes."""
    rows = instead(
        LAMP, 'say = ["switch refuse"]', 'say = ["switch refuse"], may = ["switch inform"]'
    )
    assert not kinds(design(HAND, rows))
    said = instead(LAMP, 'say = ["switch refuse"]', 'say = ["switch refuse", "switch inform"]')
    assert kinds(design(HAND, less(said, "switch agree")))


def test_rows_for_several_are_not_explored() -> None:
    """Else two wishes at a time would be."""
    row = (
        '{ in = ["waiting"], on = "person again", say = ["switch cancel"], to = "idle", several ='
        " true }"
    )
    assert "hand: person again; switch cancel -> lamp" not in labels(design((*HAND, row), LAMP))
    assert not kinds(design((*HAND, row), LAMP))
    model = fleet(design((*HAND, row), LAMP))
    explore(model)
    assert model.unused() == ()


def test_an_act_is_begun_once_in_a_conversation() -> None:
    """Again after a death it is found; in the next conversation it is another act."""
    again = '{ in = ["busy"], on = "restart", when = ["switch agreed"], moves = "switch" }'
    assert not kinds(design(HAND, LAMP), 1)
    assert (
        wrong(design(HAND, (*LAMP, again)), 1)
        == "lamp begins an act twice in one conversation of switch"
    )
    assert not kinds(design(HAND, (*LAMP, again)), 0)


def test_a_death_brings_the_first_row_that_applies_and_no_other_loss() -> None:
    """A durable conversation stays; a row for the death is taken where its guard holds."""
    forgets = '{ in = ["busy"], on = "restart", when = ["switch agreed"], to = "idle" }'
    assert kinds(design(HAND, (*LAMP, forgets)), 1) & {*STUCK, WRONG}
    assert not kinds(design(HAND, (*LAMP, forgets)), 0)
    never = '{ in = ["busy"], on = "restart", when = ["switch none"], to = "idle" }'
    assert not kinds(design(HAND, (*LAMP, never)), 1)
    failing = (
        '{ in = ["busy"], on = "restart", when = ["switch agreed"], say = ["switch failure"], to ='
        ' "idle" }'
    )
    heard = '{ in = ["waiting"], on = "switch failure", to = "idle" }'
    assert "lamp: dies and comes back; restart; switch failure -> hand" in labels(
        design((*HAND, heard), (*LAMP, failing)), 1
    )
    assert kinds(design(HAND, (*LAMP, failing)), 1)


def test_more_words_than_a_queue_holds_are_reported() -> None:
    """An agent that reports and never waits; five words may wait."""
    chatty = (
        '{ in = ["busy"], on = "own flicker", when = ["switch agreed"], say = ["switch'
        ' inform[progress]"] }'
    )
    heard = '{ in = ["waiting"], on = "switch inform[progress]", say = ["switch cancel"] }'
    hand = (*less(HAND, "regret"), heard, '{ in = ["waiting"], on = "switch inform[progress]" }')
    text = wrong(design(hand, (*less(LAMP, "refuse"), chatty)))
    assert text.startswith(
        f"more than {QUEUE_BOUND} words wait: switch agree, switch inform[progress]"
    )
    assert text.count(",") == QUEUE_BOUND


LATE = (
    '{ in = ["waiting"], on = "late switch", when = ["switch asked|agreed"], say = ["switch'
    ' cancel"] }'
)


def test_a_wait_may_be_over_as_a_fault() -> None:
    """Only of who opened the conversation, and only while it is open."""
    said = "hand: late switch; switch cancel -> lamp"
    hand = less(HAND, "person regret")
    assert said not in labels(design((*hand, LATE), LAMP), 0)
    assert said in labels(design((*hand, LATE), LAMP), 1)
    assert not kinds(design((*hand, LATE), LAMP), 1)
    idle = (
        '{ in = ["idle"], on = "late switch", to = "asking" }',
        '{ in = ["idle"], on = "late ask", to = "asking" }',
    )
    other = (
        '{ in = ["idle"], on = "late switch", to = "lit" }',
        '{ in = ["busy"], on = "late switch", to = "lit" }',
    )
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


def test_a_row_for_several_after_a_death_is_not_explored() -> None:
    """Here it would forget the request."""
    forgets = '{ in = ["busy"], on = "restart", to = "idle", several = true }'
    assert not kinds(design(HAND, (*LAMP, forgets)), 1)


@pytest.mark.parametrize(
    ("word", "waits", "holds"),
    [
        ("waiting", "", False),
        ("waiting", ', waits = ["later"]', True),
        ("served", "", True),
        ("none", "", False),
    ],
)
def test_a_guard_holds_for_its_own_word_only(word: str, waits: str, holds: bool) -> None:
    """A request-when that was agreed is in the protocol's state "waiting", whether it waits for its
    turn or not.
    """
    hand = (
        '{ in = ["idle"], on = "person wish", say = ["later request-when"], to = "waiting" }',
        '{ in = ["waiting"], on = "later agree" }',
        '{ in = ["waiting"], on = "later inform", to = "idle" }',
    )
    lamp = (
        (
            '{ in = ["idle"], on = "later request-when", say = ["later agree"], to ='
            f' "busy"{waits} }}'
        ),
        (
            f'{{ in = ["busy"], on = "own lit", when = ["later {word}"], say = ["later inform"], to'
            ' = "idle" }'
        ),
    )
    assert kinds(design(hand, lamp, "later")).isdisjoint(STUCK) is holds


def test_rows_that_no_path_took_are_named() -> None:
    """With agent, number, states and event."""
    never = '{ in = ["busy", "lit"], on = "own never", when = ["switch none"] }'
    model = fleet(design(HAND, (*LAMP, never)))
    explore(model)
    assert model.unused() == ("row never used: lamp 5 (in busy|lit on own never)",)


def test_states_are_told_in_words() -> None:
    """Agent, state, open conversations and debts."""
    model = fleet(watching())
    assert model.describe(model.boot) == {"hand": "idle", "lamp": "idle"}
    assert model.describe(model.start) == {"hand": "idle; watch: live", "lamp": "idle; watch: live"}
    (worked,) = [there for _, what, there, _, _ in model.moves(model.start) if what == "work"]
    (done,) = [there for _, what, there, _, _ in model.moves(worked) if what == "done"]
    assert model.describe(done)["lamp"] == "lit; watch: live; owes watch"
    assert model.describe(("wrong",)) == {}
