"""The report of a recorded run of the fleet: seed 7, speed 1; every tenth record of telemetry and
truth is kept.
"""

import shutil
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from companion.tools.report import report
from companion.tools.system import SYSTEM
from operate.recording.records import Setting
from operate.recording.run import Run

POUR = Path(__file__).parents[2] / "histories" / "pour_seed_7"
MATRIX = {
    "co": {"hi": 21, "pl": 2, "ta": 19},
    "hi": {"co": 1},
    "km": {"pl": 116, "ta": 2},
    "pl": {"co": 4, "km": 116},
    "ta": {"co": 17, "km": 80, "ex": 14},
    "ex": {"ta": 28},
}


@pytest.fixture(scope="module")
def told() -> report.Report:
    """The report of the pour."""
    return report.build(Run(POUR, SYSTEM).history)


def test_the_pour_is_told_as_it_was(told: report.Report) -> None:
    """Success, counts and bytes are those known of this run; nothing is missing."""
    assert told.success
    assert told.poured_fraction == 1.0
    rows = told.communicates.matrix.items()
    assert {s: {r: n for r, n in row.items() if n} for s, row in rows} == MATRIX
    assert told.communicates.total == sum(sum(row.values()) for row in MATRIX.values())
    assert told.missing == ()
    assert told.holes == ()


def test_plans_are_told_as_they_were(told: report.Report) -> None:
    """Two plans; the first one waited for km, which had not heard of anything yet, and ended in the
    second.
    """
    first, second = told.plans
    assert (first.queries, first.communicates, first.ended) == (92, 184, "Replan")
    assert (second.queries, second.communicates, second.ended) == (22, 44, "Succeeded")
    assert first.wall_s == pytest.approx(10.8, abs=0.05)
    assert first.km_longest_s == pytest.approx(4.88, abs=0.05)
    assert second.km_longest_s < 0.02


def test_the_bowl_is_localized_by_the_look_after_the_put_down(told: report.Report) -> None:
    """Not by what was seen in passing when the hand let go of it."""
    at = {event.id: event.t for event in told.events}
    assert at["put-down bowl_1"] + 5 < at["localized bowl_1"] <= at["plan-ended 1 Replan"]


def test_times_are_those_of_acts(told: report.Report) -> None:
    """At speed 1 simulated and wall time run alike, but only acts count as simulated."""
    assert told.sim_time_s == pytest.approx(69.0, abs=0.2)
    assert told.wall_time_s == pytest.approx(85.6, abs=0.1)
    assert told.seed == 7
    assert told.loop is not None
    assert told.loop.paced
    assert told.loop.missed == 21


def test_without_a_clock_there_is_no_lateness() -> None:
    """A run that went as fast as it could has no deadlines: no figure is given, rather than
    zeros.
    """
    past = Run(POUR, SYSTEM).history
    fast = msgspec.structs.replace(past, setting=Setting(seed=7, speed="max"))
    loop = report.build(fast).loop
    assert loop is not None
    assert not loop.paced
    assert (loop.missed, loop.lateness_us.max) == (None, None)
    assert loop.compute_us.p50 == 655.0


@pytest.mark.process
def test_the_command_makes_the_same_report_again(told: report.Report, tmp_path: Path) -> None:
    """`python -m services.monitor report` on a copy of the folder, in a process of its own."""
    shutil.copy(POUR / "traffic.mcap", tmp_path)
    command = [sys.executable, "-m", "services.monitor", "report", str(tmp_path)]
    subprocess.run(command, check=True, capture_output=True, timeout=60)
    written = msgspec.json.decode((tmp_path / "report.json").read_bytes(), type=report.Report)
    assert written == told
