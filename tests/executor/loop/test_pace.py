"""Whether the machine holds 500 Hz: late cycles are counted as they are, and the program says so in
JSON.
"""

import subprocess
import sys

import msgspec
import numpy as np
import pytest
from doubles import RobotDouble

from companion.tools.verbs import checkup as console
from companion.tools.verbs.checkup import Pace
from services.executor.loop import pace
from services.executor.loop.core import LoopCore
from services.executor.loop.link import AgentLink, LoopLink, Timing
from services.executor.loop.pace import measure
from services.executor.loop.process import Pacer
from velma.names import START
from velma.sim.mock_backend import MockBackend

PACED = {"p50": 10.0}  # lateness, which only a loop in real time counts


def slow(clock, work_s=0.001, seldom_s=0.001):
    """A core whose cycles take `work_s`, every tenth `seldom_s`."""

    def work(robot, *_):
        clock.now += work_s if len(robot.taus) % 10 else seldom_s

    return LoopCore(RobotDouble(moved=work))


@pytest.mark.parametrize(
    ("work_s", "seldom_s", "late", "held"),
    [
        (0.001, 0.001, 0, True),
        (0.001, 0.0025, 50, True),
        (0.0015, 0.0045, 250, False),
        (0.003, 0.003, 740, False),
    ],
)
def test_a_pace_is_held_where_few_cycles_are_late(clock, work_s, seldom_s, late, held):
    """Of 500 cycles: none, every tenth, five of ten, all but the first (they take 1.5 s, 750
    periods).
    """
    core = slow(clock, work_s, seldom_s)
    found = measure(core, Pacer(core.backend.period_s))
    assert found.held is held
    assert found.late == pytest.approx(late, abs=0.1 * late)
    assert core.faults == 0
    assert core.report.phase == "running", "it was moving all the time"


@pytest.mark.parametrize("seconds", [0.5, 1.0, 2.0])
def test_every_joint_moves_a_tenth_of_a_radian_and_back(clock, seconds):
    """For as long as is measured, from rest to rest."""
    core, seen = slow(clock), []
    step = core.backend.step
    core.backend.step = lambda command: seen.append(core.setpoint.copy()) or step(command)
    found = measure(core, Pacer(core.backend.period_s), seconds)
    way = np.array(seen) - START
    assert (found.periods, len(way)) == (round(seconds * 500), round(seconds * 500))
    np.testing.assert_allclose(way.max(axis=0), 0.1, atol=1e-3)
    np.testing.assert_allclose(way[round(seconds * 250)], 0.1, atol=1e-3)
    np.testing.assert_allclose(way[[0, -1]], 0.0, atol=1e-3)
    quarter = way[round(seconds * 125)]
    np.testing.assert_allclose(quarter, 0.05, atol=2e-3)
    assert clock.now >= seconds - 0.002


class Late:
    """A pacer that has counted what it is told."""

    def __init__(self, missed, cycles=500, skipped=0):
        self._timing = Timing(cycles, missed, skipped, PACED, {"p50": 1.0})

    def wait(self):
        """At once."""

    def done(self):
        """Nothing to count."""

    def timing(self):
        return self._timing


def test_the_share_of_late_cycles_that_is_still_held_is_a_tenth(clock):
    """50 of 500 are held, 51 are not. Skipped cycles are periods and late: of 450 cycles 20 late,
    and 50 skipped, are 70 of 500.
    """
    rows = ((Late(50), 50, True), (Late(51), 51, False), (Late(20, 450, 50), 70, False))
    for pacer, late, held in rows:
        found = measure(LoopCore(MockBackend()), pacer)
        assert (found.periods, found.late, found.held) == (500, late, held)


