"""A thing is handed over: held out level over the edge of a table, and put down where nobody takes
it.
"""

import math
from itertools import pairwise

import numpy as np
import pytest
from planned import Km, steps

from companion.languages import hfsm, rc
from companion.languages.facts import fact
from companion.tasks.hand_over.done import HandOver, HandOverKind
from companion.tasks.hand_over.plan import OVER_M, WAIT_S
from services.task import plan as plans
from velma import names
from velma.kinematics.frames import tilt, transform
from velma.kinematics.robot import Robot
from velma.kinematics.tasks import LOADED_SPEED

pytestmark = pytest.mark.timeout(240)
OUT = ("hand over jar_1", "hand-over")
Outcome = hfsm.Outcome


def way(plan, at, outcome):
    """Return the acts after this outcome of a leaf where all of them succeed, and the end."""
    acts = []
    following = plans.after(plan.root, at, outcome)
    while not isinstance(following, Outcome):
        leaf = plans.leaf(plan.root, following)
        if isinstance(leaf, hfsm.EndState):
            return acts, leaf
        acts.append(leaf.command)
        following = plans.after(plan.root, following, Outcome.SUCCEEDED)
    return acts, following


def command(plan, *at):
    leaf = plans.leaf(plan.root, at)
    return leaf.command


@pytest.fixture(scope="module")
def plan(beginning):
    found = Km(beginning).plan("hand_over", "jar")
    assert isinstance(found, hfsm.HierarchicalPlan), found
    return found


def test_it_is_taken_and_given_and_the_hand_is_drawn_back(plan):
    """Slowly, since a person is near; at the end no hand holds it."""
    hand = command(plan, *OUT).side
    assert steps(plan) == ["take jar_1", "hand over jar_1", f"home {hand}"]
    acts, end = way(plan, OUT, Outcome.SUCCEEDED)
    assert (len(acts), end) == (1, Outcome.SUCCEEDED)
    assert all(one.speed <= LOADED_SPEED for one in acts if isinstance(one, rc.MoveJoint))
    assert plan.holds == {}
    assert plan.duration > WAIT_S
    plans.check(plan.root)


def test_where_nobody_takes_it_it_is_put_down_and_the_plan_has_failed(plan):
    acts, end = way(plan, OUT, Outcome.FAILED)
    assert [type(one).__name__ for one in acts] == ["MoveJoint", "Release", "MoveJoint"]
    assert isinstance(acts[1], rc.Release)
    assert acts[1].place is not None
    assert (end.outcome, end.why) == (Outcome.FAILED, (fact(HandOverKind.NOT_TAKEN, "jar_1"),))
    assert len({one.key for one in acts}) == len(acts)


def test_another_plan_is_made_where_the_world_is_not_as_planned(plan):
    assert way(plan, OUT, Outcome.REPLAN) == ([], Outcome.REPLAN)


def test_it_is_held_out_level_over_an_edge_that_looks_away_from_the_robot(plan, beginning):
    lead, give = command(plan, OUT[0], "move-joint"), command(plan, *OUT)
    grasp = command(plan, "take jar_1", "grasp")
    assert isinstance(lead, rc.MoveJoint)
    assert isinstance(give, HandOver)
    q = np.array(names.START)
    q[names.COLUMNS[str(give.side)]] = lead.path[-1]
    jar = Robot().grip(q, str(give.side)) * transform(grasp.approach[-1].at).inverse()
    assert math.degrees(tilt(jar)) < 1.0
    assert lead.speed <= LOADED_SPEED
    tables = {name: one for name, one in beginning.things.items() if one.kind == "Table"}
    inside = [_from_edge(one, jar.translation) for one in tables.values()]
    edge, height = min(inside)
    assert edge < 0.02
    assert height == pytest.approx(OVER_M, abs=0.05)


def _from_edge(table, point):
    """How far a point is from the nearest edge of a table's top, and the jar's foot from the top
    [m].
    """
    top = table.known.surfaces[0]
    x, y, z = transform(table.pose).actInv(point) - (top.x, top.y, top.z)
    aside = abs(abs(x) - top.along_x / 2), abs(abs(y) - top.along_y / 2)
    outside = max(abs(x) - top.along_x / 2, abs(y) - top.along_y / 2)
    return (min(aside) if outside < 0.02 else outside), z - 0.1


def test_what_is_held_is_only_handed_over(jar_carried):
    found = Km(jar_carried).plan("hand_over", "jar")
    assert steps(found)[0] == "hand over jar_1"
    assert all(a != b for a, b in pairwise(steps(found)))
