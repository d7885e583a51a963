"""Hypothetical states: what they answer is what a changed copy of the world would answer."""

from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.languages import wm
from companion.languages.facts import Kind, fact
from companion.languages.values import Box, Pose, Side
from companion.world.observe import observed
from companion.world.scene import PARTS, Scene
from services.knowledge.answers import ask
from services.knowledge.memory import Impossible, Overlays, changed

from .conftest import KITCHEN


def kitchen_scene():
    """The recorded scene."""
    scene = Scene()
    for count, observation in enumerate(KITCHEN, start=1):
        scene = observed(scene, observation, (1, count), 2.0)
    return scene


WORLD = kitchen_scene()
number = st.floats(-1.5, 1.5, allow_nan=False)
poses = st.builds(Pose, st.tuples(number, number, number))
objects = st.sampled_from(sorted(WORLD.things))
sides = st.sampled_from(Side)
parts = st.sampled_from(sorted(PARTS)).flatmap(
    lambda part: st.builds(wm.Configured, st.just(part), st.tuples(*[number] * PARTS[part]))
)
changes = st.one_of(
    st.builds(wm.Moved, objects, poses, st.one_of(st.just(""), objects), st.booleans()),
    st.builds(wm.Grasped, objects, sides, st.just("5"), poses),
    st.builds(wm.Released, sides),
    parts,
    st.builds(
        wm.Reserved, st.sampled_from("abc"), st.one_of(st.none(), st.just(Box((0.1, 0.2, 0.3))))
    ),
    st.builds(wm.Poured, objects, objects),
)
stories = st.lists(st.lists(changes, max_size=3).map(tuple), min_size=1, max_size=5)


def every_query(state):
    """One query of each kind about each object, side, relation, in a state."""
    found = []
    for name in sorted(WORLD.things):
        kinds = (wm.ObjectPose, wm.ObjectModel, wm.ObjectHole, wm.FlatSurfaces)
        kinds += (wm.CurrentGrasp, wm.GraspSet)
        found += [kind(object=name, state=state) for kind in kinds]
        relations = ("isIn", "isOn", "isGraspedBy", "hasExactPose")
        found += [wm.Holds(relation=one, subject=name, state=state) for one in relations]
        found += [wm.Holds(relation="isIn", subject=f"{name}.content", state=state)]
    for side in Side:
        kinds_of_side = (
            wm.GraspAtSide,
            wm.ArmConfiguration,
            wm.GripperConfiguration,
            wm.RobotReach,
        )
        found += [kind(side=side, state=state) for kind in kinds_of_side]
    plain = (wm.ListObjects, wm.MoveableObjects, wm.StaticObjects, wm.TorsoConfiguration)
    plain += (wm.HeadConfiguration, wm.EnvironmentShapes, wm.ReservedSpace, wm.FlatSurfaces)
    found += [kind(state=state) for kind in plain]
    volume = Box((0.4, 0.4, 0.4), Pose((0.85, 0.37, 1.2)))
    return [*found, wm.CollisionsInVolume(volume=volume, state=state)]


def told(state, scene, overlays):
    """All answers."""
    return [ask(scene, overlays, query)[1] for query in every_query(state)]


@given(stories)
def test_a_hypothesis_answers_as_a_changed_copy_does(story):
    """Each state, made on the one before it, equals the observed world with all changes so far made
    to it.
    """
    overlays, parent, so_far = Overlays(), "", ()
    for number, step in enumerate(story):
        so_far += step
        query = wm.HypotheticalState(state=parent, id=f"p.{number}", changes=step)
        overlays, made = ask(WORLD, overlays, query)
        assert made == wm.Made(query.id)
        parent = query.id
        assert told(parent, WORLD, overlays) == told("", changed(WORLD, so_far), Overlays())


@given(stories)
def test_making_a_hypothesis_leaves_its_parent_and_the_world_as_they_were(story):
    """Answers about the observed world and about the first state are the same before and after."""
    overlays, _ = ask(WORLD, Overlays(), wm.HypotheticalState(id="p", changes=story[0]))
    before = told("", WORLD, overlays), told("p", WORLD, overlays)
    after, _ = ask(WORLD, overlays, wm.HypotheticalState(state="p", id="q", changes=story[-1]))
    assert (told("", WORLD, after), told("p", WORLD, after)) == before


