"""Planted regressions are found, equal sets pass, and the first communicate that differs is
named.
"""

import random
import shutil
from collections.abc import Sequence
from pathlib import Path

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from planted import Change, runs, said, times

from companion.tools.report.measures import PourFigures
from operate.experiments import comparing, results
from operate.experiments.comparing import Compared, Comparison, Verdict
from operate.experiments.run_figures import SentMessage
from operate.reports.counts import Latency, Spans

ENERGY = "energy of the body's joints"
POUR = Path(__file__).parents[2] / "histories" / "pour_seed_7"


def row(found: Comparison, name: str) -> Compared:
    """The row of a quantity."""
    return next(one for one in found.rows if one.name == name)


def slower(figures: PourFigures) -> PourFigures:
    """Plans come 40 % later."""
    rows = [msgspec.structs.replace(one, wall_s=1.4 * (one.wall_s or 0.0)) for one in figures.plans]
    told = [(one, one.answer) for one in figures.latency if one.answer]
    answers = [Latency(one.channel, one.use, 0.0, Spans(2, 1.4 * was.p50)) for one, was in told]
    return msgspec.structs.replace(figures, plans=tuple(rows), latency=tuple(answers))


def talkative(figures: PourFigures) -> PourFigures:
    """A quarter more is said."""
    more = msgspec.structs.replace(figures.communicates, total=526)
    return msgspec.structs.replace(figures, communicates=more)


def test_a_set_is_no_regression_of_itself() -> None:
    """Every judged difference is zero."""
    one = runs()
    found = comparing.compared(one, one)
    assert not found.regression
    assert {r.verdict for r in found.rows} <= {Verdict.SAME, Verdict.SHOWN, Verdict.OPEN}
    assert all(r.percent == pytest.approx(0.0) for r in found.rows if r.percent is not None)


@settings(max_examples=15, deadline=None)
@given(st.integers(1, 10_000), st.integers(1, 10_000))
def test_equal_sets_of_two_machines_pass(first: int, second: int) -> None:
    """Same robot, same seeds, other noise of 2 %: nothing is worse than 10 %."""
    assert not comparing.compared(runs(machine=first), runs(machine=second)).regression


def test_equal_sets_with_other_seeds_pass() -> None:
    """Then the scenes differ, too."""
    assert not comparing.compared(runs(), runs(range(101, 131))).regression


@pytest.mark.parametrize(
    ("change", "name"),
    [
        (times(1.3, "energy_J"), ENERGY),
        (times(1.3, "wall_time_s"), "command to end"),
        (times(1.3, "sim_time_s"), "simulated acts"),
        (slower, "plan 1: time"),
        (slower, "generate_plan: answer, half within"),
        (talkative, "communicates"),
    ],
)
def test_a_planted_regression_is_found_and_named(change: Change, name: str) -> None:
    """With the same seeds and with others; the other way round it is an improvement."""
    for seeds in (range(1, 31), range(201, 231)):
        before, after = runs(), runs(seeds, change=change, machine=2)
        found = comparing.compared(before, after)
        assert found.regression
        assert row(found, name).verdict is Verdict.WORSE
        back = comparing.compared(after, before)
        assert row(back, name).verdict is Verdict.BETTER


def test_only_what_was_made_worse_is_named() -> None:
    """Energy alone, where energy alone was planted."""
    found = comparing.compared(runs(), runs(change=times(1.3, "energy_J")))
    assert [one.name for one in found.rows if one.verdict is Verdict.WORSE] == [ENERGY]


def test_a_growth_within_the_threshold_is_no_regression() -> None:
    """5 % more energy: the same by the threshold of 10 %, worse by one of 2 %, open by one at 5
    %.
    """
    before, after = runs(), runs(change=times(1.05, "energy_J"))
    for limit, verdict in ((10.0, Verdict.SAME), (2.0, Verdict.WORSE), (5.0, Verdict.OPEN)):
        found = comparing.compared(before, after, comparing.thresholds([f"energy={limit}"]))
        assert row(found, ENERGY).verdict is verdict, limit


