"""What is renewed after a change is what a whole scene, made again from nothing, has: relations,
marks, triples.
"""

from contextlib import contextmanager
from itertools import pairwise
from unittest.mock import patch

import msgspec
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.languages import wm
from companion.languages.values import Pose, Side
from companion.models import MODELS
from companion.world.observe import WORLD, forgotten, observed
from companion.world.scene import Scene, SceneObjects
from services.knowledge.memory import changed
from services.knowledge.store import Store, differing, subjects

from .conftest import yaw

KINDS = {
    "jar_1": "jar", "bowl_1": "bowl_high", "box_1": "box1", "box_2": "box1",
    "cabinet_1": "cabinet_no_door", "table_1": "table", "pot_1": "teapot",
}  # fmt: skip
names, sides = st.sampled_from(sorted(KINDS)), st.sampled_from(Side)
places = st.sampled_from((0.0, 0.0, 0.1, 1.5))
turns = st.sampled_from(
    (yaw(0.0), yaw(0.0), yaw(0.7), yaw(-2.1), (0.5, 0.5, 0.5, 0.5), (1.0, 0.1, 0.0, 0.0))
)
floors = st.sampled_from((0.0, 0.775, 0.885, 1.18))
"""The ground, a table, a box on it, a shelf of a cabinet on it."""


def poses_of(kind):
    """Poses of a thing that stands on a floor, or did before it was tilted."""
    base = MODELS[kind].base.z if kind in MODELS else 0.0
    return st.builds(Pose, st.tuples(places, places, floors.map(lambda z: z - base)), turns)


poses = poses_of("box1")
seen = names.flatmap(
    lambda name: st.builds(
        wm.SeenObject, st.just(name), st.just(KINDS[name]), poses_of(KINDS[name]), st.just(1.0)
    )
)
others = st.one_of(
    seen.map(lambda one: wm.PlacedObject(one.object, one.model, one.pose, 2.0)),
    st.builds(wm.SeenHand, sides, st.one_of(st.just(""), names), st.just("1"), poses),
    st.builds(wm.LostObject, names, sides),
    st.builds(wm.MissingObject, names),
    st.builds(wm.GivenObject, names, sides),
    st.builds(wm.FeltContent, st.just("jar_1"), st.sampled_from(("bowl_1", "pot_1")), st.just(0.1)),
)
sights = st.lists(
    st.integers(0, 2).flatmap(lambda kind: seen if kind else others), min_size=6, max_size=15
)
stories = st.one_of(sights, st.builds(lambda one, other: [*one, WORLD, *other], sights, sights))
supposed = st.one_of(
    st.builds(wm.Moved, names, poses, st.one_of(st.just(""), names)),
    st.builds(wm.Grasped, names, sides, st.just("1"), poses),
    st.builds(wm.Released, sides),
    st.builds(wm.Poured, names, names),
)


def scenes(story):
    """The scene after each of these, one after the other; WORLD: all was lost."""
    found = [Scene()]
    for count, sight in enumerate(story):
        version = (1, count)
        if isinstance(sight, str):
            now = forgotten(found[-1], version)
        else:
            now = observed(found[-1], sight, version)
        found.append(now)
    return found


@contextmanager
def compared_with_all():
    """Make km compare each thing with all others, as if all stood in one cell."""
    everything = lambda things, whatever: things.keys()  # noqa: E731
    with (
        patch.object(SceneObjects, "near", everything),
        patch.object(SceneObjects, "upon", everything),
    ):
        yield


def marks_are_as_made_anew(scene):
    """Whether the marks are those of the same things in a plain dict."""
    return scene.marked._marked == SceneObjects(dict(scene.things))._marked


@given(stories)
def test_who_is_compared_with_the_near_is_related_as_by_all(story):
    """After each observation; also where a thing has moved, and for poses that are not rigid."""
    found = scenes(story)
    with compared_with_all():
        assert scenes(story) == found
    assert all(map(marks_are_as_made_anew, found))


@given(stories, st.lists(supposed, max_size=6))
def test_so_it_is_in_a_hypothetical_state(story, changes):
    """After each change; a change of unknown things is left out. The observed scene stays as it
    was.
    """
    world = scenes(story)[-1]
    marks = {mark: set(names) for mark, names in world.marked._marked.items()}
    before = msgspec.msgpack.encode(world), marks
    supposed = after_each(world, changes)
    with compared_with_all():
        assert after_each(world, changes) == supposed
    assert all(map(marks_are_as_made_anew, supposed))
    assert (msgspec.msgpack.encode(world), world.marked._marked) == before


NAMED = ("object", "on", "source", "destination")
"""Fields of changes that name a thing."""


def after_each(scene, changes):
    """The scenes after these changes, but for those of things that are not there."""
    found = [scene]
    for change in changes:
        if all(getattr(change, part, "") in ("", *scene.things) for part in NAMED):
            found.append(changed(found[-1], (change,)))
    return found


@given(stories)
def test_marks_stand_in_no_record(story):
    """A scene read back is the same, with its marks, and is written in the same bytes; so is one of
    plain dicts.
    """
    for scene in scenes(story):
        data = msgspec.msgpack.encode(scene)
        again = msgspec.msgpack.decode(data, type=Scene)
        assert (again, again.marked._marked) == (scene, scene.marked._marked)
        assert msgspec.msgpack.encode(again) == data
        assert (b"things" in data) == bool(scene.things)


def whole_difference(old, new):
    """The subjects that differ, by a look at all."""
    before, after = subjects(old), subjects(new)
    gone = [one for key, one in before.items() if after.get(key) != one]
    return gone, [one for key, one in after.items() if before.get(key) != one]


@given(stories, st.lists(supposed, max_size=6), st.data())
def test_subjects_that_differ_are_found_by_what_is_not_the_same_object(story, changes, data):
    """From scene to scene, between any two, and with one that was read back, whose objects are all
    others.
    """
    found = scenes(story)
    found += after_each(found[-1], changes)
    old, new = data.draw(st.sampled_from(found)), data.draw(st.sampled_from(found))
    read_back = msgspec.msgpack.decode(msgspec.msgpack.encode(new), type=Scene)
    for before, after in (*pairwise(found), (old, new), (old, read_back)):
        assert differing(before, after) == whole_difference(before, after)


@settings(max_examples=20)
@given(stories)
def test_a_store_written_step_by_step_is_one_written_at_once(story):
    """The same triples."""
    found, (steps, once) = scenes(story), (Store.open(), Store.open())
    for scene in found:
        steps.write(scene)
    once.write(found[-1])
    assert set(steps._triples) == set(once._triples)
