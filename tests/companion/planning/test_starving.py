"""Every fact is really asked: starved of any one of them, km makes the plan fail, and says why."""

import gc
import weakref

import numpy as np
import pytest
from planned import Km, steps

from companion.languages import hfsm, rc, wm
from companion.languages.facts import Kind, fact
from companion.languages.values import BodyPosture
from companion.world.observe import observed
from companion.world.scene import Scene
from services.task import plan as plans
from velma import names
from velma.kinematics import ik
from velma.kinematics.frames import transform
from velma.kinematics.robot import Robot

POUR = ("pour", "jar", "bowl")
SOON = (
    wm.ListObjects, wm.HypotheticalState, wm.CurrentGrasp, wm.ObjectPose, wm.Holds, wm.GraspAtSide,
    wm.StaticObjects,
    wm.EnvironmentShapes, wm.GripperConfiguration, wm.TorsoConfiguration, wm.ArmConfiguration,
    wm.ObjectModel,
    wm.GraspSet, wm.ObjectHole, wm.GraspDefinition,
)  # fmt: skip
LATE = (wm.RobotReach, wm.FlatSurfaces, wm.CollisionsInVolume)  # of tables and reach
pytestmark = pytest.mark.timeout(240)


def test_these_are_all_that_is_asked(first, second):
    """The kinds starved below are those of both plans."""
    asked = {type(query) for km, _ in (first, second) for query in km.asked}
    assert asked == {*SOON, *LATE}


@pytest.mark.parametrize(
    ("begin", "kinds"),
    [
        # the last question ends it as well, though both hands are tried first
        ("beginning", (*SOON, wm.FlatSurfaces)),
        ("bowl_out", LATE),
        # the second plan, too
        ("bowl_placed", (wm.ObjectHole, wm.ObjectModel, wm.ObjectPose, wm.EnvironmentShapes)),
    ],
)
def test_starved_of_a_kind_there_is_no_plan(begin, kinds, request):
    """km's reason is told, and nothing is planned without the fact."""
    for kind in kinds:
        km = Km(request.getfixturevalue(begin), lambda query, kind=kind: isinstance(query, kind))
        assert fact(Kind.UNKNOWN_TO_KM, kind.__name__) in km.plan(*POUR).why, kind


def test_starved_of_a_thing_there_is_no_plan(beginning):
    """Source, destination and what they stand in: each is asked about by name."""
    for name in ("jar_1", "bowl_1", "cabinet_2"):
        starved = Km(beginning, lambda query, name=name: getattr(query, "object", "") == name)
        plan = starved.plan(*POUR)
        assert Kind.UNKNOWN_TO_KM in {one.kind for one in plan.why}, name


def test_an_answer_of_another_kind_is_no_answer(beginning):
    """The search takes only an answer to its question, whatever km says."""
    mad = Km(beginning)
    truthful = mad.ask
    mad.ask = lambda query: wm.Truth(True) if isinstance(query, wm.GraspSet) else truthful(query)
    assert fact(Kind.UNKNOWN_TO_KM, "GraspSet") in mad.plan(*POUR).why


def test_what_was_never_seen_is_looked_for_once(beginning):
    """A look wherever the head turns; then km is asked for it, and if it does not know it, the task
    fails.
    """
    for scene, destination, word in ((beginning, "bucket", "bucket"), (Scene(), "bowl", "jar")):
        machine, asked, end = Km(scene).plan("pour", "jar", destination).root.states
        (look,) = machine.states
        assert isinstance(look.command, rc.Look)
        assert (asked.query.subject, asked.otherwise) == (word, hfsm.Outcome.FAILED)
        assert end.outcome is hfsm.Outcome.REPLAN


def test_a_search_leaves_nothing_behind(beginning):
    """Neither one that fails nor one that is broken off: the process that searches lives as long as
    the robot.
    """
    starved = Km(beginning, lambda query: isinstance(query, wm.GraspSet))
    starved.plan(*POUR)
    with pytest.raises(RuntimeError, match="division"):
        Km(beginning, lambda query: isinstance(query, wm.GraspSet) and 1 / 0 == 0).plan(*POUR)
    gone = weakref.ref(starved)
    del starved
    gc.collect()
    assert gone() is None


# --- Planning from where an interrupted act left the robot: an empty hand may still be inside the
# cabinet


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
