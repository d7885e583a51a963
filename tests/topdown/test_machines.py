"""Rows of a design file, read: what each says, which event it answers to, and every way to write
one that is wrong.
"""

import pytest
from small import (
    HAND,
    LAMP,
    WATCHED,
    design,
    fleet,
    found,
    instead,
    kinds,
    labels,
    machine,
    row,
    watching,
    wrong,
)

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import Role
from topdown.check import talks
from topdown.model.design import Design
from topdown.model.errors import DesignError
from topdown.model.machines import Cause, Event, Guard, ProtocolAct, machines

WISH = '{ in = ["idle"], on = "person wish", say = ["switch request"], to = "waiting" }'


def test_each_cause_is_read() -> None:
    """By its first word; everything else is a message of a use."""
    for on, event in (
        ("switch inform", Event(Cause.TAKE, "switch", P.INFORM)),
        ("switch inform[cancel]", Event(Cause.TAKE, "switch", P.INFORM, Kind.CANCEL)),
        ("late switch", Event(Cause.LATE, "switch")),
        ("back lamp", Event(Cause.BACK, "lamp")),
        ("own bored", Event(Cause.OWN, "bored")),
        ("person wish", Event(Cause.PERSON, "wish")),
        ("restart", Event(Cause.RESTART)),
    ):
        (one,) = machine("hand", [row("idle", on)]).rows
        assert (one.event, one.say, one.to, one.when, one.several) == (event, (), "", (), False)


def test_every_field_of_a_row_is_kept() -> None:
    """As the file has it."""
    lists = {"say": "switch agree, switch inform", "may": "switch failure", "drop": "ask"}
    lists |= {"when": "switch asked|agreed, watch settled", "owes": "watch", "waits": "switch"}
    told = row("idle, lit", "own done", **lists, moves="switch", to="busy")
    told = told.replace(" }", ", several = true }")
    (one,) = machine("lamp", [told], "switch", "ask", "watch").rows
    assert (one.number, one.states) == (1, {"idle", "lit"})
    agree, inform, failure = (
        ProtocolAct("switch", act, Kind.PLAIN) for act in (P.AGREE, P.INFORM, P.FAILURE)
    )
    assert (one.say, one.may) == ((agree, inform), (failure,))
    asked = Guard("switch", frozenset({"asked", "agreed"}))
    assert one.when == (asked, Guard("watch", frozenset({"settled"})))
    assert (one.drop, one.owes, one.waits) == (("ask",), ("watch",), ("switch",))
    assert (one.moves, one.to, one.several) == ("switch", "busy", True)
    assert str(one) == "row 1 (on own done say switch agree, switch inform, owes watch, to busy)"


CHOICE = (
    '{ name = "next", ways = [{ say = ["switch cancel"], to = "idle" }, { when = ["switch none"] },'
    ' { say = ["switch cancel"], when = ["switch asked"] }] }'
)


def test_a_choice_makes_a_row_of_each_of_its_ways() -> None:
    """Its words stand behind the row's, its guards hold besides, its state counts if it names one;
    the number stays.
    """
    words = {"say": "switch request", "when": "switch none", "to": "waiting", "then": "next"}
    rows = ['{ in = ["idle"], on = "own bored" }', row("idle", "person wish", **words)]
    made = machine("hand", rows, choice=CHOICE)
    assert [one.number for one in made.rows] == [1, 2, 2, 2]
    first, second, third = made.rows[1:]
    assert [str(said) for said in first.say] == ["switch request", "switch cancel"]
    assert (first.to, second.to, third.to) == ("idle", "waiting", "waiting")
    assert [len(one.when) for one in (first, second, third)] == [1, 2, 2]
    assert third.when == tuple(Guard("switch", frozenset({one})) for one in ("none", "asked"))


