"""The companion's estimate, made of one recorded pour, is right beside others; every run shows its
requirements.

`pours/`: what was said in two pours of other seeds (`python -m services.monitor observations`), the
first on a free machine, the second while others worked on it, so that planning took twice as long.
"""

from pathlib import Path

import msgspec
import pytest

from companion.design import DESIGN
from topdown.check import recorded
from topdown.check.estimate import estimate, measure
from topdown.check.recorded import Observed
from topdown.check.requirements import Shown, trace
from topdown.model.findings import Kind

RUNS = Path(__file__).with_name("pours")
WITHIN = 0.3
COUNTED = ("communicates", "bytes")


def heard(name):
    """Return the traffic of a run."""
    return msgspec.json.decode((RUNS / name).read_bytes(), type=Observed)


def compared(name):
    """Every figure of the estimate beside that of the run."""
    return measure(DESIGN, estimate(DESIGN), heard(name))


@pytest.mark.parametrize("run", ["pour_seed_3.json", "pour_seed_11.json"])
def test_a_pour_is_as_it_was_estimated_on_any_machine(run):
    """Counts and bytes of every channel are within the error. It breaks nothing but latencies:
    every communicate is the design's, within its size. It shows every requirement that a run can
    show.
    """
    figures = [one for one in compared(run) if one.what in COUNTED]
    assert {one.where for one in figures} == set(DESIGN.channels)
    assert all(one.error is not None and abs(one.error) <= WITHIN for one in figures), figures
    assert {finding.kind for finding in recorded.findings(DESIGN, heard(run))} <= {Kind.TOO_LATE}
    found = trace(DESIGN, heard(run), lambda path, name: True)
    assert [one for leaf in found for one in leaf.evidence if one.shown is not Shown.SEEN] == []
    assert all(leaf.evidence for leaf in found)


def test_time_and_bandwidth_are_within_the_error_on_a_free_machine():
    """Latencies of milliseconds are the machine's and not the design's: they are told, and not
    promised.
    """
    shown = ("time", "mean bandwidth", "busy bandwidth")
    figures = [one for one in compared("pour_seed_3.json") if one.what in shown]
    assert len(figures) == 1 + 2 * len(DESIGN.channels)
    assert all(one.error is not None and abs(one.error) <= WITHIN for one in figures), figures


def test_the_narrow_place_of_the_estimate_is_that_of_the_run():
    """C4 while it plans, as in the paper (section 5.7)."""
    figures = [one for one in compared("pour_seed_3.json") if one.what == "busy bandwidth"]
    assert estimate(DESIGN).narrowest == max(figures, key=lambda one: one.recorded).where == "C4"
    assert estimate(DESIGN).slowest == "act"


def test_every_test_named_as_evidence_is_there():
    """By file and name."""
    root = Path(__file__).resolve().parents[2]

    def exists(path, name):
        file = root / path
        return file.is_file() and f"def {name}(" in file.read_text("utf-8")

    evidence = (one for leaf in trace(DESIGN, None, exists) for one in leaf.evidence)
    tests = [one for one in evidence if one.kind == "test"]
    assert tests
    assert all(one.shown is Shown.SEEN for one in tests), tests
