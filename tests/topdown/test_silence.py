"""Words that change nothing are found, and only those; one left out wrongly is seen after the
exploration.
"""

from collections.abc import Callable

import pytest
from small import design, fleet, instead, less, use

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
"""
REPORT += use("report", "reporting", {"hand": "request confirm", "lamp": "inform"})
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
    hand: tuple[str, ...] = HAND, lamp: tuple[str, ...] = LAMP, more: str = "", **table: str
) -> Design:
    """A lamp that tells how far it is, which the hand confirms by name; `old` and `new`: words of
    the table in other words.
    """
    told = REPORT + more
    assert table.get("old", "") in told
    told = told.replace(table.get("old", ""), table.get("new", "")) if table else told
    watch = ("watch",) if "watch" in str((hand, lamp)) else ()
    return design(hand, lamp, *watch, "ask", more=told)


def silent(made: Design) -> set[str]:
    """In words."""
    return set(map(str, silent_words(machines(made).values())))


def test_progress_told_and_confirmed_is_silent() -> None:
    """Both stand as before, and what is owed in between is silent itself."""
    assert silent(reporting()) == {PROGRESS, CONFIRM}


CONFIRMED = 'on = "report confirm[progress]" }'
LIT = '{ in = ["lit"], on = "report confirm[progress]", to = "idle" }'
SEVERAL = '{ in = ["idle"], on = "report confirm[progress]", several = true }'
DROPS = instead(HAND, 'progress]", say', 'progress]", drop = ["ask"], say')
OWING = '["owing", "send", "confirm[progress]", "running"],'


def confirming(more: str) -> Design:
    """A lamp whose row for the confirm does more."""
    return reporting(lamp=instead(LAMP, CONFIRMED, f"{CONFIRMED[:-2]}, {more} }}"))


@pytest.mark.parametrize(
    ("made", "left"),
    [
        # the confirm is said for the progress: what makes somebody say a loud word is not silent
        (lambda: confirming('to = "busy"'), set()),
        (lambda: confirming('owes = ["watch"]'), set()),
        (lambda: confirming('moves = "report"'), set()),
        (lambda: confirming('say = ["report inform"]'), set()),
        # dropping something, at the other side: the lamp's word matters, the hand's does not
        (lambda: reporting(hand=DROPS), {CONFIRM}),
        # what no row takes stays in the inbox and stands in the way
        (lambda: reporting(lamp=less(LAMP, "confirm")), set()),
        (lambda: reporting(lamp=(*less(LAMP, "confirm"), SEVERAL)), set()),
        # one row that matters is enough: another that takes the same word is no excuse
        (lambda: reporting(lamp=(*LAMP, LIT)), set()),
        # a conversation that goes on: its state tells that the word was said
        (
            lambda: reporting(old='"running"],\n  ["done"', new='"done"],\n  ["done"'),
            set(),
        ),
        # what is owed in more than one way: the choice of the way would matter
        (
            lambda: reporting(old=OWING, new=OWING + '\n  ["owing", "send", "confirm", "done"],'),
            {CONFIRM},
        ),
        # volatile words may be lost, so they are in the model
        (lambda: reporting(old="durable = true", new="durable = false"), set()),
    ],
)
def test_what_may_matter_is_not_silent(made: Callable[[], Design], left: set[str]) -> None:
    """Each reason by itself; what is left is silent all the same."""
    assert silent(made()) == left


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
    assert explore(model).holds
    assert model.not_silent() == model.unused() == ()
    said = {one for words in model.parts.queues.values for one in words}
    assert not said & model.parts.silent


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
    progress = 'on = "report inform[progress]"'
    model = fleet(reporting(instead(HAND, progress, f'{progress}, when = ["report none"]')))
    explore(model)
    (told,) = model.not_silent()
    assert told.split(": ")[-1] == f"{PROGRESS} is not without effect"