def test_a_row_that_cannot_be_read_is_named() -> None:
    """File, agent and number, what is wrong, and what there is."""
    for told, fault, right in (
        ('in = ["idel"], on = "restart"', "no state 'idel'", "there are asking, idle, waiting"),
        ('on = "swich agree"', "no protocol 'swich'", "there are ask, switch, watch"),
        ('on = "switch agrees"', "'agrees'", 'write "USE act" or "USE act[kind]"'),
        ('on = "switch"', "'switch': ", 'write "USE act"'),
        ('on = "restart now"', "no protocol 'restart'", "switch"),
        ('on = "late swich"', "no protocol 'swich'", "switch"),
        ('on = "back lump"', "`back lump` is about no peer of hand", "peers are lamp"),
        ('to = "wating"', "no state 'wating'", "waiting"),
        ('then = "next"', "no choice 'next'", "there are none"),
        ('say = ["swich request"]', "no protocol 'swich'", "switch"),
        ('say = ["switch inform[last]"]', "guard words", "USE act[kind]"),
        ('may = ["switch say"]', "'say'", "USE act[kind]"),
        ('drop = ["asks"]', "no volatile protocol to drop 'asks'", "ask, watch"),
        ('drop = ["switch"]', "no volatile protocol to drop 'switch'", "ask, watch"),
        ('owes = ["switch"]', "no latest protocol", "there are none"),
        ('owes = ["watch"]', "no latest protocol", "there are none"),
        ('moves = "lift"', "no protocol 'lift'", "switch"),
        ('waits = ["lift"]', "no protocol 'lift'", "switch"),
        ('when = ["swich none"]', "guard 'swich none' begins with no protocol", "switch"),
        ('when = ["switch asked|gone"]', "no state of switch 'gone'", "cancelling"),
        ('when = ["switch"]', "no state of switch ''", "settled"),
    ):
        words = told if "on = " in told else f'on = "restart", {told}'
        whole = words if words.startswith("in") else f'in = ["idle"], {words}'
        with pytest.raises(DesignError) as caught:
            machine("hand", [WISH, f"{{ {whole} }}"], "switch", "ask", "watch")
        assert fault in caught.value.wrong, told
        assert right in caught.value.right, told
        assert (caught.value.field, caught.value.file) == ("agent hand, row 2", "small.toml")


def test_a_way_of_a_choice_that_cannot_be_read_is_named() -> None:
    """Whichever rows go on with it, and if none does."""
    way = '{ name = "next", ways = [{ to = "wating" }] }'
    with pytest.raises(DesignError, match="agent hand, choice next, way 1: no state 'wating'"):
        machine("hand", ['{ in = ["idle"], on = "restart" }'], choice=way)


def test_only_who_is_subscribed_to_owes() -> None:
    """The lamp publishes, so it may owe; the hand may not (above)."""
    (one,) = machine("lamp", [row("idle", "own lit", owes="watch")], "watch").rows
    assert one.owes == ("watch",)


def test_a_guard_names_states_of_the_own_side() -> None:
    """The other side's are not known here."""
    with pytest.raises(DesignError, match=r"no state of switch 'cancelling'; there are .*stopping"):
        machine("lamp", ['{ in = ["idle"], on = "own lit", when = ["switch cancelling"] }'])


def test_both_sides_of_a_use() -> None:
    """Each side knows the opener and the delivery."""
    both = machines(design(HAND, LAMP, "switch", "watch"))
    sides = {name: one.uses["watch"] for name, one in both.items()}
    assert (sides["hand"].role, sides["hand"].peer) == (Role.INITIATOR, "lamp")
    assert (sides["lamp"].role, sides["lamp"].peer) == (Role.PARTICIPANT, "hand")
    uses = [both["hand"].uses[name] for name in ("switch", "watch")]
    assert [(use.durable, use.latest) for use in uses] == [(True, False), (False, True)]


def test_what_is_taken_where() -> None:
    """A message is taken where a row of the state names it, with its guard word; without rows
    everything is.
    """
    hand = machine("hand", HAND)
    assert hand.takes("waiting", "switch", P.INFORM, Kind.CANCEL)
    assert not hand.takes("idle", "switch", P.INFORM, Kind.CANCEL)
    assert not hand.takes("waiting", "switch", P.INFORM, Kind.PROGRESS)
    assert machine("hand", ()).takes("idle", "switch", P.INFORM, Kind.PROGRESS)


def test_where_it_waits_and_rests() -> None:
    """States that rows name, and the first; it rests in the first if nothing else is said."""
    lamp = machine("lamp", [row("busy", "own lit"), row("busy", "switch cancel", to="lit")])
    assert lamp.waits == {"idle", "busy", "lit"}
    assert lamp.rest == {"idle"}
    rests = machines(design(HAND, LAMP, hand_more='rest = ["waiting", "asking"]'))["hand"]
    assert rests.rest == {"waiting", "asking"}


def test_what_needs_no_message() -> None:
    """Everything but what is taken, by state."""
    found = machine("hand", HAND).spontaneous.items()
    names = {state: [one.event.name for one in rows] for state, rows in found}
    assert names == {"idle": ["wish"], "waiting": ["regret"]}


