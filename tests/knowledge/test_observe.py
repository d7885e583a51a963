"""Observations become facts, the newest of a subject is the true one, and relations follow from
geometry.
"""

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from companion.languages import wm
from companion.languages.facts import Kind, fact
from companion.languages.values import Pose, Side, Uncertainty
from companion.world.observe import observed, subject_of
from companion.world.relations import relate
from companion.world.scene import PARTS, Origin, Scene
from services.knowledge.answers import ask
from services.knowledge.memory import Overlays
from services.knowledge.store import Store

from .conftest import KITCHEN, yaw
from .storing import store_observation


def seen(name, model, xyz, at=0.0):
    """An upright object seen."""
    return wm.SeenObject(name, model, Pose(xyz), at)


# Things that come and go: on the table, in the hand, the furniture itself pushed aside.
MOVES = (
    seen("jar_1", "jar", (0.783, -0.84, 0.875)),
    seen("bowl_1", "bowl_high", (0.8, -0.8, 0.775)),
    seen("lid_1", "jar_lid", (0.8, -0.8, 0.805)),
    seen("table_1", "table", (0.783, 0.84, 0.0)),
    seen("cabinet_2", "cabinet_no_door", (0.783, -0.84, 1.125)),
    wm.SeenHand(Side.LEFT, "jar_1", "1", Pose((0.0, 0.0, 0.0))),
    wm.SeenHand(Side.RIGHT, "bowl_1", "1", Pose((0.0, 0.0, 0.0))),
    wm.SeenHand(Side.LEFT),
    wm.SeenHand(Side.RIGHT, "jar_1", "1", Pose((0.0, 0.0, 0.0))),
    wm.PlacedObject("jar_1", "jar", Pose((0.75, -0.8, 0.875)), 2.0),
)


SURE = Uncertainty((3e-7, 0.0, 0.0, 3e-7, 0.0, 3e-7), 1e-6)
UNSURE = Uncertainty((3e-5, 0.0, 0.0, 3e-5, 0.0, 3e-5), 1e-4)


def scene_of(*observations):
    """All of them, one after the other."""
    scene = Scene()
    for count, observation in enumerate(observations):
        scene = observed(scene, observation, (1, count))
    return scene


def test_the_cabinet_holds_jar_and_bowl_and_stands_on_a_table(kitchen):
    """The relations of the recorded scene, though the jar was seen before the cabinet."""
    things = kitchen.scene.things
    assert (things["jar_1"].on, things["jar_1"].inside) == ("cabinet_2", ("cabinet_2",))
    assert (things["bowl_1"].on, things["bowl_1"].inside) == ("cabinet_2", ("cabinet_2",))
    assert (things["cabinet_2"].on, things["cabinet_2"].inside) == ("table_2", ())
    assert things["table_1"].on == ""


def test_relations_carry_the_time_of_the_observation_they_rest_on(kitchen):
    """The jar was seen at 1.2 s; that it is in the cabinet is known since that was seen, at 1.4
    s.
    """
    jar = kitchen.scene.things["jar_1"]
    assert (jar.at, jar.related_at) == (1.2, 1.4)


def test_what_was_lost_is_nowhere_until_it_is_seen():
    """Not in the hand, not where it was; the newest word about it counts."""
    held = wm.SeenHand(Side.LEFT, "jar_1", "1", Pose((0.0, 0.0, 0.0)))
    jar = seen("jar_1", "jar", (0.783, -0.84, 0.875))
    scene = scene_of(jar, held, wm.LostObject("jar_1", Side.LEFT))
    assert scene.holder("jar_1") is None
    assert "jar_1" not in scene.things
    assert (scene.lost["jar_1"].kind, scene.lost["jar_1"].side) == ("Jar", Side.LEFT)
    assert observed(scene, seen("jar_1", "jar", (0.783, -0.84, 0.875)), (1, 0)) is scene
    again = observed(scene, seen("jar_1", "jar", (0.783, -0.84, 0.875)), (1, 9))
    assert "jar_1" in again.things
    assert again.lost == {}


def test_a_missing_thing_is_nowhere_until_it_is_seen_again():
    """It keeps its class, also when it is missing twice. A question for a bowl is answered with the
    reason.
    """
    bowl = seen("bowl_1", "bowl_high", (0.783, -0.84, 0.775))
    scene = scene_of(bowl, wm.MissingObject("bowl_1"), wm.MissingObject("bowl_1"))
    assert "bowl_1" not in scene.things
    _, told = ask(scene, Overlays(), wm.ObjectPose(object="bowl"))
    assert told == wm.Unknown((fact(Kind.NOT_SEEN_SINCE, "bowl_1"),))
    assert "bowl_1" in observed(scene, bowl, (1, 9)).things


