"""Twelve fixed cells of the table of docs/results/faults.md, a phase of the pour each, in real
fleets as shipped.
"""

import pytest

from companion.tools.system import JOB, SYSTEM
from console.faults import chaos
from console.faults.chaos import Cell
from console.runs import experiment

pytestmark = [pytest.mark.process, pytest.mark.long, pytest.mark.timeout(JOB.timeout_s + 120.0)]

CELLS = {
    "spoken": ("hang", "co", 60.0),
    "planning": ("kill", "pl", None),
    "approaching": ("cut", "ta", 5.0),
    "closing": ("kill", "loop", None),
    "lifted": ("kill", "router", None),
    "carrying": ("pause", "loop", 3.0),
    "second grasp": ("kill", "ex", None),
    "putting down": ("kill", "ta", None),
    "looking": ("hang", "monitor", 60.0),
    "replanning": ("pause", "km", 3.0),
    "pouring": ("kill", "loop", None),
    "finished": ("pause", "hi", 3.0),
}
"""Phase -> kind, process, seconds: each process at least once, the loop with a hand that closes and
amid the pour.

Carrying, second grasp and looking are the worst found: in the table they did not pour at their
first try.
"""


def test_each_phase_kind_and_process_has_its_cell():
    """Those of the job and of the table; nobody waits for the page."""
    assert list(CELLS) == list(JOB.phases)
    assert {kind for kind, _, _ in CELLS.values()} == {"kill", "hang", "pause", "cut"}
    processes = {process.name for process in SYSTEM.processes} - {"page"}
    assert {name for _, name, _ in CELLS.values()} == processes


@pytest.mark.parametrize("phase", CELLS)
def test_the_pour_succeeds_all_the_same(phase, tmp_path):
    """And every invariant of the whole history holds."""
    kind, process, for_s = CELLS[phase]
    cell = Cell(1 + list(CELLS).index(phase), kind, process, phase, JOB.phases[phase], for_s)
    asked = experiment.Asked(1, cell.seed, "max", None, JOB.timeout_s, 0.0)
    done = chaos.done(
        tmp_path, experiment.setting_here("chaos", (*JOB.command, "--faults"), asked), cell
    )
    assert done.began, done.text
    assert (done.success, done.broken, done.stuck, done.orphans) == (True, (), False, ()), done.why