def test_words_for_people() -> None:
    """As files have them."""
    assert str(Event(Cause.TAKE, "switch", P.INFORM, Kind.CANCEL)) == "switch inform[cancel]"
    assert str(Event(Cause.LATE, "switch")) == "late switch"
    assert str(Event(Cause.RESTART)) == "restart"


def test_a_word_of_guards_is_no_state_of_a_protocol() -> None:
    """Request has a state "settled", request-when "waiting": a guard of that name once held for it,
    too.
    """
    for agent, use, words, states in (
        ("lamp", "later", "waiting|served|asked|none", {"asked", "none"}),
        ("hand", "switch", "settled|done|unsettled", {"done"}),
    ):
        (one,) = machine(agent, [row("idle", "restart", when=f"{use} {words}")], use).rows
        assert one.when[0].states == states


# --- Rules of a design that must never be broken: read, and found broken --------------------------


FAILS = row("busy", "own fail", owes="watch", say="watch failure", to="lit")
"""The lamp observes something and ends the subscription in the same step."""
RULE = """
[[never]]
name = "idle before it is known"
agent = "lamp"
says = ["watch agree"]
while = ["lamp owes watch", "lamp in idle|busy", "hand watch asked"]
text = "the lamp takes new subscribers only when the last one knows all"
"""


def test_a_rule_is_broken_where_all_its_conditions_hold() -> None:
    """Without the guard on the way to idle it is, after a death."""
    assert not kinds(watching(more=RULE), 2)
    lamp = instead(WATCHED, ', when = ["watch settled"]', "")
    for old, new in (
        ("watch agree", "watch refuse"),
        ("hand watch asked", "hand watch refused"),
    ):
        assert not kinds(watching(lamp=lamp, more=RULE.replace(old, new)), 1), new
    said = (
        "idle before it is known: the lamp takes new subscribers only when the last one knows all"
    )
    assert wrong(watching(lamp=lamp, more=RULE), 1) == said


def ruled(says: str, condition: str, *rows: str) -> Design:
    """The watched lamp with these rows in front, and one rule."""
    rule = f'[[never]]\nname = "rule"\nagent = "lamp"\nsays = ["{says}"]\nwhile = ["{condition}"]'
    return watching(lamp=(*rows, *WATCHED), more=rule)


def test_guards_and_while_are_evaluated_at_one_moment() -> None:
    """After the event, which takes a message or owes an observation, before the row says
    anything.
    """
    for words, holds in (("asked", True), ("none|live", False), ("live|asked", True)):
        guarded = instead(WATCHED, '["watch agree"]', f'["watch agree"], when = ["watch {words}"]')
        assert bool(found(watching(lamp=guarded)).findings) is not holds, words
        made = ruled("watch agree", f"lamp watch {words}")
        assert bool(found(made).findings) is holds, words
        never = [one for one in talks.findings(made) if one.where == "never rule"]
        assert not never if holds else "after the event" in never[0].wrong, words
    for guard, holds in (("watch unsettled", True), ("watch settled", False)):
        fails = row("busy", "own fail", owes="watch", say="watch failure", when=guard, to="lit")
        said = any("watch failure" in one for one in labels(watching(lamp=(fails, *WATCHED))))
        assert said is holds, guard
    assert wrong(ruled("watch failure", "lamp owes watch", FAILS)) == "rule"


def test_a_rule_that_cannot_be_read_is_named() -> None:
    """A word that nothing answers to would make it hold for ever."""
    for old, new, words in (
        ('agent = "lamp"', 'agent = "lump"', "no agent 'lump'; there are hand, lamp"),
        ('"watch agree"', '"wach agree"', "no protocol of lamp 'wach'; there are watch"),
        ('"watch agree"', '"watch agre"', "'agre'"),
        ("lamp in idle|busy", "lump in idle", "'lump in idle' is no condition"),
        ("lamp in idle|busy", "lamp in", "agents are hand, lamp"),
        ("lamp in idle|busy", "lamp has idle", "'lamp has idle' is no condition"),
        (
            "lamp in idle|busy",
            "lamp in idle|bussy",
            "lamp in idle|bussy': 'bussy'; there are busy, idle, lit",
        ),
        ("lamp owes watch", "hand owes watch", "'watch'; there are none"),
        ("lamp owes watch", "lamp owes ask", "'ask'; there are watch"),
        ("hand watch asked", "hand watch askt", "'askt'; there are asked, "),
    ):
        with pytest.raises(DesignError) as caught:
            fleet(watching(more=RULE.replace(old, new)))
        assert words in str(caught.value), new
        assert caught.value.field == "never idle before it is known"
