"""Doors are opened for what stands behind them, and for what may."""

import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace
from planned import Km, acts, steps, surveyed

from companion.languages import hfsm
from companion.languages.facts import Kind, fact
from companion.planning.methods import Asking
from companion.planning.steps import situation
from companion.tasks.open_door import plan as leaves
from companion.tasks.open_door.done import OpenDoor
from velma.kinematics.collision import World
from velma.kinematics.frames import transform
from velma.kinematics.robot import Robot
from velma.kinematics.tasks import opening
from velma.model import scene as model

pytestmark = pytest.mark.timeout(240)
WIDE = 1.45  # as far as the hand leaves them
DOORS = {"door_1", "door_2"}
SEEN_WITHIN = 0.01  # [rad] of the noise of two yaws


def opened(plan):
    """Return the doors that a plan opens, in this order."""
    return [act.door for act in acts(plan, OpenDoor)]


@settings(max_examples=8, deadline=None)
@given(angles=st.tuples(st.floats(0.0, 1.5), st.floats(0.0, 1.5)))
def test_doors_that_are_not_open_enough_are_closed(doors, angles):
    """By the poses that were seen; each hangs at the cabinet in whose opening it is."""
    asking = Asking(Km(doors(*angles)).ask, "p")
    found = dict(leaves.closed(asking, ""))
    assert set(found.values()) <= {"cabinet_2"}
    for door, angle in zip(sorted(DOORS), angles, strict=True):
        if abs(angle - leaves.ENOUGH) > SEEN_WITHIN:
            assert (door in found) is (angle < leaves.ENOUGH)
        assert leaves.opened(asking, "", door, "cabinet_2") == pytest.approx(angle, abs=SEEN_WITHIN)


@pytest.mark.parametrize("beside", [True, False])
def test_a_door_that_a_hand_is_beside_is_as_thick_as_it_is(beside, doors, monkeypatch):
    """Paths keep off the others by more: but a hand that let go of a door is nearer, and has to get
    away.
    """
    put, thick = World.put, dict[str, float]()

    def noted(world, name, shapes, *more):
        thick[name] = getattr(shapes[0], "size", (0.0,))[0]
        put(world, name, shapes, *more)

    monkeypatch.setattr(World, "put", noted)
    monkeypatch.setattr(
        World, "touching", lambda world, q: [("left_hand", "door_1", 0.004)] if beside else []
    )
    situation(Asking(Km(doors(0.0, 0.0)).ask, "p"), Robot(), "")
    assert (thick["door_1"] < thick["door_2"]) is beside


@pytest.mark.parametrize("task", [("pour", "jar", "bowl"), ("take", "jar", "")])
def test_a_door_is_opened_to_look_for_a_thing(task, doors):
    """One, then the robot looks around and plans again, whether it sees the thing or not."""
    plan = Km(doors(0.0, 0.0)).plan(*task)
    (door,) = opened(plan)
    assert steps(plan)[0] == f"open {door}"
    assert steps(plan)[2:] == ["look around", "localize jar", "replan"]
    asked = plan.root.states[-2]
    assert asked.otherwise is hfsm.Outcome.REPLAN


@pytest.mark.parametrize(
    ("angles", "closed"),
    [((0.0, WIDE), "door_1"), ((WIDE, 0.0), "door_2"), ((WIDE, 0.5), "door_2")],
)
def test_the_other_door_is_opened_for_a_thing_that_was_seen(angles, closed, doors):
    """Before anything is taken; where the leaf is then is looked at."""
    plan = Km(doors(*angles)).plan("take", "jar", "")
    assert opened(plan) == [closed]
    assert steps(plan)[2:] == ["look at jar_1", "localize jar_1", "replan"]


@pytest.mark.parametrize("angles", [(0.0, WIDE), (WIDE, 0.0)])
def test_the_hand_turns_no_farther_than_the_leaf(angles, doors):
    """It slides about the upright bar against the turn, or not at all, from one way to hold it to
    another.
    """
    world = Km(doors(*angles))
    (act,) = acts(world.plan("take", "jar", ""), OpenDoor)
    assert act.end is not None
    begin, end = transform(act.approach[-1].at), transform(act.end)
    x, y, z = pin.log3(end.rotation @ begin.rotation.T)
    assert (x, y) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert z * act.turn <= 1e-9
    known = leaves.grasps(Asking(world.ask, "q"), "", act.door)
    hands = [transform(grasp.steps[-1].pose).inverse() for grasp in known]
    assert any(hand.isApprox(end, 1e-6) for hand in hands)


def test_a_turn_whose_end_no_arm_reaches_is_not_tried(monkeypatch):
    """With the cabinet 0.4 m to the left the near door ends beside the robot: the other one is
    opened.
    """
    whole = model.load(model.CANONICAL.with_stem("doors"))
    beside = (
        replace(t, xyz=model.NOWHERE if t.of else (t.xyz[0], t.xyz[1] + 0.4, t.xyz[2]))
        for t in whole.things
    )
    tried, arc = [], opening.arc
    monkeypatch.setattr(opening, "arc", lambda *words: tried.append(words[4]) or arc(*words))
    plan = Km(surveyed(model.hung(replace(whole, things=tuple(beside))))).plan("take", "jar", "")
    assert opened(plan) == ["door_2"]
    assert set(tried) == {"door_2"}


def test_open_doors_are_left_as_they_are(doors):
    """The jar is taken from between them; a thing that nobody has seen is looked for as ever; a
    door is not taken, nor put elsewhere, and the robot says why.
    """
    km = Km(doors(WIDE, WIDE))
    plan = km.plan("take", "jar", "")
    assert (opened(plan), steps(plan)[0]) == ([], "take jar_1")
    assert steps(km.plan("take", "lid", "", request="p2"))[0] == "look for lid"
    hanging = [
        (fact(Kind.PERSON_NEEDED, fact(Kind.HANGS_ON_A_HINGE, name)),) for name in sorted(DOORS)
    ]
    assert km.plan("take", "door", "", request="p3").why[:1] in hanging