def test_a_few_runs_that_vary_do_not_make_a_regression() -> None:
    """Three runs a side with scenes of their own: 12 % more may be chance, and is called open."""
    others = runs(range(50, 53), change=times(1.12, "energy_J"))
    found = comparing.compared(runs(range(1, 4)), others)
    one = row(found, ENERGY)
    assert one.percent is not None
    assert one.verdict is Verdict.OPEN
    assert not found.regression


def test_lost_successes_are_a_regression_and_named() -> None:
    """A third of the runs fail: worse; one of thirty: open, for that may be chance. Each lost seed
    is told.
    """
    found = comparing.compared(runs(), runs(failing=range(1, 11)))
    assert row(found, "success").verdict is Verdict.WORSE
    assert [one.seed for one in found.lost] == list(range(1, 11))
    assert {one.why for one in found.lost} == {"the jar fell"}
    once = comparing.compared(runs(), runs(failing=[4]))
    assert row(once, "success").verdict is Verdict.OPEN
    assert not once.regression
    assert comparing.compared(runs(failing=range(1, 11)), runs()).lost == ()


def test_failed_runs_do_not_pull_the_means() -> None:
    """A run that broke off early took little time; it counts against success alone."""

    def broken(figures: PourFigures) -> PourFigures:
        return times(0.1, "wall_time_s", "energy_J")(figures) if figures.seed == 3 else figures

    found = comparing.compared(runs(), runs(change=broken, failing=[3]))
    assert row(found, "command to end").verdict is Verdict.SAME


def test_single_runs_have_no_interval_but_a_lost_success_counts() -> None:
    """Twice the energy stays open; a pour that failed does not."""
    one = runs([1])
    found = comparing.compared(one, runs([1], change=times(2.0, "energy_J")))
    assert row(found, ENERGY).verdict is Verdict.OPEN
    assert not found.regression
    assert comparing.compared(one, runs([1], failing=[1])).regression
    assert not comparing.compared(runs([1], failing=[1]), one).regression


@given(st.permutations(range(30)))
@settings(max_examples=10, deadline=None)
def test_the_order_of_lines_does_not_matter(order: list[int]) -> None:
    """An experiment that was interrupted and went on compares as one that was not."""
    one, other = runs(), runs(change=times(1.05, "energy_J"), machine=2)
    mixed = msgspec.structs.replace(other, results=tuple(other.results[n] for n in order))
    assert comparing.compared(one, mixed).rows == comparing.compared(one, other).rows


def test_thresholds_are_read_and_wrong_ones_named() -> None:
    """A number for all, or by kind; the later word wins."""
    assert comparing.thresholds([]) == comparing.THRESHOLDS
    assert set(comparing.thresholds(["20"]).values()) == {20.0}
    assert comparing.thresholds(["20", "energy=5"])["energy"] == 5.0
    for wrong in ("speed=3", "energy=", "energy=-1", "lots", "nan", "energy=inf"):
        with pytest.raises(ValueError, match="no threshold; give PERCENT, or success, latency"):
            comparing.thresholds([wrong])


# --- where what was said begins to differ ---------------------------------------------------------


def test_the_same_words_at_other_times_do_not_diverge() -> None:
    """Times, sizes, names of conversations and numbers in words make no difference."""
    for seed in range(2, 12):
        assert comparing.first(said(1), said(seed)) is None
    other = lambda one: msgspec.structs.replace(one, conversation=f"{one.conversation}x", size=1)  # noqa: E731
    assert comparing.first(said(1), [*map(other, said(2))]) is None


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 13), st.sampled_from(["performative", "kind", "text"]))
def test_a_planted_difference_is_the_first_found(at: int, field: str) -> None:
    """Whichever communicate is another one, and however: it is the one that is named."""
    rows = list(said(1))
    rows[at] = msgspec.structs.replace(rows[at], **{field: "quite another"})
    found = differs(said(1), rows)
    assert found.a == said(1)[at]
    assert found.b == rows[at]


def differs(a: Sequence[SentMessage], b: Sequence[SentMessage]) -> comparing.Divergence:
    """The first difference, which is there."""
    found = comparing.first(a, b)
    assert found is not None
    return found


