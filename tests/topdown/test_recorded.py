"""A recording is compared with the design: what it has not, what is over budget, what does not add
up.
"""

import math

import pytest
from spoiling import design, run, said

from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import QUERY, REQUEST
from topdown.check import recorded
from topdown.check.recorded import Observation, answers, difference
from topdown.model.design import Design
from topdown.model.findings import Kind


@pytest.fixture(scope="module")
def barrow() -> Design:
    """The sound design."""
    return design()


def test_a_run_within_the_design_has_no_findings(barrow: Design) -> None:
    """Not a single one."""
    assert recorded.findings(barrow, run()) == ()


@pytest.mark.parametrize(
    ("more", "kind", "words"),
    [
        ([said(9, "nav>atlas", "query", P.QUERY_REF, 201, "q2"),
          said(9, "atlas>nav", "query", P.INFORM, 9, "q2")],
         Kind.TOO_LARGE, "larger than 200 B, the largest 201 B"),
        ([said(9, "nav>atlas", "query", P.QUERY_REF, 9, "q2"),
          said(9.2, "atlas>nav", "query", P.INFORM, 9, "q2")],
         Kind.TOO_LATE, "1 of 2 answers took more than 0.1 s, the longest 0.2 s"),
        ([said(9, "desk>atlas", "query", P.QUERY_REF, 9, "q2")], Kind.NO_CHANNEL,
         "1 communicates from desk to atlas"),
        ([said(9, "nav>desk", "request", P.PROPOSE, 9, "o1")], Kind.NOT_DESIGNED,
         "1 propose in request"),
    ],
)  # fmt: skip
def test_what_is_outside_the_design_is_found(
    barrow: Design, more: list[Observation], kind: Kind, words: str
) -> None:
    """One finding, of the right kind, with the figures; where the design has the message, with its
    place.
    """
    (found,) = recorded.findings(barrow, run(*more))
    assert (found.kind, words in found.wrong) == (kind, True), str(found)
    assert bool(found.at) == (kind in (Kind.TOO_LARGE, Kind.TOO_LATE))


def test_as_much_as_the_budget_is_allowed(barrow: Design) -> None:
    """Neither a byte nor a moment less is asked for."""
    full = (
        said(9, "nav>atlas", "query", P.QUERY_REF, 200, "q2"),
        said(9.05, "atlas>nav", "query", P.INFORM, 900, "q2"),
    )
    assert recorded.findings(barrow, run(*full)) == ()


def test_the_budget_is_that_of_the_answer_the_design_names(barrow: Design) -> None:
    """`answer = ["inform"]`: the agree of a drive stops no clock."""
    (late,) = recorded.findings(barrow, run(slow=5.0))
    assert (late.kind, "drive" in late.where) == (Kind.TOO_LATE, True)
    (drive,) = answers(barrow, run().communicates)["drive"]
    assert drive.latency_s == pytest.approx(8.0)


def test_questions_without_answers_do_not_add_up(barrow: Design) -> None:
    """Every query has one answer and every inform on C4 one confirm, so nav and atlas say as
    much.
    """
    (found,) = recorded.findings(barrow, run(said(9, "nav>atlas", "query", P.QUERY_REF, 9, "q2")))
    assert (found.kind, found.wrong) == (Kind.UNBALANCED, "nav says 2 to atlas and hears 1")


def test_a_direction_that_is_never_heard_is_found(barrow: Design) -> None:
    """The design lets base answer, and it never did."""
    mute = run()
    heard = tuple(one for one in mute.communicates if one.sender != "base")
    found = recorded.findings(barrow, type(mute)(heard))
    assert [one.kind for one in found] == [Kind.NEVER_HEARD]


def test_messages_of_the_two_roles_are_bound_by_the_table() -> None:
    """A query may be asked again, so the asker may have said more; a request may be answered twice
    (agree, inform).
    """
    low, high = difference(QUERY)
    assert (low, high) == (0, math.inf)
    low, high = difference(REQUEST)
    assert low == -math.inf
    assert high <= 1
