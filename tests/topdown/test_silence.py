"""Words that change nothing are found, and only those; one left out wrongly is seen after the
exploration.
"""

import pytest
from small import design, fleet, instead, less

from topdown.model.design import Design
from topdown.model.machines import machines
from topdown.prove.engine import explore
from topdown.prove.parts import silent_words

REPORT = """
[[table]]
name = "reporting"

[table.initiator]
rows = [
  ["start", "send", "request", "running"],
  ["running", "receive", "inform[progress]", "owing"],
  ["owing", "send", "confirm[progress]", "running"],
  ["running", "receive", "inform", "done"],
]
ended = ["done"]
urgent = ["owing"]

[table.participant]
rows = [
  ["start", "receive", "request", "running"],
  ["running", "send", "inform[progress]", "running"],
  ["running", "receive", "confirm[progress]", "running"],
  ["done", "receive", "confirm[progress]", "done"],
  ["running", "send", "inform", "done"],
]
ended = ["done"]

[[protocol]]
name = "report"
channel = "C1"
follows = "reporting"
initiator = "hand"
participant = "lamp"
durable = true
message = [
  { sender = "hand", performative = "request", language = "L" },
  { sender = "hand", performative = "confirm", language = "L" },
  { sender = "lamp", performative = "inform", language = "L" },
]
"""
HAND = (
    '{ in = ["idle"], on = "person wish", say = ["report request"], to = "waiting" }',
    '{ in = ["waiting"], on = "report inform[progress]", say = ["report confirm[progress]"] }',
    '{ in = ["waiting"], on = "report inform", to = "idle" }',
)
LAMP = (
    '{ in = ["idle"], on = "report request", say = ["report inform[progress]"], to = "busy" }',
    '{ in = ["idle", "busy"], on = "report confirm[progress]" }',
    '{ in = ["busy"], on = "own lit", say = ["report inform"], to = "idle" }',
)
PROGRESS, CONFIRM = "report inform[progress]", "report confirm[progress]"


def reporting(
    hand: tuple[str, ...] = HAND, lamp: tuple[str, ...] = LAMP, more: str = "", **other: str
) -> Design:
    """A lamp that tells how far it is, which the hand confirms by name; `other`: words of the table
    in other words.
    """
    told = REPORT + more
    for old, new in other.items():
        assert old in told
        told = told.replace(old, new)
    return design(
        hand, lamp, *(("watch",) if "watch" in str((hand, lamp)) else ()), "ask", more=told
    )


def silent(made: Design) -> set[str]:
    """In words."""
    return set(map(str, silent_words(machines(made).values())))


def test_progress_told_and_confirmed_is_silent() -> None:
    """Both stand as before, and what is owed in between is silent itself."""
    assert silent(reporting()) == {PROGRESS, CONFIRM}


@pytest.mark.parametrize(
    "more", ['to = "busy"', 'owes = ["watch"]', 'moves = "report"', 'say = ["report inform"]']
)
def test_a_confirm_that_matters_makes_both_matter(more: str) -> None:
    """The confirm is said for the progress: what makes somebody say a loud word is not silent."""
    row = f'on = "report confirm[progress]", {more} }}'
    assert silent(reporting(lamp=instead(LAMP, 'on = "report confirm[progress]" }', row))) == set()


def test_dropping_something_matters() -> None:
    """Likewise, at the other side: the lamp's word matters, the hand's does not."""
    row = 'on = "report inform[progress]", drop = ["ask"], say'
    assert silent(reporting(hand=instead(HAND, 'on = "report inform[progress]", say', row))) == {
        CONFIRM
    }


@pytest.mark.parametrize(
    "row", ["", '{ in = ["idle"], on = "report confirm[progress]", several = true }']
)
def test_what_no_row_takes_is_not_silent(row: str) -> None:
    """It stays in the inbox and stands in the way."""
    rows = less(LAMP, "confirm")
    assert silent(reporting(lamp=(*rows, row) if row else rows)) == set()


def test_one_row_that_matters_is_enough() -> None:
    """Another that takes the same word without effect is no excuse."""
    row = '{ in = ["lit"], on = "report confirm[progress]", to = "idle" }'
    assert silent(reporting(lamp=(*LAMP, row))) == set()


def test_a_conversation_that_goes_on_is_not_silent() -> None:
    """Its state tells that the word was said."""
    made = reporting(
        **{
            '"confirm[progress]", "running"],\n  ["done"': (
                '"confirm[progress]", "done"],\n  ["done"'
            )
        }
    )
    assert silent(made) == set()


def test_what_is_owed_in_more_than_one_way_is_not_silent() -> None:
    """The choice of the way would matter."""
    both = (
        '["owing", "send", "confirm[progress]", "running"],\n  ["owing", "send", "confirm",'
        ' "done"],'
    )
    assert silent(reporting(**{'["owing", "send", "confirm[progress]", "running"],': both})) == {
        CONFIRM
    }


def test_volatile_words_are_never_silent() -> None:
    """They may be lost, so they are in the model."""
    assert silent(reporting(**{"durable = true": "durable = false"})) == set()


def test_a_word_that_a_rule_forbids_is_said_in_the_model() -> None:
    """Else the rule would hold whatever the agents do; what is said for such a word is not silent
    either.
    """
    rule = """
[[never]]
name = "no confirm to a lamp at work"
agent = "hand"
says = ["report confirm[progress]"]
while = ["lamp in busy"]
"""
    model = fleet(reporting(more=rule))
    assert model.parts.silent == frozenset()
    (found,) = explore(model).findings
    assert found.text.startswith("no confirm to a lamp at work")


def test_silent_words_are_not_sent() -> None:
    """And nothing is the worse for it."""
    model = fleet(reporting())
    result = explore(model)
    assert result.holds
    assert model.not_silent() == ()
    assert not any(
        said in model.parts.silent for words in model.parts.queues.values for said in words
    )
    assert model.unused() == ()


def test_a_word_left_out_wrongly_is_reported() -> None:
    """The lamp has no row for the confirm in a state in which it may come: it would stand in the
    way.
    """
    rows = instead(LAMP, '["idle", "busy"], on = "report confirm', '["idle"], on = "report confirm')
    model = fleet(reporting(lamp=rows))
    assert explore(model).holds
    (told,) = model.not_silent()
    assert told == f"lamp in busy; report: running: {CONFIRM} is not without effect"


def test_a_guard_that_may_not_hold_is_reported() -> None:
    """No row for the progress applies where the guard is wrong."""
    rows = instead(
        HAND,
        'on = "report inform[progress]"',
        'on = "report inform[progress]", when = ["report none"]',
    )
    model = fleet(reporting(hand=rows))
    explore(model)
    assert [told.split(": ")[-1] for told in model.not_silent()] == [
        f"{PROGRESS} is not without effect"
    ]