def test_an_answer_that_did_not_come_is_named() -> None:
    """A's words are named, with nothing in B; the other way round likewise."""
    for at in range(1, 14, 2):
        rows = [one for n, one in enumerate(said(1)) if n != at]
        found, back = differs(said(1), rows), differs(rows, said(1))
        assert (found.a, found.b) == (said(1)[at], None)
        assert (back.a, back.b) == (None, said(1)[at])


def test_a_conversation_that_was_not_held_is_named() -> None:
    """Five queries in place of six: the sixth is what only A has."""
    rows = [one for one in said(1) if one.conversation != "pl-1-2"]
    found = differs(said(1), rows)
    assert (found.of, found.conversation, found.b) == ("pl to km, query", 6, None)


def test_of_two_differences_the_earlier_one_is_named() -> None:
    """By the time in A, across conversations."""
    rows = list(said(1))
    for at in (9, 2):
        rows[at] = msgspec.structs.replace(rows[at], kind="Other")
    found = differs(said(1), rows)
    assert found.a == said(1)[2]
    assert (found.of, found.conversation, found.position) == ("pl to km, query", 2, 1)


@given(st.integers(1, 10_000))
@settings(max_examples=30, deadline=None)
def test_conversations_side_by_side_may_be_interleaved_otherwise(seed: int) -> None:
    """Two conversations of different kinds, and two words that cross in one: any order as heard is
    the same.
    """
    pick, first, second = random.Random(seed), list(said(1)[:12]), list(said(1)[12:])
    mixed: list[SentMessage] = []
    while first or second:
        side = first if not second or (first and pick.random() < 0.5) else second
        mixed.append(msgspec.structs.replace(side.pop(0), t=float(len(mixed))))
    assert comparing.first(said(1), mixed) is None


def test_of_sets_each_common_seed_is_aligned() -> None:
    """Seeds that only one side has are left out."""
    other = runs(range(2, 8))
    changed = {seed: rows[:-1] if seed == 5 else rows for seed, rows in other.said.items()}
    found = comparing.compared(runs(range(1, 7)), msgspec.structs.replace(other, said=changed))
    assert [one.seed for one in found.diverged] == [2, 3, 4, 5, 6]
    assert [one.seed for one in found.diverged if one.first is not None] == [5]


def test_runs_of_other_seeds_are_not_aligned() -> None:
    """Neither two single ones, nor sets whose runs are only numbered; single ones without a seed
    are.
    """
    changed = {2: said(2)[:-1]}
    other = msgspec.structs.replace(runs([2]), said=changed)
    assert comparing.compared(runs([1]), other).diverged == ()
    unseeded = [
        msgspec.structs.replace(one, seeded=False)
        for one in (runs(range(1, 6)), runs(range(1, 6), failing=[2]))
    ]
    found = comparing.compared(*unseeded)
    assert (found.diverged, found.lost) == ((), ())
    assert {one.difference.method for one in found.rows if one.difference} <= {
        "too few runs",
        "Welch's t",
        "Newcombe",
    }
    singles = [msgspec.structs.replace(one, seeded=False) for one in (runs([1]), runs([1]))]
    assert [one.first for one in comparing.compared(*singles).diverged] == [None]


def test_recordings_of_one_seed_are_numbered(tmp_path: Path) -> None:
    """Two in one folder are no pair of two in another."""
    for name in ("one", "two"):
        shutil.copytree(POUR, tmp_path / name)
    found = results.load(tmp_path)
    assert [one.seed for one in found.results] == [1, 2]
    assert not found.seeded
    assert results.load(POUR).seeded


def test_a_recorded_run_compares_with_itself() -> None:
    """A real one: by folder and by file; every figure there, nothing diverges."""
    found = comparing.compared(results.load(POUR), results.load(POUR / "traffic.mcap"))
    assert found.runs == (1, 1)
    assert row(found, "communicates").a == row(found, "communicates").b
    assert [one.first for one in found.diverged] == [None]
    assert not found.regression
