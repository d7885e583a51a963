"""Differences between two designs, entry by entry, whatever their order, with their
consequences.
"""

import pytest
from spoiling import Change, design

from topdown.check.difference import Change as Told
from topdown.check.difference import Way, diff


def changes(*some: Change) -> tuple[Told, ...]:
    """From the sound design to the changed one."""
    return diff(design(), design(*some))


def test_nothing_changed() -> None:
    """A design does not differ from itself."""
    assert changes() == ()


@pytest.mark.parametrize(
    "change",
    [
        ('content = ["Lost"]', 'content = [ "Lost" ]'),
        ('performatives = ["request", "cancel"]', 'performatives = ["cancel", "request"]'),
        ('talks = ["ask", "order"]', 'talks = ["order", "ask"]'),
    ],
)
def test_order_and_blanks_are_no_change(change: Change) -> None:
    """Sets in the file may stand in any order."""
    assert changes(change) == ()


def test_entries_in_another_order_are_no_change() -> None:
    """Two languages change places."""
    one, other = '[[language]]\nname = "WAY"', "[[ontology]]"
    text = design().text
    way = text[text.index(one) : text.index('[[language]]\nname = "PLACE"')]
    assert changes((way, ""), (other, way + other)) == ()


def test_a_changed_figure_is_told_with_both_values() -> None:
    """Field, old, new."""
    (told,) = changes(("latency_s = 1.0", "latency_s = 2.0"))
    assert told == Told(Way.CHANGED, "protocol", "order", "latency_s", "1", "2")


def test_a_field_that_was_not_there_is_told() -> None:
    """And one that is gone."""
    added: Change = ("latency_s = 1.0", 'latency_s = 1.0\nruling = "at once"')
    (told,) = changes(added)
    assert (told.field, told.old, told.new) == ("ruling", "", "at once")
    (gone,) = diff(design(added), design())
    assert (gone.field, gone.old, gone.new) == ("ruling", "at once", "")


def test_a_message_that_is_gone_takes_its_rule_with_it() -> None:
    """The written change, and the derived one."""
    gone = '  { sender = "desk", performative = "cancel", language = "WAY", bytes = 100 },\n'
    written, derived = changes((gone, ""))
    assert (written.way, written.kind, written.name) == (
        Way.REMOVED,
        "message",
        "order: desk cancel",
    )
    assert (derived.way, derived.kind, derived.derived) == (Way.REMOVED, "rule", True)
    assert derived.name == "desk to nav: request cancel"


def test_a_channel_that_moves_is_told() -> None:
    """The steps say it in one place; the ends of the channel follow."""
    told = changes(
        (
            'split = [{ channel = "C1", into = ["C3", "C4"] }]',
            'split = [{ channel = "C1", into = ["C4", "C3"] }]',
        )
    )
    ends = {one.name: (one.old, one.new) for one in told if one.derived and one.field == "ends"}
    assert ends == {
        "C3": ("base and nav", "atlas and nav"),
        "C4": ("atlas and nav", "base and nav"),
    }


def test_the_order_of_arcs_means_something() -> None:
    """The first arc that holds is taken."""
    first, second = (
        '{ source = "asking", target = "driving", when = "way_found" }',
        '{ source = "asking", target = "idle" }',
    )
    (told,) = changes((f"{first},\n  {second}", f"{second},\n  {first}"))
    assert (told.kind, told.name, told.field) == ("agent", "nav", "arcs of asking")


def test_rows_of_a_table_are_not_sets() -> None:
    """A row whose words change places is another row."""
    told = changes(
        ('["start", "receive", "inform", "hearing"]', '["hearing", "receive", "inform", "start"]')
    )
    assert {(one.kind, one.name) for one in told} == {("table", "tell")}


def test_there_and_back_is_the_opposite() -> None:
    """Each entry added one way is removed the other way."""
    other = design(
        ("[[ontology]]", '[[language]]\nname = "X"\n\n[[ontology]]'),
        ("latency_s = 9.0", "latency_s = 8.0"),
    )
    there, back = diff(design(), other), diff(other, design())
    assert {(one.kind, one.name, one.old, one.new) for one in there} == {
        (b.kind, b.name, b.new, b.old) for b in back
    }
