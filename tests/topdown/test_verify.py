"""Proof obligations of a design for each option, and the words of a verdict."""

import pytest
import spoiling
from small import ANSWERER, ASKER, FLICKERS, HAND, LAMP, TOLD, design, questions, verdicts, watching

from topdown.prove.verify import tasks


def test_all_that_is_to_be_proven_comes_in_order() -> None:
    """The stream, each use, all agents from the start and from rest."""
    made = design((*HAND, *ASKER), (*LAMP, *ANSWERER), "switch", "ask")
    told = [(task.layer, task.what) for task in tasks(made, gone=["lamp"])]
    assert told == [
        (1, "durable stream"),
        (1, "physical act"),
        (2, "C1 switch"),
        (2, "C1 ask"),
        (3, "all agents, starting"),
        (3, "all agents"),
        (3, "lamp dies for good"),
    ]
    assert [task.layer for task in tasks(questions())] == [2, 3, 3], "nothing of it is durable"


def test_how_many_faults() -> None:
    """As many as asked for, any number included; the start is explored without. More faults have
    more states.
    """
    counts = []
    for faults in (0, 1, 2, None):
        found_ones = verdicts(questions(), faults=faults)
        assert [one.faults for one in found_ones] == [faults, 0, faults]
        assert all(one.holds for one in found_ones)
        counts.append(found_ones[-1].states)
    assert counts[:3] == sorted(set(counts[:3]))


def test_a_step_is_about_layer_2() -> None:
    """Only the channels it made or changed; a step there is not is an error."""
    assert [task.what for task in tasks(design(HAND, LAMP), step=1)] == ["C1 switch"]
    assert list(tasks(design(HAND, LAMP), step=1, layers=(1, 3))) == []
    assert [task.what for task in tasks(spoiling.design(), step=4)] == ["C4 ask", "C4 tell_place"]
    with pytest.raises(IndexError, match="steps 1 to 1"):
        list(tasks(design(HAND, LAMP), step=2))


def test_gone_is_about_who_talks_to_people() -> None:
    """The hand's wish has no end when the lamp is dead, since no row tells it."""
    *_, last = verdicts(design(HAND, LAMP), layers=(3,), gone=["lamp"])
    assert (last.what, last.faults) == ("lamp dies for good", 0)
    assert last.findings
    asks = tuple(row.replace("own wonder", "person wonder") for row in ASKER)
    *_, told = verdicts(questions(asks), layers=(3,), gone=["lamp"])
    assert told.holds


def test_what_a_limit_leaves_open_is_said() -> None:
    """No verdict, though nothing was found."""
    for layer, wish in ((3, {"faults": 2}), (2, {})):
        one = verdicts(watching(), layers=(layer,), seconds=1e-9, **wish)[-1]
        assert (one.holds, one.findings) == (False, ())
        assert "stopped at the limit of 1e-09 CPU seconds" in one.open[0]


def test_agents_without_rows_are_not_composed() -> None:
    """That is open, not proven."""
    for one in verdicts(design((), LAMP), layers=(3,), faults=None):
        assert one.open == ("agents without rows cannot be composed: hand",)
        assert not one.holds
        assert one.faults == (0 if one.what.endswith("starting") else None)


def test_rows_not_needed_are_notes_of_the_last_verdict() -> None:
    """They are nothing wrong; the start alone need not use all."""
    never = '{ in = ["busy"], on = "own never", when = ["switch none"] }'
    start, last = verdicts(design(HAND, (*LAMP, never)), layers=(3,))
    assert (start.notes, last.notes) == ((), ("row never used: lamp 5 (in busy on own never)",))
    assert last.holds


def test_a_word_left_out_wrongly_is_open() -> None:
    """The progress would stand in the way in a state that has no row for it."""
    deaf = TOLD.replace("waiting", "idle")
    last = verdicts(design((*HAND, deaf), (*LAMP, FLICKERS)), layers=(3,))[-1]
    assert not last.findings
    assert last.open[0].endswith("switch inform[progress] is not without effect")
    assert not last.holds
