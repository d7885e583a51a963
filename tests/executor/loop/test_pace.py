"""Whether the machine holds 500 Hz: late cycles are counted as they are, and the program says so in JSON."""

import subprocess
import sys

import msgspec
import pytest

from companion.tools.verbs.pace import Pace
from services.executor.loop.core import LoopCore
from services.executor.loop.pace import measure
from services.executor.loop.timing import Pacer
from velma.sim.mock_backend import MockBackend


class Slow(MockBackend):
    """A cycle of it takes `work_s`; every tenth `seldom_s`."""

    def __init__(self, clock, work_s, seldom_s):
        super().__init__()
        self._clock, self._work_s, self._seldom_s, self._steps = clock, work_s, seldom_s, 0

    def step(self, command):
        super().step(command)
        self._steps += 1
        self._clock.now += self._seldom_s if self._steps % 10 == 0 else self._work_s


@pytest.mark.parametrize(
    ("work_s", "seldom_s", "late", "held"),
    [(0.001, 0.001, 0, True), (0.001, 0.0025, 50, True), (0.0015, 0.0045, 250, False), (0.003, 0.003, 740, False)],
)
def test_a_pace_is_held_where_few_cycles_are_late(clock, work_s, seldom_s, late, held):
    """Of 500 cycles: none, every tenth, five of ten, all but the first (they take 1.5 s, 750 periods)."""
    core = LoopCore(Slow(clock, work_s, seldom_s))
    found = measure(core, Pacer(core.backend.period_s))
    assert found.held is held
    assert found.late == pytest.approx(late, abs=0.1 * late)
    assert core.faults == 0
    assert core.report.phase == "running", "it was moving all the time"


@pytest.mark.process
def test_the_program_says_it_in_words_that_the_console_reads():
    """A real second of the simulated robot, in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-m", "services.executor.loop.pace"], capture_output=True, timeout=50, check=True
    )
    found = msgspec.json.decode(done.stdout, type=Pace)
    assert found.periods >= 500
    assert found.late >= 0
    assert msgspec.json.decode(done.stdout)["compute_us"]["p50"] > 0
