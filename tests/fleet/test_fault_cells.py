"""Twelve fixed cells of the table of docs/reliability.md, a phase of the pour each, in real fleets as shipped."""

from pathlib import Path

import pytest

from companion.tools.system import JOB
from operate.cli.chaos import trial
from operate.cli.chaos.cells import Cell
from operate.cli.runs import trials

pytestmark = [pytest.mark.process, pytest.mark.long, pytest.mark.timeout(JOB.timeout_s + 120.0)]

CELLS = {
    "spoken": ("hang", "co", 60.0),
    "planning": ("kill", "pl", None),
    "approaching": ("cut", "ta", 5.0),
    "closing": ("kill", "loop", None),
    "lifted": ("hang", "ex", 60.0),
    "carrying": ("kill", "router", None),
    "second grasp": ("pause", "km", 3.0),
    "putting down": ("kill", "ta", None),
    "looking": ("kill", "monitor", None),
    "replanning": ("cut", "pl", 5.0),
    "pouring": ("kill", "loop", None),
    "finished": ("pause", "hi", 3.0),
}
"""Phase -> kind, process, seconds: each process at least once, the loop with a hand that closes and amid the pour."""


def test_each_phase_has_its_cell() -> None:
    """The phases are those of the job."""
    assert list(CELLS) == list(JOB.phases)


@pytest.mark.parametrize("phase", CELLS)
def test_the_pour_succeeds_all_the_same(phase: str, tmp_path: Path) -> None:
    """And every invariant of the whole history holds."""
    kind, process, for_s = CELLS[phase]
    cell = Cell(1 + list(CELLS).index(phase), kind, process, phase, JOB.phases[phase], for_s)
    asked = trials.Asked(1, cell.seed, "max", None, JOB.timeout_s, 0.0)
    done = trial.done(tmp_path, trials.here("chaos", (*JOB.command, "--faults"), asked), cell)
    assert done.began, done.text
    assert (done.success, done.broken, done.stuck, done.orphans) == (True, (), False, ()), done.why
