"""Reaction of the loop when a hand loses its thing, in simulated physics with errors of the
sensors.
"""

import copy
import math

import numpy as np
import pytest
from grips import BOWL_POSTURE, JAR_GRIP, JAR_POSTURE, at, lever, raised, standing

from companion.languages.facts import Kind
from companion.skills.loop_messages import Close, Open, Payload, Phase, motion
from services.executor.loop.core import LoopCore
from velma.control.grip import Grip, Wrong
from velma.names import SIDES
from velma.sim.mock_backend import MockBackend
from velma.sim.truth import TruthReader

GRASPS = {
    "jar_1": (JAR_POSTURE, 1, 0.52, JAR_GRIP, 0.2),
    "bowl_1": (BOWL_POSTURE, 0, math.radians(60), Close(squeeze=math.radians(0.8)), 0.3),
}
SPARE_KG = 0.12
pytestmark = pytest.mark.timeout(240)  # each first test also lifts the thing


class Lifted:
    """A loop whose robot has lifted a thing by 3 cm."""

    def __init__(self, name):
        posture, self.row, finger, close, self.mass = GRASPS[name]
        self.name, self.side = name, SIDES[self.row]
        self.core, truth = standing(posture, self.row, finger)
        self.core.run(motion("tare", self.core.setpoint, tare=self.side))
        self.core.run(motion("grip", self.core.setpoint, until="touch", **{self.side: close}))
        self.closed = self.grip
        self.load = Payload(self.mass, lever(self.core, truth, self.row, name), SPARE_KG)
        self.lift()

    def lift(self):
        up = raised(self.core.setpoint, self.row, 0.03)
        self.core.run(motion("lift", up, settle_s=1.0, **{f"payload_{self.side}": self.load}))

    @property
    def grip(self):
        return self.core.report.hand(self.side).grip

    def begin_to_move(self, seconds=2.0, turn=0.2):
        """Swing the torso by an angle [rad]."""
        turned = self.core.setpoint.copy()
        s = np.linspace(0, 1, round(seconds * 100))[:, None]
        turned = turned + turn * s * s * (3 - 2 * s) * (np.arange(15) == 0)
        assert self.core.begin(motion("swing", turned)) is None

    def friction(self, factor):
        """Make the hands slippery."""
        model = self.core.backend.model
        for geom in range(model.ngeom):
            if "_Hand" in model.body(model.geom_bodyid[geom]).name:
                model.geom_friction[geom] *= factor

    def ended(self):
        """Run to the end of the motion; return its report."""
        self.until(lambda: self.core.report.phase is not Phase.RUNNING)
        return self.core.report

    def until(self, ended, most_s=2.0):
        """Run until that is so; return the simulated time it took."""
        began = self.core.state.time
        while not ended():
            self.core.cycle()
            assert self.core.state.time - began < most_s, self.core.report
        return self.core.state.time - began


@pytest.fixture(scope="module", params=list(GRASPS))
def _lifted(request):
    return Lifted(request.param)


@pytest.fixture
def lifted(_lifted):
    """A hand with jar or bowl, in a state of its own."""
    other = copy.copy(_lifted)
    other.core = copy.deepcopy(_lifted.core)
    return other


def test_what_is_lifted_is_felt_and_weighed(lifted):
    """On its shelf nothing is sure; lifted, it weighs what it is: the jar with its grains."""
    assert lifted.closed.felt == ""
    assert lifted.grip.felt == Grip.HELD
    assert lifted.grip.mass == pytest.approx({"jar_1": 0.26, "bowl_1": 0.3}[lifted.name], abs=0.006)


def test_a_motion_ends_as_lost_when_the_thing_falls(lifted):
    """Within a quarter of a second the loop knows; it comes to rest and says which hand lost
    something.
    """
    truth = TruthReader(lifted.core.backend)
    height = at(truth, lifted.name)[2]
    lifted.begin_to_move()
    lifted.core.cycle()
    lifted.friction(1e-4)
    known = lifted.until(lambda: lifted.core.grips.verdict is not None)
    assert known < 0.25
    report = lifted.ended()
    assert report.phase is Phase.LOST
    (why,) = report.why
    assert (why.kind, why.side) == (Kind.FEELS_LITTLE, lifted.side)
    assert np.abs(lifted.core.state.v).max() < 0.3
    assert height - at(truth, lifted.name)[2] > 0.01


