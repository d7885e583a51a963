"""A leaf is opened by its handle with the true loop and simulated physics: contacts alone move
it.
"""

import math

import numpy as np
import pytest
from robot import Acting

from companion.languages import rc
from companion.languages.values import Side
from companion.planning.methods import Asking
from companion.planning.steps import Geometry
from companion.tasks.open_door.plan import ENOUGH, open_door
from companion.world.observe import observed
from services.knowledge.answers import ask
from services.knowledge.memory import Overlays
from services.knowledge.store import Store
from services.task.outgoing_messages import observations
from velma.kinematics.robot import Robot
from velma.model.scene import CANONICAL, load

pytestmark = pytest.mark.timeout(240)
SENSE = {"door_1": -1.0, "door_2": 1.0}
DOOR = "door_2"
OWN = {"door_1": Side.LEFT, "door_2": Side.RIGHT}
# at a wrist, with the weight of the hand; estimate: half of what an arm of 1500 N/m gives 8 cm
# beside
MOST_N = 60.0


def angle(acting, door):
    """How far a leaf truly is open."""
    return SENSE[door] * float(acting.core.backend.data.joint(door).qpos[0])


def planned(done, door):
    """What the planner would have the leaf's own hand do, by what km knows after an act."""
    store, overlays = Store.open(), Overlays()
    for number, one in enumerate(observations(done)):
        store.write(observed(store.scene, one, (1, number)))

    def answered(query):
        nonlocal overlays
        overlays, answer = ask(store.scene, overlays, query)
        return answer

    asking = Asking(answered, "p")
    geometry = Geometry(asking, Robot(), 1)
    step = open_door(geometry, asking.suppose("", ()), door, "cabinet_2", OWN[door])
    return step.commands


@pytest.fixture(scope="module")
def before():
    """A robot that has looked around before the closed cabinet, and the commands that open each
    leaf.
    """
    acting = Acting(7, load(CANONICAL.with_stem("doors")))
    seen = acting.done(acting.look())
    return acting, {door: planned(seen, door) for door in SENSE}


def watched(acting, commands):
    """The outcomes, and the largest force at a wrist [N]."""
    most, step = [0.0], acting.core.backend.step

    def weighing(command):
        step(command)
        wrist = acting.core.backend.observe().wrist
        most[0] = max(most[0], float(np.linalg.norm(wrist[:, :3], axis=1).max()))

    acting.core.backend.step = weighing
    try:
        return [acting.act(command) for command in commands], most[0]
    finally:
        del acting.core.backend.step


@pytest.mark.parametrize("door", SENSE)
def test_a_leaf_is_opened_by_its_handle(before, door):
    """So far as is enough, with a force that a hand gives; the other leaf and what is behind stay;
    the arm is free.
    """
    known, commands = before
    acting, other = known.copied(), next(one for one in SENSE if one != door)
    stood = acting.truth.poses
    (_, opened), most = watched(acting, commands[door])
    assert isinstance(opened, rc.Done), opened
    assert door in {one.object for one in opened.seen}
    assert angle(acting, door) > ENOUGH - math.radians(1.0)
    assert most < MOST_N
    assert angle(acting, other) < 0.02
    for name in ("jar_1", "bowl_1"):
        assert acting.truth.poses[name][0] == pytest.approx(stood[name][0], abs=0.003)
        assert acting.truth.tilt_deg[name] < 2.0
    assert acting.here.world.free(acting.here.q)
    acting.done(acting.home(OWN[door]))
    assert angle(acting, door) > ENOUGH - math.radians(1.0)


def test_what_is_seen_decides(before):
    """A leaf that is held half way is not open, whatever the hand was told."""
    known, commands = before
    acting = known.copied()
    acting.core.backend.model.joint(DOOR).range[1] = 0.6
    _, opened = watched(acting, commands[DOOR])[0]
    assert opened.kind in (rc.NotDoneKind.REPLAN, rc.NotDoneKind.BLOCKED)
    assert angle(acting, DOOR) < 0.7


def test_a_leaf_that_moved_meanwhile_is_not_turned_blindly(before):
    """It is open already, and not where the hand goes: the robot says why it did not open it."""
    known, commands = before
    acting = known.copied()
    lead, opening = commands[DOOR]
    acting.done(lead)
    acting.core.backend.data.joint(DOOR).qpos[0] = 0.5
    ended = acting.act(opening)
    assert ended.kind in (rc.NotDoneKind.EMPTY, rc.NotDoneKind.REPLAN, rc.NotDoneKind.MISSING)
    assert ended.why


def test_a_cancel_lets_the_handle_go(before):
    """Amid the turn: the hand is drawn back, and goes home."""
    known, commands = before
    acting = known.copied()
    lead, opening = commands[DOOR]
    acting.done(lead)
    ended = acting.act(opening, lambda motion, core: angle(acting, DOOR) > 0.4)
    assert ended.kind == rc.NotDoneKind.CANCELLED
    assert 0.3 < angle(acting, DOOR) < 1.0
    acting.done(acting.look())
    acting.done(acting.home(OWN[DOOR]))
