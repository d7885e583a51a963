"""A thing missing from the hand is noticed and told, and no act on it succeeds: true loop,
simulated physics.
"""

import numpy as np
import pytest

from companion.languages.facts import Kind, fact
from companion.languages.values import Side
from companion.skills.situation import Sight, Situation
from companion.tasks.pour.done import Pour
from velma.control.grip import HAND_KG
from velma.names import COLUMNS

JAR, LEFT = "jar_1", Side.LEFT
JAR_KG = 0.26  # with its content
pytestmark = pytest.mark.timeout(240)  # the first test of the folder also takes the jar


def slippery(core):
    """The hands have no friction any more."""
    model = core.backend.model
    for geom in range(model.ngeom):
        if "_Hand" in model.body(model.geom_bodyid[geom]).name:
            model.geom_friction[geom] *= 1e-4


class Trick:
    """Friction goes as soon as an arm moves; never cancels anything."""

    def __init__(self):
        self.at_s = None

    def __call__(self, _motion, core):
        if self.at_s is None and np.abs(core.state.v).max() > 0.1:
            self.at_s = core.state.time
            slippery(core)
        return False


def swing(acting):
    """A turn of the torso with the left arm as it is."""
    turned = acting.here.q.copy()
    turned[COLUMNS[LEFT][0]] += 0.3
    return acting.move(LEFT, [acting.here.q, turned])


def test_a_jar_that_falls_is_told_within_a_second(jar_out, monkeypatch):
    """The act ends as lost and names the jar; the hand is open and empty; pouring the jar is
    refused.
    """
    trick, cycle = Trick(), jar_out.core.cycle

    def tricked():
        cycle()
        trick(None, jar_out.core)

    monkeypatch.setattr(jar_out.core, "cycle", tricked)
    outcome = jar_out.act(swing(jar_out))
    assert (outcome.kind, outcome.lost, outcome.held) == ("lost", {LEFT: JAR}, {})
    assert outcome.why == (fact(Kind.LOST, LEFT, JAR),)
    assert JAR not in [one.object for one in outcome.seen]
    assert trick.at_s is not None
    assert jar_out.core.state.time - trick.at_s < 1.0
    assert not jar_out.core.fingers.locked[1]
    pour = Pour("pour", LEFT, JAR, "bowl_1", 0.0, 0.0, (0.3, 2.3), 1.0, 0.2)
    poured = jar_out.act(pour)
    assert poured.kind == "replan"


@pytest.mark.parametrize("sees", [True, False])
def test_no_hand_opens_because_of_the_wrist_alone(sees, jar_out, monkeypatch):
    """Its sensor begins to read an empty hand: the act is not done, and the jar stays in the hand,
    seen or not.
    """
    observe, share = jar_out.core.backend.observe, HAND_KG / (HAND_KG + JAR_KG)

    def light():
        state = observe()
        assert state.wrist is not None
        state.wrist = state.wrist * [[1.0], [share]]
        return state

    monkeypatch.setattr(jar_out.core.backend, "observe", light)
    if not sees:
        monkeypatch.setattr(jar_out.eye, "look", lambda *_: [])
    outcome = jar_out.act(swing(jar_out))
    assert (outcome.kind, list(outcome.held)) == ("replan", [LEFT])
    assert outcome.why == (fact(Kind.WRIST_DOUBTED, LEFT, JAR),)
    assert jar_out.core.fingers.locked[1]
    assert jar_out.truth.fingers_on[JAR]["left"] >= 3


def test_a_jar_that_is_not_lifted_is_not_taken(holding):
    """The hand has closed on it, and slides off as it rises: the act ends, nothing is in the
    hand.
    """
    slippery(holding.core)
    outcome = holding.act(holding.taking[2])
    assert outcome.kind in ("lost", "empty")
    assert outcome.lost == {LEFT: JAR}
    assert holding.truth.tilt_deg[JAR] < 10.0


def test_a_hand_that_closes_on_nothing_says_so_and_backs_out(before_the_jar, monkeypatch):
    """Before the fingers are closed to the end; the jar is taken away while the hand reaches for
    it.
    """
    core, stood = before_the_jar.core, before_the_jar.here.seen[JAR]
    at = core.backend.model.joint(JAR).qposadr[0]

    def look(*_):
        core.backend.data.qpos[at : at + 3] = (2.0, 2.0, 0.1)
        return [Sight(JAR, stood)] if JAR in before_the_jar.here.seen else []

    monkeypatch.setattr(before_the_jar.eye, "look", look)
    outcome = before_the_jar.act(before_the_jar.taking[1])
    assert (outcome.kind, outcome.lost, outcome.held, outcome.missing) == ("empty", {}, {}, (JAR,))
    assert before_the_jar.here.world.free(core.setpoint)


@pytest.mark.parametrize("sure", [True, False])
def test_a_jar_that_is_gone_is_missing(before_the_jar, sure, monkeypatch):
    """The hand does not reach for it where the eyes would surely see it; else it closes on
    nothing.
    """
    monkeypatch.setattr(Situation, "surely_seen", lambda here, name: sure)
    core = before_the_jar.core
    at = core.backend.model.joint(JAR).qposadr[0]
    core.backend.data.qpos[at : at + 3] = (2.0, 2.0, 0.1)
    outcome = before_the_jar.act(before_the_jar.taking[1])
    kind = "missing" if sure else "empty"
    assert (outcome.kind, outcome.missing, outcome.held) == (kind, (JAR,), {})
    assert JAR not in before_the_jar.here.seen


def test_what_is_carried_is_felt(jar_out):
    """A free motion with the jar is done, and the jar weighs what it weighs."""
    jar_out.done(swing(jar_out))
    assert jar_out.core.report.left.grip.felt == "held"
    assert jar_out.core.report.left.grip.mass == pytest.approx(0.26, abs=0.02)