def test_what_was_given_is_nowhere_and_km_knows_that_it_was_given():
    """It is in no hand, and a question for it is answered with the reason until it is seen
    again.
    """
    jar = seen("jar_1", "jar", (0.783, -0.84, 0.875))
    held = wm.SeenHand(Side.LEFT, "jar_1", "1", Pose((0.0, 0.0, 0.0)))
    scene = scene_of(jar, held, wm.GivenObject("jar_1", Side.LEFT))
    assert (scene.holder("jar_1"), "jar_1" in scene.things) == (None, False)
    _, told = ask(scene, Overlays(), wm.ObjectPose(object="jar"))
    assert told == wm.Unknown((fact(Kind.GIVEN_AWAY, Side.LEFT, "jar_1"),))
    assert observed(scene, jar, (1, 9)).lost == {}


def test_content_that_was_seen_stays_known_until_it_is_looked_into_again():
    """A sight from too far away tells nothing of it."""
    there, pose = (0.783, -0.84, 0.775), Pose((0.783, -0.84, 0.775))
    full = wm.SeenObject("bowl_1", "bowl_high", pose, 1.0, 0.03)
    scene = scene_of(full, seen("bowl_1", "bowl_high", there, 2.0))
    assert scene.things["bowl_1"].content == 0.03
    scene = observed(scene, wm.SeenObject("bowl_1", "bowl_high", pose, 3.0, 0.06), (1, 9))
    assert scene.things["bowl_1"].content == 0.06


TAKEN_OUT = wm.SeenHand(Side.LEFT, "jar_1", "1", Pose((0.0, 0.0, 0.0)))
PUT = wm.PlacedObject("jar_1", "jar", Pose((0.783, -0.84, 0.877)), 7.0)


@pytest.mark.parametrize("told", [(wm.SeenHand(Side.LEFT), PUT), (PUT, wm.SeenHand(Side.LEFT))])
def test_what_was_put_down_stays_where_the_hand_left_it(kitchen, told):
    """On the table, not seen there, since the hand let go of it; not in the cabinet where it was
    seen last.
    """
    scene = kitchen.scene
    for count, observation in enumerate((TAKEN_OUT, *told)):
        scene = observed(scene, observation, (9, count), 9.0)
    jar = scene.things["jar_1"]
    assert (jar.pose, jar.exact, jar.at) == (PUT.pose, False, 7.0)
    assert (jar.on, jar.inside) == ("table_1", ())
    assert (scene.holder("jar_1"), scene.times["object:jar_1"]) == (None, 7.0)
    assert jar.origin is not None
    assert jar.origin.on == "cabinet_2"
    assert observed(scene, PUT, (9, 0)) is scene, "old news"
    there = seen("jar_1", "jar", (0.78, -0.84, 0.875), 8.0)
    seen_there = observed(scene, there, (9, 9)).things["jar_1"]
    assert (seen_there.exact, seen_there.at, seen_there.origin) == (True, 8.0, jar.origin)


def test_what_was_put_down_is_known_after_a_restart(kitchen):
    """Its place, and that nobody saw it there, are in the store."""
    for count, observation in enumerate((TAKEN_OUT, wm.SeenHand(Side.LEFT), PUT)):
        assert store_observation(kitchen, observation, (9, count), now=9.0)
    answer = ask(kitchen.scene, Overlays(), wm.ObjectPose(object="jar_1"))[1]
    assert answer == wm.PoseOf("jar_1", PUT.pose, exact=False, on="table_1")


def test_on_the_roof_is_not_inside():
    """A jar on top of the cabinet is on it and not in it."""
    jar = seen("j", "jar", (1.0, 0.0, 1.0 + 0.35 + 0.1))
    scene = scene_of(seen("c", "cabinet_no_door", (1.0, 0.0, 1.0)), jar)
    assert (scene.things["j"].on, scene.things["j"].inside) == ("c", ())


