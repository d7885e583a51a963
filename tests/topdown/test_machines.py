"""Rows of a design file, read: what each says, which event it answers to, and every way to write
one that is wrong.
"""

import pytest
from small import HAND, LAMP, design, machine

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import Role
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
        (row,) = machine("hand", [f'{{ in = ["idle"], on = "{on}" }}']).rows
        assert (row.event, row.say, row.to, row.when, row.several) == (event, (), "", (), False)


def test_every_field_of_a_row_is_kept() -> None:
    """As the file has it."""
    (row,) = machine(
        "lamp",
        [
            '{ in = ["idle", "lit"], on = "own done", say = ["switch agree", "switch inform"], may'
            ' = ["switch failure"], drop = ["ask"], when = ["switch asked|agreed", "watch'
            ' settled"], owes = ["watch"], moves = "switch", waits = ["switch"], to = "busy",'
            " several = true }"
        ],
        "switch",
        "ask",
        "watch",
    ).rows
    assert row.number == 1
    assert row.states == {"idle", "lit"}
    assert row.say == (
        ProtocolAct("switch", P.AGREE, Kind.PLAIN),
        ProtocolAct("switch", P.INFORM, Kind.PLAIN),
    )
    assert row.may == (ProtocolAct("switch", P.FAILURE, Kind.PLAIN),)
    assert row.when == (
        Guard("switch", frozenset({"asked", "agreed"})),
        Guard("watch", frozenset({"settled"})),
    )
    assert row.waits == ("switch",)
    assert (row.drop, row.owes, row.moves, row.to, row.several) == (
        ("ask",),
        ("watch",),
        "switch",
        "busy",
        True,
    )
    assert str(row) == "row 1 (on own done say switch agree, switch inform, to busy)"


CHOICE = (
    '{ name = "next", ways = [{ say = ["switch cancel"], to = "idle" }, { when = ["switch none"] },'
    ' { say = ["switch cancel"], when = ["switch asked"] }] }'
)


def test_a_choice_makes_a_row_of_each_of_its_ways() -> None:
    """Its words stand behind the row's, its guards hold besides, its state counts if it names one;
    the number stays.
    """
    row = (
        '{ in = ["idle"], on = "person wish", say = ["switch request"], when = ["switch none"], to'
        ' = "waiting", then = "next" }'
    )
    made = machine("hand", ['{ in = ["idle"], on = "own bored" }', row], choice=CHOICE)
    assert [one.number for one in made.rows] == [1, 2, 2, 2]
    first, second, third = made.rows[1:]
    assert [str(said) for said in first.say] == ["switch request", "switch cancel"]
    assert (first.to, second.to, third.to) == ("idle", "waiting", "waiting")
    assert [len(one.when) for one in (first, second, third)] == [1, 2, 2]
    assert third.when == (
        Guard("switch", frozenset({"none"})),
        Guard("switch", frozenset({"asked"})),
    )


def test_a_row_that_cannot_be_read_is_named() -> None:
    """File, agent and number, what is wrong, and what there is."""
    for row, wrong, right in (
        ('{ in = ["idel"], on = "restart" }', "no state 'idel'", "there are asking, idle, waiting"),
        ('{ in = ["idle"], on = "restart", to = "wating" }', "no state 'wating'", "waiting"),
        ('{ in = ["idle"], on = "restart", then = "next" }', "no choice 'next'", "there are none"),
        (
            '{ in = ["idle"], on = "swich agree" }',
            "no protocol 'swich'",
            "there are ask, switch, watch",
        ),
        (
            '{ in = ["idle"], on = "switch agrees" }',
            "'agrees'",
            'write "USE act" or "USE act[kind]"',
        ),
        ('{ in = ["idle"], on = "switch" }', "'switch': ", 'write "USE act"'),
        ('{ in = ["idle"], on = "restart now" }', "no protocol 'restart'", "switch"),
        ('{ in = ["idle"], on = "late swich" }', "no protocol 'swich'", "switch"),
        ('{ in = ["idle"], on = "back lump" }', "no agent 'lump'", "there are hand, lamp"),
        (
            '{ in = ["idle"], on = "restart", say = ["swich request"] }',
            "no protocol 'swich'",
            "switch",
        ),
        (
            '{ in = ["idle"], on = "restart", say = ["switch inform[last]"] }',
            "guard words",
            "USE act[kind]",
        ),
        ('{ in = ["idle"], on = "restart", may = ["switch say"] }', "'say'", "USE act[kind]"),
        (
            '{ in = ["idle"], on = "restart", drop = ["asks"] }',
            "no volatile protocol to drop 'asks'",
            "ask, watch",
        ),
        (
            '{ in = ["idle"], on = "restart", drop = ["switch"] }',
            "no volatile protocol to drop 'switch'",
            "ask, watch",
        ),
        (
            '{ in = ["idle"], on = "restart", owes = ["switch"] }',
            "no latest protocol",
            "there are none",
        ),
        (
            '{ in = ["idle"], on = "restart", owes = ["watch"] }',
            "no latest protocol",
            "there are none",
        ),
        ('{ in = ["idle"], on = "restart", moves = "lift" }', "no protocol 'lift'", "switch"),
        ('{ in = ["idle"], on = "restart", waits = ["lift"] }', "no protocol 'lift'", "switch"),
        (
            '{ in = ["idle"], on = "restart", when = ["swich none"] }',
            "no protocol 'swich'",
            "switch",
        ),
        (
            '{ in = ["idle"], on = "restart", when = ["switch asked|gone"] }',
            "no state of switch 'gone'",
            "cancelling",
        ),
        (
            '{ in = ["idle"], on = "restart", when = ["switch"] }',
            "no state of switch ''",
            "settled",
        ),
    ):
        with pytest.raises(DesignError) as caught:
            machine("hand", [WISH, row], "switch", "ask", "watch")
        assert wrong in caught.value.wrong, row
        assert right in caught.value.right, row
        assert (caught.value.field, caught.value.file) == ("agent hand, row 2", "small.toml")


