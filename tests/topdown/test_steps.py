"""A step that was made is compared with the rows: which it may have followed, and why it is none of
the design's.
"""

from typing import NamedTuple

from small import HAND, LAMP, design, row

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from topdown.judge.steps import Steps

Act = tuple[str, P, Kind]


def act(use: str, performative: P) -> Act:
    """A message of a use."""
    return use, performative, Kind.PLAIN


REQUEST, AGREE, FAILURE = (act("switch", one) for one in (P.REQUEST, P.AGREE, P.FAILURE))
INFORM, CANCEL = act("switch", P.INFORM), act("switch", P.CANCEL)


class Step(NamedTuple):
    """A step as a running agent tells it."""

    before: str
    event: str
    said: tuple[Act, ...] = ()
    after: str = ""
    took: Act | None = None
    owed: tuple[str, ...] = ()


def took(before: str, what: Act, *said: Act, after: str = "", owed: tuple[str, ...] = ()) -> Step:
    """A message was taken."""
    return Step(before, "Received", said, after or before, what, owed)


def did(before: str, event: str, *said: Act, after: str = "", owed: tuple[str, ...] = ()) -> Step:
    """Something else happened."""
    return Step(before, event, said, after or before, None, owed)


def hand(*rows: str) -> Steps:
    """The steps of a hand with these rows, or those it has."""
    return Steps(design(rows or HAND, LAMP, "switch", "ask", "watch"), "hand")


def lamp(*rows: str) -> Steps:
    """Likewise."""
    return Steps(design(HAND, rows or LAMP, "switch", "ask", "watch"), "lamp")


def test_a_step_that_follows_a_row_is_one_of_the_design() -> None:
    """State, message, words and next state are those of a row."""
    step = took("idle", REQUEST, AGREE, after="busy")
    assert lamp().why_not(step) == ""
    assert [row.number for row in lamp().fitting(step)] == [1]


def test_a_step_that_follows_none_is_named() -> None:
    """With what it did and the rows there are."""
    nothing = "in idle on switch cancel said nothing, then idle; rows for it: none"
    agreed = "said switch agree, then idle; rows for it: row 1"
    for step, words in (
        (took("idle", REQUEST, AGREE, after="idle"), agreed),
        (took("idle", REQUEST, after="busy"), "said nothing, then busy"),
        (took("idle", REQUEST, AGREE, AGREE, after="busy"), "said switch agree, switch agree"),
        (took("idle", REQUEST, INFORM, after="busy"), "said switch inform"),
        (took("busy", REQUEST, AGREE), "rows for it: none"),
        (took("idle", CANCEL), nothing),
        (did("idle", "Local", INFORM), "in idle on Local said switch inform"),
        (did("busy", "Tick", after="idle"), "rows for it: none"),
    ):
        assert words in lamp().why_not(step), step
        assert lamp().fitting(step) == ()


def test_words_come_in_their_order_and_others_only_if_they_may() -> None:
    """Optional words of a row stand anywhere, any number of times."""
    said = "switch agree, switch inform"
    steps = lamp(row("idle", "switch request", say=said, may="switch failure"))
    for words, fits in (
        ((AGREE, INFORM), True),
        ((FAILURE, AGREE, FAILURE, FAILURE, INFORM), True),
        ((INFORM, AGREE), False),
        ((AGREE, FAILURE), False),
    ):
        assert (steps.why_not(took("idle", REQUEST, *words)) == "") is fits, words


EVENTS = {
    "restart": ["Started"],
    "late switch": ["Late switch", "Woken"],
    "back lamp": ["PeerChanged lamp"],
    "own bored": ["PeerChanged lamp", "Woken", "Local", "Settled"],
    "person wish": ["Local"],
}
WORDS = ("Started", "Late switch", "Late ask", "PeerChanged lamp", "PeerChanged other", "Woken",
         "Local", "Settled")  # fmt: skip


def test_which_events_a_row_may_be_for() -> None:
    """Its cause says so; late and back name whom."""
    for cause, events in EVENTS.items():
        steps = hand(f'{{ in = ["idle"], on = "{cause}", say = ["switch request"] }}')
        for word in WORDS:
            fits = word in events or (word.startswith("PeerChanged") and cause == "own bored")
            assert (steps.why_not(did("idle", word, REQUEST)) == "") is fits, (cause, word)


def test_what_is_due_decides_between_rows() -> None:
    """Of a step's surroundings that alone can be seen."""
    steps = lamp(
        row("idle", "own lit", when="watch settled", to="busy"),
        row("idle", "own lit", when="watch unsettled", to="lit"),
    )
    for after, owed, fits in (
        ("busy", (), True),
        ("lit", ("hand",), True),
        ("busy", ("hand",), False),
        ("lit", (), False),
        ("busy", ("somebody",), True),
    ):
        step = did("idle", "Woken", after=after, owed=owed)
        assert (steps.why_not(step) == "") is fits, step
    # a guard with a choice may hold by what is not seen: conversations' states are not
    for words in ("settled|unsettled", "live|settled", "none|unsettled", "live"):
        steps = lamp(row("idle", "own lit", when=f"watch {words}", to="busy"))
        for owed in ((), ("hand",)):
            assert not steps.why_not(did("idle", "Woken", after="busy", owed=owed)), words


def test_nothing_done_is_no_deviation() -> None:
    """An event that comes too early, or for nothing."""
    steps = hand('{ in = ["idle"], on = "own bored", say = ["switch request"] }')
    for event in ("Woken", "Local", "Settled", "PeerChanged", "Started", "Late switch"):
        assert not steps.why_not(did("idle", event))


def test_after_a_death_or_a_wait_nothing_is_less_than_a_row_that_applies_always() -> None:
    """The proof relies on it: what was lost is asked again. A guard, or a conversation's table, may
    say otherwise.
    """
    for does, due in (
        ('say = ["ask query-ref"]', True),
        ('say = ["watch subscribe"], to = "asking"', True),
        ('to = "asking"', True),
        ('say = ["ask query-ref"], when = ["switch none"]', False),
        ('say = ["switch request"]', False),
        ('say = ["switch cancel"]', False),
        ('say = ["watch cancel"]', False),
        ('say = ["ask query-ref"], several = true', False),
        ('may = ["ask query-ref"]', False),
    ):
        for event, cause in (("Started", "restart"), ("Late ask", "late ask")):
            steps = hand(f'{{ in = ["idle"], on = "{cause}", {does} }}')
            assert bool(steps.why_not(did("idle", event))) is due, (event, does)
            assert not steps.why_not(did("idle", "Late watch"))


def test_what_is_outside_the_proof_is_not_compared() -> None:
    """A complaint, a conversation that broke, a state in which it does not wait."""
    assert not lamp().why_not(took("idle", act("switch", P.NOT_UNDERSTOOD), INFORM, after="busy"))
    for before, event in (("idle", "Broken switch"), ("lit", "Woken")):
        assert not lamp().why_not(did(before, event, INFORM, after="busy"))
    assert lamp().why_not(did("idle", "Woken", INFORM, after="busy"))


def test_rows_for_several_are_compared() -> None:
    """They are not explored, but they run."""
    steps = hand('{ in = ["idle"], on = "person wish", say = ["switch request"], several = true }')
    assert not steps.why_not(did("idle", "Local", REQUEST))
