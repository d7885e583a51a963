"""Design and code are compared both ways: whatever one has and the other lacks is a finding."""

from pathlib import Path

import pytest

from topdown.check import agreement
from topdown.model.design import Design, load
from topdown.model.errors import NoSuchEntry
from topdown.model.findings import Kind


@pytest.fixture(scope="module")
def lamp() -> Design:
    """A design with one language, one query and two agents."""
    return load(Path(__file__).with_name("lamp.toml"))


def test_classes_are_compared_with_the_languages(lamp: Design) -> None:
    """A class that a language lacks is named, with those it has."""
    assert agreement.check_languages(lamp, {"L": ["On", "Lit"]}) == ()
    found = agreement.check_languages(lamp, {"L": ["On"]})
    assert found
    assert all("'Lit'" in finding.wrong and "On" in finding.right for finding in found)


def test_a_class_that_no_message_carries_is_found(lamp: Design) -> None:
    """The code has it, the design never says it."""
    (found,) = agreement.check_languages(lamp, {"L": ["On", "Lit", "Dim"]})
    assert (found.kind, "Dim" in found.wrong) == (Kind.UNUSED, True)


def test_languages_are_compared_both_ways(lamp: Design) -> None:
    """One without a module and a module without a language."""
    found = agreement.check_languages(lamp, {"M": []})
    assert {finding.where for finding in found} >= {"language L", "language M"}


def test_kinds_of_queries_are_compared_both_ways(lamp: Design) -> None:
    """A kind without entry and an entry without kind are both found."""
    assert agreement.check_queries(lamp, ["switching"], "L", ["On"]) == ()
    missing, foreign = agreement.check_queries(lamp, ["switching"], "L", ["Off"])
    assert (missing.kind, missing.where) == (Kind.NOT_ASKED, "L.Off")
    assert (foreign.kind, foreign.where) == (Kind.NOT_SUPPORTED, "L.On")


def test_what_is_declared_must_be_answered(lamp: Design) -> None:
    """A query that the agent's code does not answer, and an answer that nobody can ask for."""
    assert agreement.check_supported(lamp, "lamp", ["L.On"]) == ()
    unanswered, unasked = agreement.check_supported(lamp, "lamp", ["L.Dim"])
    assert (unanswered.kind, "L.On" in unanswered.where) == (Kind.NOT_SUPPORTED, True)
    assert (unasked.kind, unasked.where) == (Kind.NOT_ASKED, "L.Dim")


def test_a_look_up_that_fails_lists_what_there_is(lamp: Design) -> None:
    """The error names the kind, the name and the known ones."""
    with pytest.raises(NoSuchEntry) as caught:
        lamp.agent("foot")
    assert caught.value.known == ("hand", "lamp")