def test_a_way_of_a_choice_that_cannot_be_read_is_named_by_its_row() -> None:
    """It has no line of its own."""
    way = '{ name = "next", ways = [{ to = "wating" }] }'
    with pytest.raises(DesignError, match="agent hand, row 1: no state 'wating'"):
        machine("hand", ['{ in = ["idle"], on = "restart", then = "next" }'], choice=way)


def test_only_who_is_subscribed_to_owes() -> None:
    """The lamp publishes, so it may owe; the hand may not (above)."""
    (row,) = machine("lamp", ['{ in = ["idle"], on = "own lit", owes = ["watch"] }'], "watch").rows
    assert row.owes == ("watch",)


def test_a_guard_names_states_of_the_own_side() -> None:
    """The other side's are not known here."""
    with pytest.raises(DesignError, match=r"no state of switch 'cancelling'; there are .*stopping"):
        machine("lamp", ['{ in = ["idle"], on = "own lit", when = ["switch cancelling"] }'])


def test_both_sides_of_a_use() -> None:
    """Each side knows the opener and the delivery."""
    both = machines(design(HAND, LAMP, "switch", "watch"))
    assert {
        name: (one.uses["watch"].role, one.uses["watch"].peer) for name, one in both.items()
    } == {
        "hand": (Role.INITIATOR, "lamp"),
        "lamp": (Role.PARTICIPANT, "hand"),
    }
    switch, watch = both["hand"].uses["switch"], both["hand"].uses["watch"]
    assert (switch.durable, switch.latest, watch.durable, watch.latest) == (
        True,
        False,
        False,
        True,
    )


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
    rows = [
        '{ in = ["busy"], on = "own lit" }',
        '{ in = ["busy"], on = "switch cancel", to = "lit" }',
    ]
    lamp = machine("lamp", rows)
    assert lamp.waits == {"idle", "busy", "lit"}
    assert lamp.rest == {"idle"}
    rests = machines(design(HAND, LAMP, hand_more='rest = ["waiting", "asking"]'))["hand"]
    assert rests.rest == {"waiting", "asking"}


def test_what_needs_no_message() -> None:
    """Everything but what is taken, by state."""
    hand = machine("hand", HAND)
    assert {
        state: [row.event.name for row in rows] for state, rows in hand.spontaneous.items()
    } == {
        "idle": ["wish"],
        "waiting": ["regret"],
    }


def test_words_for_people() -> None:
    """As files have them."""
    assert str(Event(Cause.TAKE, "switch", P.INFORM, Kind.CANCEL)) == "switch inform[cancel]"
    assert str(Event(Cause.LATE, "switch")) == "late switch"
    assert str(Event(Cause.RESTART)) == "restart"


def test_a_word_of_guards_is_no_state_of_a_protocol() -> None:
    """Request has a state "settled", request-when "waiting": a guard of that name once held for it,
    too.
    """
    (row,) = machine(
        "lamp",
        ['{ in = ["busy"], on = "own lit", when = ["later waiting|served|asked|none"] }'],
        "later",
    ).rows
    assert row.when[0].states == {"asked", "none"}
    (row,) = machine(
        "hand", ['{ in = ["idle"], on = "restart", when = ["switch settled|done|unsettled"] }']
    ).rows
    assert row.when[0].states == {"done"}