@pytest.mark.parametrize(("refused", "realtime"), [("", True), ("no SCHED_FIFO", False)])
def test_the_program_measures_as_the_loop_runs(monkeypatch, capsys, refused, realtime):
    """Priority first, then a robot at rest, memory kept still, and a line of JSON at the end."""
    done = []

    def measured(core, pacer):
        done.append(core.cycles)
        return pace.Pace(500, 0, True, pacer.timing().realtime, {})

    monkeypatch.setattr(pace, "take_priority", lambda: done.append("priority") or refused)
    monkeypatch.setattr(pace, "still_memory", lambda: done.append("memory"))
    monkeypatch.setattr(pace, "MujocoBackend", lambda scene: done.append("robot") or MockBackend())
    monkeypatch.setattr(pace, "measure", measured)
    pace.main()
    assert done == ["priority", "robot", "memory", 100]
    out = capsys.readouterr().out
    assert out.endswith("}\n")
    found = msgspec.json.decode(out, type=Pace)
    assert (found.held, found.realtime) == (True, realtime)


def shown(folder, *timings):
    """A loop's slot file with the first of these; the others come one at each pause of the
    watcher.
    """
    link, left = LoopLink(folder / "loop.slots"), list(timings)

    def show(_seconds=0.0):
        link.show("timing", left.pop(0))

    show()
    return link.file.path, show


JUDGED = {
    "late before, not now": (
        Timing(1000, 900, 0, PACED), Timing(2000, 950, 0, PACED), (1000, 50, True, False),
    ),
    "skipped cycles are late": (
        Timing(1000, 0, 500, PACED, {}, True), Timing(1900, 10, 600, PACED, {}, True),
        (1000, 110, False, True),
    ),
    "stands still": (
        Timing(1000, 900, 0, PACED), Timing(1000, 900, 0, PACED), (0, 0, True, False),
    ),
    "speed max": (Timing(1000, 0, 0), Timing(2000, 500, 0), (0, 0, True, False)),
}  # fmt: skip


def test_a_loop_that_runs_is_judged_by_what_it_counted_meanwhile(tmp_path, monkeypatch):
    """Earlier lateness counts for nothing; a loop without deadlines has no periods. Who watches it
    tells it nothing: no robot is made, heartbeat and commands stay as they are.
    """
    monkeypatch.setattr(pace, "try_out", lambda: pytest.fail("a loop was tried out"))
    for name, (before, after, expected) in JUDGED.items():
        slots, pause = shown(tmp_path, before, after)
        monkeypatch.setattr(pace.time, "sleep", pause)
        agent = AgentLink(slots)

        def numbers(slots=agent.file.slots):
            return [slot.number for name, slot in slots.items() if name != "timing"]

        unwatched = numbers()
        found = pace.watch(slots)
        assert (found.periods, found.late, found.held, found.realtime) == expected, name
        assert numbers() == unwatched, name


def test_another_loop_is_tried_out_where_the_world_stands_still(tmp_path, monkeypatch):
    """The one that runs computes nothing, so it cannot be judged."""
    slots, pause = shown(
        tmp_path, Timing(1000, 0, 0, PACED), Timing(1000, 0, 0, PACED, rested=1000)
    )
    tried = pace.Pace(500, 3, True, False, {})
    monkeypatch.setattr(pace.time, "sleep", pause)
    monkeypatch.setattr(pace, "try_out", lambda: tried)
    assert pace.watch(slots) is tried


@pytest.mark.process
def test_the_console_is_told_of_no_pace_where_a_loop_stands_still(tmp_path):
    """By the program, in a process of its own; nor where there is no loop."""
    slots, _ = shown(tmp_path, Timing(500, 0, 0, PACED))
    assert console.measure(slots) is None
    assert console.measure(tmp_path / "nowhere") is None


@pytest.mark.process
def test_the_program_says_it_in_words_that_the_console_reads():
    """A real second of the simulated robot, in a process of its own."""
    command = [sys.executable, "-m", "services.executor.loop.pace"]
    done = subprocess.run(command, capture_output=True, timeout=50, check=True)
    found = msgspec.json.decode(done.stdout, type=Pace)
    assert found.periods >= 500
    assert found.late >= 0
    assert msgspec.json.decode(done.stdout)["compute_us"]["p50"] > 0
