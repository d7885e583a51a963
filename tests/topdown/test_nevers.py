"""Rules of a design that must never be broken: read, and found broken."""

import pytest
from small import WATCHED, fleet, instead, kinds, watching, wrong

from topdown.model.errors import DesignError

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
