"""Problems that the robot's laboratory published, each with its end
(dseredyn/proghtn-backstream@019fd34).

Those with pour that are active there: k, g, o, p; of "clear the table" y and y3. Km knows all
things of a scene, also those that the look around does not show. What our grasps cannot do is
refused with facts that name the things.
"""

from pathlib import Path

import numpy as np
import pytest
from planned import Km, acts, ends, steps, told

from companion.languages import hfsm, rc, wm
from companion.languages.facts import Kind, fact
from companion.languages.values import BodyPosture, Pose, Side
from companion.models import GRASPS, KNOWN_AS
from companion.world.scene import Scene
from velma import names
from velma.kinematics.frames import standing, xyz_quat
from velma.model import scene as scenes

POUR, CLEAR = ("pour", "jar", "bowl"), ("clear_table",)
OPEN, STILL = (0.0,) * 4, (0.0, 0.0)
pytestmark = pytest.mark.timeout(300)


def at_home(torso=0.0):
    """Both arms in their start posture."""
    right, left = (tuple(map(float, names.START[names.ARM[side]])) for side in ("right", "left"))
    return wm.SeenBody(BodyPosture(torso, right, left, STILL, OPEN, OPEN))


@pytest.fixture(scope="module")
def known():
    """Km's scene where everything of a published world is where it was published."""

    def scene_of(name):
        things = scenes.load(Path(__file__).parent / "scenes" / f"{name}.toml").things
        poses = {t.id: Pose(*xyz_quat(standing(np.array(t.xyz), t.yaw))) for t in things}
        seen = (
            wm.SeenObject(t.id, KNOWN_AS.get(t.model, t.model), poses[t.id], 1.0) for t in things
        )
        return told(Scene(), *seen, at_home(), *(wm.SeenHand(side) for side in Side))

    return scene_of


def test_k_both_are_in_the_cabinet(first, second):
    """The paper's task: both are taken, the bowl is put down and seen, then the jar is poured."""
    assert steps(first[1])[-1] == "replan"
    assert steps(second[1])[-1] == "pour jar_1 bowl_1"


# The posture of kb_world_model_013: the left hand holds the bowl by grasp 5 beside the cabinet.
G_RIGHT = (-0.187, -1.775, 1.153, 0.814, -0.020, -0.472, 0.029)
G_LEFT = (1.186, -0.493, 1.102, 1.000, -0.685, 0.930, 0.589)
G_TORSO, G_FINGERS = 0.347, (1.658, 1.658, 1.180, 0.0)


def test_g_the_bowl_is_in_a_hand(beginning):
    """It is put down and looked at; then the jar is taken and poured, by either hand."""
    held = next(grasp for grasp in GRASPS["bowl_high"] if grasp.id == "5").steps[-1].pose
    posture = BodyPosture(G_TORSO, G_RIGHT, G_LEFT, STILL, OPEN, G_FINGERS)
    scene = told(beginning, wm.SeenBody(posture), wm.SeenHand(Side.LEFT, "bowl_1", "5", held))
    plan = Km(scene).plan(*POUR)
    assert steps(plan)[:3] == ["place bowl_1", "home left", "look at bowl_1"]
    assert ends(plan) is hfsm.Outcome.REPLAN
    (release,) = acts(plan, rc.Release)
    bowl = wm.SeenObject("bowl_1", "bowl_high", release.place, 3.0)
    after = Km(told(scene, at_home(), wm.SeenHand(Side.LEFT), bowl)).plan(*POUR)
    assert steps(after) == ["take jar_1", "pour jar_1 bowl_1"]


def test_o_boxes_stand_before_jar_and_bowl(env2):
    """The one beside the jar is put aside, then the jar is poured into the bowl where that
    stands.
    """
    found = steps(Km(env2).plan(*POUR))
    assert (found[:2], found[-1]) == (["take box_1", "place box_1"], "pour jar_1 bowl_1")


@pytest.mark.parametrize(
    ("world", "task", "things", "why"),
    [
        (
            "world_05",
            POUR,
            {"jar_1", "box_2"},
            (fact(Kind.NO_GRASP, Side.LEFT, "jar_1"), fact(Kind.NO_GRASP, Side.RIGHT, "box_2")),
        ),
        ("world_15", CLEAR, {"box_1", "box_2"}, (fact(Kind.NO_GRASP, Side.LEFT, "box_2"),)),
        # some ten seconds
        pytest.param("world_16", CLEAR, {"box_2", "box_3"}, (), marks=pytest.mark.long),
    ],
    ids=[
        "p: the jar beside a box that a hand cannot grip from above",
        "y: two boxes",
        "y3: a bowl among three boxes",
    ],
)
def test_what_the_grasps_cannot_do_is_refused(known, world, task, things, why):
    """The reasons name the things."""
    plan = Km(known(world)).plan(*task)
    assert things <= {thing for one in plan.why for thing in one.things}, plan.why
    assert set(why) <= set(plan.why), plan.why