def test_beside_the_table_is_not_on_it():
    """The middle of the base must be above the surface, and near it."""
    table = seen("t", "table", (0.0, 0.0, 0.0))
    for xyz, on in (
        ((0.0, 0.0, 0.775), "t"),
        ((0.5, 0.0, 0.775), ""),
        ((0.0, 0.0, 0.9), ""),
        ((0.0, 0.0, 0.785), "t"),
    ):
        assert scene_of(table, seen("b", "bowl_high", xyz)).things["b"].on == on


def test_a_bowl_may_hold_something():
    """A lid that lies in a bowl is in it."""
    lid = seen("l", "jar_lid", (0.01, 0.0, 0.03))
    scene = scene_of(seen("b", "bowl_high", (0.0, 0.0, 0.0)), lid)
    assert scene.things["l"].inside == ("b",)


@given(st.permutations([(1, 1), (1, 2), (2, 1), (2, 2)]))
def test_whatever_the_order_of_arrival_the_newest_observation_stays(order):
    """Older versions of a subject change nothing; a new incarnation is newer than any count."""
    scene = Scene()
    for version in order:
        xyz = (float(version[0]), float(version[1]), 0.0)
        scene = observed(scene, seen("j", "jar", xyz), version)
    assert scene.things["j"].pose.xyz == (2.0, 2.0, 0.0)
    assert scene.versions["object:j"] == (2, 2)


@given(st.sampled_from(KITCHEN), st.integers(0, 5))
def test_an_observation_taken_twice_is_taken_once(observation, version):
    """The second time the scene is the very same object."""
    once = observed(Scene(), observation, (1, version))
    assert observed(once, observation, (1, version)) is once


def test_subjects_are_separate():
    """A hand, an object and the body do not outdate each other."""
    subjects = [subject_of(observation) for observation in KITCHEN]
    assert len(set(subjects)) == len(subjects)


def test_what_a_hand_holds_has_no_exact_pose_until_it_is_seen_after_its_release():
    """It moves with the hand; put down unseen it is where it was predicted; seen again it is
    exact.
    """
    jar = seen("j", "jar", (0.0, 0.0, 0.0))
    grasp = wm.SeenHand(Side.LEFT, "j", "17", Pose((0.0, 0.0, 0.002), yaw(0.3)))
    assert scene_of(jar).things["j"].exact
    assert not scene_of(jar, grasp).things["j"].exact
    assert not scene_of(jar, grasp, jar).things["j"].exact
    assert not scene_of(jar, grasp, wm.SeenHand(Side.LEFT)).things["j"].exact
    assert scene_of(jar, grasp, wm.SeenHand(Side.LEFT), jar).things["j"].exact


def test_an_object_is_in_one_hand_at_most():
    """Seen in the right hand, it is no longer in the left one."""
    hold = [wm.SeenHand(side, "j", "1", Pose((0.0, 0.0, 0.0))) for side in (Side.LEFT, Side.RIGHT)]
    scene = scene_of(seen("j", "jar", (0.0, 0.0, 0.0)), *hold)
    assert scene.holder("j") is Side.RIGHT
    assert scene.hands[Side.LEFT].object == ""


def test_a_held_object_stands_on_nothing(kitchen):
    """Grasped on the shelf, it is where the hand is: neither on the shelf nor in the cabinet."""
    held = wm.SeenHand(Side.LEFT, "jar_1", "3", Pose((0.0, 0.0, 0.0)))
    scene = observed(kitchen.scene, held, (9, 0))
    assert (scene.things["jar_1"].on, scene.things["jar_1"].inside) == ("", ())


def test_an_object_of_an_unknown_model_is_kept():
    """It is somewhere, though nothing else is known of it."""
    scene = scene_of(seen("x", "teapot", (0.0, 0.0, 0.0)))
    assert scene.things["x"].kind == "PhysicalObject"
    assert scene.things["x"].known is None


def test_the_hands_posture_is_four_numbers(kitchen):
    """All six parts of the body are there after one observation."""
    assert {part: len(q) for part, q in kitchen.scene.joints.items()} == PARTS


@given(st.lists(st.sampled_from([*KITCHEN[:5], *MOVES]), min_size=1, max_size=12))
def test_relations_kept_are_those_that_would_be_computed_anew(story):
    """Looking only at what moved gives what looking at everything gives, whatever happened in
    whatever order.
    """
    scene = scene_of(*story)
    for thing in scene.things.values():
        assert (thing.on, thing.inside) == relate(scene, thing)


