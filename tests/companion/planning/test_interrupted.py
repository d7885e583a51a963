"""Planning from where an interrupted act left the robot: an empty hand may still be inside the
cabinet.
"""

import numpy as np
import pytest
from planned import Km, steps

from companion.languages import rc, wm
from companion.languages.values import BodyPosture
from companion.world.observe import observed
from services.task import plan as plans
from velma import names
from velma.kinematics import ik
from velma.kinematics.frames import transform
from velma.kinematics.robot import Robot


@pytest.fixture(scope="module")
def grasping(first, jar_carried):
    """The left hand carries the jar; the right one is at the bowl in the cabinet, and has not
    closed.
    """
    (step,) = (state for state in first[1].root.states if state.name == "take bowl_1")
    move, grasp = step.states[0].command, step.states[1].command
    assert isinstance(move, rc.MoveJoint)
    robot, q = Robot(), np.zeros(15)
    q[names.ARM["left"]] = jar_carried.joints["left_arm"]
    q[names.COLUMNS["right"]] = move.path[-1]
    T_world_object = transform(jar_carried.things["bowl_1"].pose)
    for point in grasp.approach:
        q = ik.solve(robot, "right", T_world_object * transform(point.at), q)
    right, left = (tuple(float(x) for x in q[names.ARM[side]]) for side in ("right", "left"))
    open_hand = (grasp.approach[-1].fingers,) * 3 + (0.0,)
    jar_hand = jar_carried.joints["left_hand"]
    posture = BodyPosture(float(q[names.TORSO]), right, left, (0.0, 0.0), open_hand, jar_hand)
    return observed(jar_carried, wm.SeenBody(posture), (9, 0), 3.0)


def test_an_arm_in_the_cabinet_comes_home_first(grasping):
    """With it there the torso cannot turn, so the other hand finds no way for the jar."""
    plan = Km(grasping).plan("pour", "jar", "bowl")
    assert steps(plan)[:4] == ["home right", "carry jar_1", "take bowl_1", "place bowl_1"]
    assert steps(plan)[4] == "home right 2"
    plans.check(plan.root)


def test_what_stands_already_is_put_down_when_the_arm_is_home(grasping):
    """As after the way home was blocked; with all empty arms at home nobody could have put it
    down.
    """
    assert steps(Km(grasping).plan("put_down", "bowl")) == ["home right", "look at bowl_1"]


def test_arms_stay_where_the_task_can_be_done_without(grasping):
    """The hand that is at the bowl takes it."""
    assert steps(Km(grasping).plan("take", "bowl", "right")) == ["take bowl_1"]
