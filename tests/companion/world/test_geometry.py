"""Transforms are rigid; overlap agrees with exact tests."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from companion.languages.values import Box, Cylinder, Pose, Sphere
from companion.world import geometry

coordinates = st.floats(-0.6, 0.6)
points = st.tuples(coordinates, coordinates, coordinates)
sizes = st.floats(0.02, 0.5)
unit = st.floats(-1.0, 1.0)


@st.composite
def poses(draw):
    """Any pose in a room of a metre."""
    quat = draw(st.tuples(unit, unit, unit, unit))
    norm = math.hypot(*quat)
    assume(norm > 0.1)
    return Pose(draw(points), tuple(part / norm for part in quat))


boxes = st.builds(Box, st.tuples(sizes, sizes, sizes))
spheres = st.builds(Sphere, sizes)
cylinders = st.builds(Cylinder, sizes, sizes)
shapes = st.one_of(boxes, spheres, cylinders)


@given(poses(), points)
def test_a_point_placed_and_taken_back_is_the_same(pose, point):
    """unplace undoes place."""
    assert geometry.unplace(pose, geometry.place(pose, point)) == pytest.approx(point, abs=1e-9)


@given(poses(), poses(), points)
def test_composed_poses_place_as_one_after_the_other(one, other, point):
    """(T_A_B T_B_C) p = T_A_B (T_B_C p)"""
    whole = geometry.place(geometry.compose(one, other), point)
    assert whole == pytest.approx(geometry.place(one, geometry.place(other, point)), abs=1e-9)


@given(boxes, poses(), spheres, poses())
def test_a_box_meets_a_sphere_where_its_nearest_point_is_within_the_radius(box, at, ball, there):
    """Compared with the exact distance."""
    x, y, z = geometry.unplace(at, there.xyz)
    outside = [
        max(abs(value) - size / 2, 0.0) for value, size in zip((x, y, z), box.size, strict=True)
    ]
    distance = math.hypot(*outside)
    assume(abs(distance - ball.radius) > 1e-4)
    assert geometry.overlap(box, at, ball, there) == (distance < ball.radius)


def axes_of(pose):
    """The three axes of a frame."""
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    return [geometry.rotate(pose.quat_wxyz, axis) for axis in axes]


def gap_of_boxes(one, at, other, there):
    """Largest gap along one of the 15 separating axes (negative: none)."""
    first, second = axes_of(at), axes_of(there)
    candidates = first + second + [geometry._cross(a, b) for a in first for b in second]
    offset = geometry._minus(there.xyz, at.xyz)
    largest = -math.inf
    for axis in candidates:
        norm = math.hypot(*axis)
        if norm < 1e-6:
            continue
        half = sum(
            abs(geometry._dot(axis, a)) * s / 2 for a, s in zip(first, one.size, strict=True)
        )
        half += sum(
            abs(geometry._dot(axis, b)) * s / 2 for b, s in zip(second, other.size, strict=True)
        )
        largest = max(largest, (abs(geometry._dot(axis, offset)) - half) / norm)
    return largest


@given(boxes, poses(), boxes, poses())
def test_boxes_overlap_where_no_axis_separates_them(one, at, other, there):
    """Compared with the separating axes of two boxes."""
    gap = gap_of_boxes(one, at, other, there)
    assume(abs(gap) > 1e-4)
    assert geometry.overlap(one, at, other, there) == (gap < 0)


def scaled(shape, factor):
    """The same shape, larger or smaller."""
    match shape:
        case Box(size=(x, y, z)):
            return Box((x * factor, y * factor, z * factor))
        case Cylinder(radius=r, length=length):
            return Cylinder(r * factor, length * factor)
        case Sphere(radius=r):
            return Sphere(r * factor)


@given(shapes, poses(), shapes, poses())
def test_overlap_does_not_depend_on_the_order(one, at, other, there):
    """The order of shapes does not matter; a mere touch, which 1 % of size would change, is left
    out.
    """
    forward = geometry.overlap(one, at, other, there)
    for factor in (0.99, 1.01):
        assume(geometry.overlap(scaled(one, factor), at, other, there) == forward)
    assert geometry.overlap(other, there, one, at) == forward


@given(shapes, poses(), poses())
def test_a_shape_meets_what_is_in_its_middle(one, at, turn):
    """A small ball at its centre overlaps it."""
    assert geometry.overlap(one, at, Sphere(0.01), Pose(at.xyz, turn.quat_wxyz))


@given(shapes, poses())
def test_the_bounds_hold_the_shapes_outermost_points(one, at):
    """The farthest point of the shape in any direction of the axes is within the bounds."""
    low, high = geometry.bounds(one, at)
    placed = geometry.compose(at, one.at)
    for axis in ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.8, 0.0)):
        point = geometry._support(one, placed, axis)
        assert all(low[i] - 1e-9 <= point[i] <= high[i] + 1e-9 for i in range(3))
