"""A hand that holds something out feels a pull in physics, and only a pull ends its motion before
its time.
"""

import copy

import numpy as np
import pytest
from grips import at
from test_grip_watch import Lifted

from companion.skills.loop_messages import Phase, Until, motion
from velma.sim.disturbances import Disturbance, Kind, Of
from velma.sim.truth import TruthReader

pytestmark = pytest.mark.timeout(240)  # the first test also lifts the jar
WAIT_S = 2.0


@pytest.fixture(scope="module")
def _jar():
    jar = Lifted("jar_1")
    jar.core.hold(1.0)
    return jar


@pytest.fixture
def jar(_jar):
    """The left hand holds the jar."""
    other = copy.copy(_jar)
    other.core = copy.deepcopy(_jar.core)
    return other


def away(jar, size):
    """A force of a size [N] away from the robot."""
    x, y, _ = jar.core.dynamics.grips(jar.core.state.q)[1][jar.row]
    return tuple(float(v) for v in size * np.array([x, y, 0.0]) / np.hypot(x, y))


def _one(jar, kind, by):
    of, on = (Of.THING, jar.name) if kind in (Kind.PULLED, Kind.KNOCKED) else (Of.WRIST, jar.side)
    return Disturbance(kind, of, kind, on, by)


def hold_out(jar, *disturbances, **options):
    """Hold the jar out while this goes on, and return the report."""
    asked = {"pull_side": jar.side, "settle_s": WAIT_S, **options}
    assert jar.core.begin(motion("out", jar.core.setpoint, until=Until.PULL, **asked)) is None
    jar.core.hold(0.2)
    jar.core.backend.disturb(tuple(_one(jar, kind, by) for kind, by in disturbances))
    while jar.core.report.phase is Phase.RUNNING:
        jar.core.cycle()
    return jar.core.report


@pytest.mark.parametrize("size", [8.0, 12.0])
def test_a_pull_ends_it_soon_and_is_told(jar, size):
    report = hold_out(jar, (Kind.PULLED, away(jar, size)))
    assert (report.phase, report.ended_by, report.why) == (Phase.DONE, Until.PULL, ())
    assert 0.5 < report.time_s < 1.5
    assert 5.0 < jar.grip.pull < 1.2 * size
    assert jar.grip.felt != "lost"


def test_nobody_comes(jar):
    report = hold_out(jar)
    assert (report.phase, report.ended_by) == (Phase.DONE, Until.END)
    assert report.time_s == pytest.approx(WAIT_S, abs=0.1)
    assert jar.grip.pull == 0.0


KNOCKS = [(Kind.KNOCKED, size) for size in (40.0, -30.0)]


@pytest.mark.parametrize(("kind", "size"), [*KNOCKS, (Kind.PULLED, 3.5), (Kind.PULLED, -10.0)])
def test_neither_a_knock_nor_a_weak_pull_nor_a_push_ends_it(jar, kind, size):
    """And the jar stays in the hand."""
    report = hold_out(jar, (kind, away(jar, size)))
    assert (report.phase, report.ended_by) == (Phase.DONE, Until.END)
    jar.core.backend.disturb(())
    inside = at_hand(jar)
    jar.core.run(motion("after", jar.core.setpoint, settle_s=1.0))
    assert np.linalg.norm(at_hand(jar) - inside) < 0.01
    assert jar.grip.felt == "held"


@pytest.mark.parametrize("kind", [Kind.ZERO, Kind.NAN, Kind.STUCK, Kind.BIAS])
def test_a_faulty_wrist_gives_no_permission(jar, kind):
    """Nor does one that reads nothing true while somebody pulls: it cannot tell whether it is a
    pull.
    """
    pulls = () if kind is Kind.BIAS else ((Kind.PULLED, away(jar, 10.0)),)
    report = hold_out(jar, (kind, (20.0,) if kind is Kind.BIAS else ()), *pulls)
    assert (report.phase, report.ended_by) == (Phase.DONE, Until.END)


def at_hand(jar):
    """Where the jar is from the hand, (3,) [m] in the hand's axes."""
    rotation, position = jar.core.dynamics.grips(jar.core.state.q)
    return rotation[jar.row].T @ (at(TruthReader(jar.core.backend), jar.name) - position[jar.row])