@given(stories)
def test_made_twice_is_made_once(story):
    """The same words again change nothing; other words under the same id are refused."""
    query = wm.HypotheticalState(id="p", changes=story[0])
    once, made = ask(WORLD, Overlays(), query)
    twice, again = ask(WORLD, once, query)
    assert (twice is once, again) == (True, made)
    other = wm.HypotheticalState(id="p", changes=(*story[0], wm.Released(Side.LEFT)))
    kept, answer = ask(WORLD, once, other)
    assert kept is once
    assert answer == wm.Unknown((fact(Kind.UNKNOWN_TO_KM, "p"),))


def test_dropping_forgets_what_begins_so_and_nothing_else():
    """By prefix; a child whose parent is dropped stays whole."""
    overlays = Overlays()
    for state, id in (("", "a.1"), ("a.1", "b.1"), ("", "a.2")):
        poured = (wm.Poured("jar_1", "bowl_1"),)
        made = wm.HypotheticalState(state=state, id=id, changes=poured)
        overlays, _ = ask(WORLD, overlays, made)
    after, made = ask(WORLD, overlays, wm.DropStates(prefix="a."))
    assert made == wm.Made("a.")
    assert list(after.states) == ["b.1"]
    assert told("b.1", WORLD, after) == told("b.1", WORLD, overlays)
    assert ask(WORLD, after, wm.DropStates(prefix="a."))[0] is after


def test_a_state_that_is_gone_is_told_by_a_type_of_its_own():
    """Every kind of query names it, and a child cannot be made of it."""
    for query in every_query("nowhere"):
        answer = ask(WORLD, Overlays(), query)[1]
        assert answer == wm.UnknownState("nowhere")
    child = wm.HypotheticalState(state="nowhere", id="x")
    assert isinstance(ask(WORLD, Overlays(), child)[1], wm.UnknownState)


@given(st.integers(1, 5), st.integers(1, 12))
def test_the_oldest_goes_first_when_there_are_too_many(largest, count):
    """Never more than the bound, and always the newest ones."""
    overlays = Overlays(largest=largest)
    for n in range(count):
        overlays, _ = ask(WORLD, overlays, wm.HypotheticalState(id=f"s{n}"))
    assert list(overlays.states) == [f"s{n}" for n in range(max(0, count - largest), count)]


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (wm.Moved("ghost", Pose((0.0, 0.0, 0.0))), fact(Kind.NOT_SEEN, "ghost")),
        (wm.Moved("jar_1", Pose((0.0, 0.0, 0.0)), on="ghost"), fact(Kind.NOT_SEEN, "ghost")),
        (wm.Grasped("ghost", Side.LEFT, "1", Pose((0.0, 0.0, 0.0))), fact(Kind.NOT_SEEN, "ghost")),
        (wm.Poured("jar_1", "ghost"), fact(Kind.NOT_SEEN, "ghost")),
        (wm.Configured("tail", (0.0,)), fact(Kind.UNKNOWN_TO_KM, "tail")),
        (wm.Configured("torso", (0.0, 0.0)), fact(Kind.UNKNOWN_TO_KM, "torso")),
    ],
)
def test_what_cannot_be_changed_is_refused_with_a_reason(change, why):
    """Things never observed and parts the robot has not."""
    with pytest.raises(Impossible):
        changed(WORLD, (change,))
    overlays, answer = ask(WORLD, Overlays(), wm.HypotheticalState(id="p", changes=(change,)))
    assert answer == wm.Unknown((why,))
    assert not overlays.states


def test_a_hypothesis_shares_what_it_does_not_change():
    """Records that did not change are the same objects, so a state costs its changes."""
    after = changed(WORLD, (wm.Configured("torso", (0.5,)),))
    assert after.things is WORLD.things
    moved = changed(WORLD, (wm.Moved("jar_1", Pose((0.0, 0.0, 3.0))),))
    assert moved.things["bowl_1"] is WORLD.things["bowl_1"]


def test_every_kind_of_change_can_be_made():
    """None of the language's changes is left out."""
    examples = {
        wm.Moved("jar_1", Pose((0.0, 0.0, 0.0))),
        wm.Grasped("jar_1", Side.LEFT, "1", Pose((0.0, 0.0, 0.0))),
        wm.Released(Side.LEFT),
        wm.Configured("torso", (0.1,)),
        wm.Reserved("v", Box((1.0, 1.0, 1.0))),
        wm.Poured("jar_1", "bowl_1"),
    }
    assert {type(change) for change in examples} == set(get_args(wm.AnyChange))
    for change in examples:
        changed(WORLD, (change,))
