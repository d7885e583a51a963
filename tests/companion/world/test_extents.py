"""Cells of the floor plan: whatever touches shares one, or is compared with everything."""

import math
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.languages.values import Box, Pose
from companion.models import MODELS
from companion.world import geometry, relations
from companion.world.scene import (
    CELL_M,
    FAR_M,
    TOUCH_M,
    WIDE_M,
    Scene,
    SceneObject,
    SceneObjects,
    cells,
    cells_of,
    extent,
)

from .test_geometry import poses, shapes

models = st.sampled_from(sorted(MODELS.values(), key=lambda model: model.name))
SIGNS = tuple(product((-1, 1), repeat=3))
share = st.floats(-0.5, 0.5)
lengths = st.one_of(st.floats(0.0, 2 * WIDE_M), st.floats(0.0, 1e308))
ORIGIN = Pose((0.0, 0.0, 0.0))
ANYWHERE = (
    Pose((math.nan, 0.0, 0.0)),
    Pose((math.inf, 0.0, 0.0)),
    Pose((0.0, -1e308, 0.0)),
    Pose((FAR_M, FAR_M, 0.0)),
    Pose((0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 0.0)),
    Pose((0.0, 0.0, 0.0), (1.0, 0.5, 0.0, 0.0)),
)
"""Poses that are none, or far beyond any room."""


def with_point_at(model, height, point, turn):
    """A thing with the point of its axis that is so high above its base there."""
    x, y, z = geometry.rotate(turn.quat_wxyz, (0.0, 0.0, model.base.z + height))
    return SceneObject(
        "thing", model.name, Pose((point[0] - x, point[1] - y, point[2] - z), turn.quat_wxyz)
    )


def near(thing, other):
    """Whether the other one is among those that a thing is compared with, and the other way
    round.
    """
    one, two = (SceneObjects({it.id: it}) for it in (thing, other))
    return other.id in two.near(cells_of(thing.model, thing.pose)) and thing.id in one.near(
        cells_of(other.model, other.pose)
    )


@given(models, poses(), models.filter(lambda model: model.surfaces), poses(), st.data())
def test_what_stands_on_a_surface_shares_a_cell_with_it(model, turn, under, pose, data):
    """Wherever on it, up to its edges and to the gap that still counts as touching, however both
    are tilted.
    """
    flat = data.draw(st.sampled_from(under.surfaces))
    at = (flat.x + data.draw(share) * flat.along_x, flat.y + data.draw(share) * flat.along_y)
    point = (*at, flat.z + data.draw(share) * 2 * TOUCH_M)
    thing = with_point_at(model, 0.0, geometry.place(pose, point), turn)
    other = SceneObject("other", under.name, pose)
    assert near(thing, other)
    assert relations._support(thing, model, [other]) in ("other", "")


@given(
    models,
    poses(),
    models.filter(lambda model: model.hole),
    poses(),
    st.tuples(share, share, share),
)
def test_what_is_inside_shares_a_cell_with_it(model, turn, around, pose, part):
    """Wherever in the box around it the foot is."""
    low, high = relations._interior(around.name)
    x, y, z = ((a + b) / 2 + s * (b - a) for a, b, s in zip(low, high, part, strict=True))
    thing = with_point_at(model, relations.INSIDE_M, geometry.place(pose, (x, y, z)), turn)
    assert near(thing, SceneObject("other", around.name, pose))


@given(models, poses(), shapes, poses())
def test_what_a_volume_meets_shares_a_cell_with_it(model, pose, volume, at):
    """Each shape of a thing that overlaps it."""
    if any(geometry.overlap(shape, pose, volume, at) for shape in model.shapes):
        things = SceneObjects({"thing": SceneObject("thing", model.name, pose)})
        assert "thing" in things.near(cells(geometry.bounds(volume, at)))


@given(models, poses())
def test_the_extent_of_a_thing_holds_all_that_relations_look_at(model, pose):
    """Its shapes, what counts as on its surfaces, its base and its foot."""
    box = extent(model.name, pose)
    assert box is not None
    corners = [corner for shape in model.shapes for corner in geometry.bounds(shape, pose)]
    points = [(0.0, 0.0, model.base.z), (0.0, 0.0, model.base.z + relations.INSIDE_M)]
    for flat in model.surfaces:
        half = (flat.along_x / 2, flat.along_y / 2, TOUCH_M)
        points += [
            tuple(c + s * h for c, s, h in zip(flat.centre, sign, half, strict=True))
            for sign in SIGNS
        ]
    placed = (geometry.place(pose, one) for one in points)
    assert all(geometry.within(box, point) for point in (*corners, *placed))


@pytest.mark.parametrize("pose", ANYWHERE)
def test_what_is_nowhere_is_compared_with_everything(pose):
    """A pose that is not rigid, not finite or too far away breaks nothing; an unknown model touches
    nothing.
    """
    assert cells_of("jar", pose) is None
    assert near(SceneObject("thing", "jar", pose), SceneObject("other", "jar", ORIGIN))
    assert cells_of("teapot", pose) == frozenset()


@given(st.tuples(lengths, lengths))
def test_the_cells_of_a_volume_are_few_or_all(size):
    """However large it is along either axis."""
    found = cells(geometry.bounds(Box((*size, 1.0)), ORIGIN))
    most = (WIDE_M / CELL_M + 2) ** 2
    assert found is None if max(size) > WIDE_M else 0 < len(found or ()) <= most


def test_things_far_apart_are_not_compared():
    """A jar 2 m from a table, and a scene of them."""
    jars = {
        f"jar_{n}": SceneObject(f"jar_{n}", "jar", Pose((2.0 * n, 0.0, 0.0))) for n in range(100)
    }
    things = Scene(things=jars).marked
    assert things.near(cells_of("jar", Pose((4.0, 0.0, 1.0)))) == {"jar_2"}
    assert things.near(cells(geometry.bounds(Box((4.0, 0.1, 0.1)), ORIGIN))) == {"jar_0", "jar_1"}
