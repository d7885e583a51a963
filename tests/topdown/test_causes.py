"""A finding of the composed system names where it is stuck: who waits for whom, in which state, and
the row that is missing or does not apply.
"""

from small import (
    HAND,
    LAMP,
    STUCK,
    design,
    instead,
    less,
    row,
    use,
    verdicts,
)
from test_checks_of_depot import BOTH, spoilt

from topdown.model.design import Design
from topdown.prove.engine import WRONG, as_text


def causes(made: Design, *kinds: str, **wish: object) -> str:
    """The causes of its only finding of layer 3, in lines."""
    found = [one for verdict in verdicts(made, layers=(3,), **wish) for one in verdict.findings]
    assert found
    assert {one.kind for one in found} <= set(kinds or STUCK)
    assert all(cause[:50] in as_text(found[-1], 200) for cause in found[-1].causes)
    return "\n".join(found[-1].causes)


def test_a_word_that_nobody_says_is_named_with_the_row_that_could() -> None:
    """The lamp agrees and never says that it is lit: its own row stands elsewhere. The hand, which
    waits for it, follows.
    """
    made = design(
        HAND, instead(LAMP, 'in = ["busy"], on = "own lit"', 'in = ["lit"], on = "own lit"')
    )
    told = causes(made, faults=0)
    assert told.startswith("lamp in busy: switch is agreed, where only lamp can go on, by")
    assert "row 4 (small.toml:" in told
    assert "stands in lit only: add busy to its `in`" in told
    assert told.endswith("what follows: hand in waiting waits for lamp")
    line = int(told.partition("row 4 (small.toml:")[2].partition(")")[0])
    assert "row" in made.text.splitlines()[line - 1]


def test_where_no_row_says_it_one_is_missing() -> None:
    """Not a word of others."""
    told = causes(design(HAND, less(LAMP, "own lit")), faults=0)
    assert "add a row that says" in told
    assert told.splitlines()[0].startswith("lamp in busy: ")


def test_a_word_that_nobody_takes_is_named_in_its_inbox() -> None:
    """The hand has no row for a refusal where it waits."""
    told = causes(design(less(HAND, "refuse"), LAMP), faults=0)
    first = "hand in waiting: `switch refuse` of lamp is at the head of its inbox, and no row"
    assert told.startswith(first)
    assert "add a row on `switch refuse` in waiting" in told


def test_a_guard_that_does_not_hold_is_named() -> None:
    """The lamp would say it, were the watch open."""
    guarded = instead(LAMP, 'when = ["switch agreed"]', 'when = ["switch agreed", "later asked"]')
    told = causes(design(HAND, guarded, "switch", "later"), faults=0)
    assert "has the guard `later asked`, and later is none" in told


def test_a_word_that_no_row_covers_is_told_with_the_rows_that_take_it() -> None:
    """The hand takes a refusal only in a conversation that is overtaken."""
    told = causes(design(less(HAND, 'when = ["switch refused"]'), LAMP), WRONG, faults=0)
    assert told.startswith("hand in waiting: row 4 (small.toml:")


def test_who_waits_for_one_that_is_gone_needs_a_row_for_the_end_of_the_wait() -> None:
    """The lamp dies for good; the hand has no row for that."""
    told = causes(design(less(HAND, "regret"), LAMP), faults=0, gone=["lamp"])
    assert (
        "switch is asked, and lamp is gone for good; add a row on `late switch` in waiting" in told
    )


def test_two_that_wait_for_each_other_are_both_named() -> None:
    """A circle has no first cause."""
    pair = use("again", "request", {"lamp": "request", "hand": "inform"})
    hand = (
        row("idle", "own wish", say="switch request", to="waiting"),
        row("waiting", "switch inform", to="idle"),
        row("idle", "again request", say="again inform"),
    )
    lamp = (
        row("idle", "own wish", say="again request", to="busy"),
        row("busy", "again inform", to="idle"),
        row("idle", "switch request", say="switch inform"),
    )
    told = causes(design(hand, lamp, more=pair), faults=0)
    assert "hand in waiting: `again request` of lamp is at the head" in told
    assert "lamp in busy: `switch request` of hand is at the head" in told


def test_a_losing_bidder_that_is_never_told_is_traced_to_its_row() -> None:
    """Of the depot: row 13 takes the other's offer, and leaves ox without a word."""
    changed = spoilt((f'{BOTH}"tender_ox reject-proposal", ', BOTH))
    told = causes(changed, faults=0)
    assert "dispatcher in idle: tender_ox is offered, where only dispatcher can go on" in told
    line = changed.text[: changed.text.index(BOTH)].count("\n") - 2
    assert f"since then it took row 13 ({changed.path}:{line})" in told
    assert told.endswith("what follows: ox in offering waits for dispatcher")