def test_what_was_lost_between_two_motions_ends_the_next_one(lifted):
    """Nothing succeeds with an empty hand, until it is told to open."""
    lifted.friction(1e-4)
    lifted.core.hold(0.6)
    lifted.begin_to_move()
    assert lifted.ended().phase is Phase.LOST
    lifted.core.run(motion("open", lifted.core.setpoint, **{lifted.side: Open()}))
    assert lifted.core.report.phase is Phase.DONE
    assert lifted.grip.felt == ""
    lifted.begin_to_move(1.0)
    assert lifted.ended().phase is Phase.DONE


def test_a_push_ends_the_motion_and_nothing_is_dropped(lifted):
    """3 N from the side for 0.2 s: the motion ends as slipped, the next one is done with the thing
    in the hand.
    """
    data, body = lifted.core.backend.data, lifted.core.backend.model.body(lifted.name).id
    lifted.begin_to_move()
    data.xfrc_applied[body, 1] = 3.0
    lifted.core.hold(0.2)
    data.xfrc_applied[body] = 0.0
    assert lifted.ended().phase is Phase.SLIPPED
    lifted.core.run(motion("still", lifted.core.setpoint, settle_s=0.5))
    assert lifted.core.report.phase is Phase.DONE
    assert lifted.grip.felt == Grip.HELD


def test_a_thing_put_down_is_not_lost(lifted):
    """The shelf takes the load, on the way down and when the hand lets go."""
    down = raised(lifted.core.setpoint, lifted.row, -0.045)
    lifted.core.run(motion("down", down, until="contact", contact_side=lifted.side, settle_s=0.3))
    assert lifted.core.report.phase is Phase.DONE
    opened = {lifted.side: Open(), f"payload_{lifted.side}": Payload()}
    lifted.core.run(motion("open", lifted.core.setpoint, **opened))
    assert lifted.core.report.phase is Phase.DONE


@pytest.mark.parametrize("wrong", [Wrong.NO_NUMBER, Wrong.ZERO, Wrong.STUCK])
def test_a_sensor_that_is_not_well_feels_nothing(lifted, wrong, monkeypatch):
    """The motion goes on and the thing stays in the hand; the other hand feels; a sensor that is
    well again is one.
    """
    observe, row = lifted.core.backend.observe, lifted.row
    readings = {Wrong.NO_NUMBER: np.full(6, math.nan), Wrong.ZERO: np.zeros(6)}
    spoilt = readings.get(wrong, lifted.core.state.wrist[row].copy())

    def spoil():
        state = observe()
        state.wrist = state.wrist.copy()
        state.wrist[row] = spoilt
        return state

    monkeypatch.setattr(lifted.core.backend, "observe", spoil)
    lifted.begin_to_move(1.0, turn=0.03)  # the bowl meets nothing on it
    assert lifted.ended().phase is Phase.DONE
    assert (lifted.grip.felt, lifted.grip.wrong) == ("", wrong)
    assert lifted.core.report.hand(SIDES[1 - row]).grip.wrong == ""
    assert lifted.core.fingers.locked[row]
    monkeypatch.setattr(lifted.core.backend, "observe", observe)
    lifted.core.run(motion("still", lifted.core.setpoint, settle_s=1.0))
    assert (lifted.grip.felt, lifted.grip.wrong) == (Grip.HELD, "")


def test_a_robot_without_sensors_feels_nothing():
    """And loses nothing."""
    core = LoopCore(MockBackend())
    core.run(motion("carry", core.setpoint, payload_right=Payload(0.3), settle_s=0.5))
    assert core.report.phase is Phase.DONE
    assert core.report.right.grip.felt == ""