def test_a_scene_encodes_whole(kitchen):
    """It goes into a journal and comes back as it was."""
    scene = kitchen.scene
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(scene), type=Scene) == scene


def test_observed_is_pure(kitchen):
    """The scene it is given stays as it was."""
    before = kitchen.scene
    kept = (dict(before.things), dict(before.versions))
    observed(before, seen("jar_1", "jar", (0.0, 0.0, 0.0)), (9, 9))
    assert (before.things, before.versions) == kept
    assert pytest.approx(before.things["jar_1"].pose.xyz) == (0.851, 0.369, 1.281)


# --- where a thing stood before it was taken ------------------------------------------------------

SHELF, TABLE, FAR = (
    seen("j", "jar", xyz) for xyz in ((0.0, 0.0, 0.1), (1.0, 0.0, 0.1), (2.0, 0.0, 0.1))
)
TAKEN, LET_GO = wm.SeenHand(Side.LEFT, "j", "1", Pose((0.0, 0.0, 0.0))), wm.SeenHand(Side.LEFT)


@pytest.mark.parametrize(
    ("observations", "stood"),
    [
        ((SHELF,), None),
        ((SHELF, TAKEN), SHELF),
        ((SHELF, TAKEN, LET_GO, TABLE), SHELF),
        ((SHELF, TAKEN, LET_GO, TABLE, TAKEN), SHELF),
        ((SHELF, TAKEN, LET_GO, TABLE, FAR), None),
        ((SHELF, TAKEN, LET_GO, TABLE, FAR, TAKEN), FAR),
        ((TAKEN,), None),
        ((TAKEN, SHELF, LET_GO, TABLE), None),
    ],
)
def test_the_place_before_the_first_taking_is_kept(observations, stood):
    """Also when it was put down between; until somebody else moves it. What was not seen standing
    has none.
    """
    thing = scene_of(*observations).things.get("j")
    origin = thing and thing.origin
    assert (origin and origin.pose) == (stood and stood.pose)


def test_what_it_stood_on_is_kept_too(kitchen):
    """A held thing stands on nothing; where it came from it did."""
    held = wm.SeenHand(Side.LEFT, "jar_1", "3", Pose((0.0, 0.0, 0.0)))
    scene = observed(kitchen.scene, held, (9, 0))
    store = Store.open()
    store.write(scene)
    stood = kitchen.scene.things["jar_1"].pose
    assert store.scene.things["jar_1"].origin == Origin(stood, "cabinet_2")


def test_a_far_look_does_not_undo_a_near_one():
    """They are fused where they agree; what moved is where it was seen last."""
    near = replace(seen("jar_1", "jar", (0.783, -0.84, 0.875), 1.0), uncertainty=SURE)
    far = replace(seen("jar_1", "jar", (0.786, -0.84, 0.875), 2.0), uncertainty=UNSURE)
    moved = replace(far, pose=Pose((0.85, -0.84, 0.875)))
    both = scene_of(near, far).things["jar_1"]
    assert (both.pose.xyz, both.at) == (pytest.approx((0.783, -0.84, 0.875), abs=2e-4), 2.0)
    assert both.uncertainty is not None
    assert both.uncertainty.deviation <= SURE.deviation
    for last in (moved, replace(far, uncertainty=None)):
        assert scene_of(near, last).things["jar_1"].pose == last.pose
    assert scene_of(far, near).things["jar_1"].pose.xyz == pytest.approx(both.pose.xyz, abs=2e-4)


@pytest.mark.parametrize(
    "between",
    [
        wm.SeenHand(Side.LEFT, "jar_1", "1", Pose((0.0, 0.0, 0.0))),
        wm.PlacedObject("jar_1", "jar", Pose((0.783, -0.84, 0.875)), 1.5),
        wm.MissingObject("jar_1"),
        wm.GivenObject("jar_1", Side.LEFT),
    ],
)
def test_a_sight_of_a_thing_that_a_hand_had_counts_alone(between):
    """Where it was before says nothing then, and a place where a hand left it was not seen."""
    near = replace(seen("jar_1", "jar", (0.783, -0.84, 0.875), 1.0), uncertainty=SURE)
    far = replace(seen("jar_1", "jar", (0.786, -0.84, 0.875), 2.0), uncertainty=UNSURE)
    thing = scene_of(near, between, wm.SeenHand(Side.LEFT), far).things["jar_1"]
    assert (thing.pose, thing.uncertainty) == (far.pose, UNSURE)
