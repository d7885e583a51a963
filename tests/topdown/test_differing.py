"""Differences between two designs, entry by entry, whatever their order, with their
consequences.
"""

from spoiling import Change, design

from topdown.check.difference import Change as Told
from topdown.check.difference import Way, diff


def changes(*some: Change) -> tuple[Told, ...]:
    """From the sound design to the changed one."""
    return diff(design(), design(*some))


LANGUAGE, NEXT = '[[language]]\nname = "WAY"', "[[ontology]]"


def test_order_and_blanks_are_no_change() -> None:
    """Sets and entries may stand in any order; a design does not differ from itself."""
    text = design().text
    way = text[text.index(LANGUAGE) : text.index('[[language]]\nname = "PLACE"')]
    for some in (
        (),
        (('content = ["Lost"]', 'content = [ "Lost" ]'),),
        (('performatives = ["request", "cancel"]', 'performatives = ["cancel", "request"]'),),
        (('talks = ["ask", "order"]', 'talks = ["order", "ask"]'),),
        ((way, ""), (NEXT, way + NEXT)),
    ):
        assert changes(*some) == (), some


def test_a_field_is_told_with_both_values() -> None:
    """One that changed, one that was not there, and one that is gone."""
    (told,) = changes(("latency_s = 1.0", "latency_s = 2.0"))
    assert told == Told(Way.CHANGED, "protocol", "order", "latency_s", "1", "2")
    added = design(("latency_s = 1.0", 'latency_s = 1.0\nruling = "at once"'))
    for found, values in ((diff(design(), added), ("", "at once")),
                          (diff(added, design()), ("at once", ""))):  # fmt: skip
        (told,) = found
        assert (told.field, told.old, told.new) == ("ruling", *values)


def test_a_message_that_is_gone_takes_its_rule_with_it() -> None:
    """The written change, and the derived one."""
    gone = '  { sender = "desk", performative = "cancel", language = "WAY", bytes = 100 },\n'
    assert [(one.way, one.kind, one.name, one.derived) for one in changes((gone, ""))] == [
        (Way.REMOVED, "message", "order: desk cancel", False),
        (Way.REMOVED, "rule", "desk to nav: request cancel", True),
    ]


def test_a_channel_that_moves_is_told() -> None:
    """The steps say it in one place; the ends of the channel follow."""
    split = 'split = [{ channel = "C1", into = ["C3", "C4"] }]'
    told = changes((split, split.replace('"C3", "C4"', '"C4", "C3"')))
    base, atlas = "base and nav", "atlas and nav"
    ends = {one.name: (one.old, one.new) for one in told if one.derived and one.field == "ends"}
    assert ends == {"C3": (base, atlas), "C4": (atlas, base)}


def test_the_order_of_arcs_and_of_a_rows_words_means_something() -> None:
    """The first arc that holds is taken; a row whose words change places is another row."""
    first = '{ source = "asking", target = "driving", when = "way_found" }'
    second = '{ source = "asking", target = "idle" }'
    (told,) = changes((f"{first},\n  {second}", f"{second},\n  {first}"))
    assert (told.kind, told.name, told.field) == ("agent", "nav", "arcs of asking")
    row = '["start", "receive", "inform", "hearing"]'
    moved = changes((row, '["hearing", "receive", "inform", "start"]'))
    assert {(one.kind, one.name) for one in moved} == {("table", "tell")}


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
