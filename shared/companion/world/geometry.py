"""Rigid transforms and overlap of convex shapes in plain Python: enough for relations and volumes,
no robot. numpy takes much longer for so few numbers.

Poses are `T_A_B` (companion.languages.values), metres, quaternions w first. `overlap` is GJK on
support functions (Gilbert, Johnson, Keerthi 1988): for convex shapes, true where they share a
point. Must not know: facts, queries.
"""

import math
from collections.abc import Iterable

from companion.languages.values import Box, Cylinder, Pose, Shape, Sphere, Vector

Bounds = tuple[Vector, Vector]
Quat = tuple[float, float, float, float]
# GJK needs a few iterations for such shapes; undecided after these, they count as touching (safe
# side).
ROUNDS = 32
# Squared length below which a direction counts as zero: a nanometre, far below any measurement.
_SAME = 1e-18


def product(a: Quat, b: Quat) -> Quat:
    """The Hamilton product: the turn b, then the turn a."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def conjugate(quat_wxyz: Quat) -> Quat:
    """The inverse of a turn."""
    w, x, y, z = quat_wxyz
    return w, -x, -y, -z


def rotate(quat_wxyz: Quat, v: Vector) -> Vector:
    """Return v rotated by a unit quaternion."""
    w, x, y, z = quat_wxyz
    a, b, c = v
    tx, ty, tz = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx


def place(pose: Pose, point: Vector) -> Vector:
    """Return a point of frame B in frame A, by T_A_B."""
    x, y, z = rotate(pose.quat_wxyz, point)
    a, b, c = pose.xyz
    return x + a, y + b, z + c


def unplace(pose: Pose, point: Vector) -> Vector:
    """Return a point of frame A in frame B, by T_A_B."""
    return rotate(conjugate(pose.quat_wxyz), _minus(point, pose.xyz))


def compose(first: Pose, second: Pose) -> Pose:
    """Return T_A_C of T_A_B and T_B_C."""
    return Pose(place(first, second.xyz), product(first.quat_wxyz, second.quat_wxyz))


def inverse(pose: Pose) -> Pose:
    """Return T_B_A of T_A_B."""
    return Pose(unplace(pose, (0.0, 0.0, 0.0)), conjugate(pose.quat_wxyz))


def half_sizes(shape: Shape) -> Vector:
    """Return half edge lengths [m] of the box around a shape, in the frame of the shape."""
    match shape:
        case Box(size=(x, y, z)):
            return x / 2, y / 2, z / 2
        case Cylinder(radius=r, length=length):
            return r, r, length / 2
        case Sphere(radius=r):
            return r, r, r


def bounds(shape: Shape, pose: Pose) -> Bounds:
    """Return the lowest and highest coordinates of the box around a shape of an object at
    `pose`.
    """
    at = compose(pose, shape.at)
    a, b, c = half_sizes(shape)
    p, q, r = (rotate(at.quat_wxyz, edge) for edge in ((a, 0, 0), (0, b, 0), (0, 0, c)))
    reach = (
        abs(p[0]) + abs(q[0]) + abs(r[0]),
        abs(p[1]) + abs(q[1]) + abs(r[1]),
        abs(p[2]) + abs(q[2]) + abs(r[2]),
    )
    return _minus(at.xyz, reach), _minus(at.xyz, _negative(reach))


def bounds_of(shapes: Iterable[Shape], pose: Pose) -> Bounds:
    """Return the box around several shapes. Raises ValueError for none."""
    boxes = [bounds(shape, pose) for shape in shapes]
    low = [min(box[0][i] for box in boxes) for i in range(3)]
    high = [max(box[1][i] for box in boxes) for i in range(3)]
    return (low[0], low[1], low[2]), (high[0], high[1], high[2])


def apart(one: Bounds, other: Bounds) -> bool:
    """Whether two axis-aligned boxes are disjoint."""
    return any(one[1][i] < other[0][i] or other[1][i] < one[0][i] for i in range(3))


def within(box: Bounds, point: Vector) -> bool:
    """Whether the point is in the box."""
    return all(low <= value <= high for low, value, high in zip(box[0], point, box[1], strict=True))


def overlap(one: Shape, at: Pose, other: Shape, there: Pose) -> bool:
    """Whether two shapes of objects at `at` and `there` share a point."""
    if apart(bounds(one, at), bounds(other, there)):
        return False
    first, second = compose(at, one.at), compose(there, other.at)
    simplex: list[Vector] = []
    direction = _minus(second.xyz, first.xyz)
    if _dot(direction, direction) < _SAME:
        return True
    for _ in range(ROUNDS):
        point = _minus(
            _support(one, first, direction), _support(other, second, _negative(direction))
        )
        if _dot(point, direction) < 0:
            return False
        simplex.append(point)
        simplex, direction = _nearest(simplex)
        if _dot(direction, direction) < _SAME:
            return True
    return True


def _support(shape: Shape, at: Pose, direction: Vector) -> Vector:
    """Return the point of the shape farthest in a direction of the world."""
    x, y, z = rotate(conjugate(at.quat_wxyz), direction)
    match shape:
        case Box(size=(a, b, c)):
            local = (math.copysign(a / 2, x), math.copysign(b / 2, y), math.copysign(c / 2, z))
        case Cylinder(radius=r, length=length):
            flat = math.hypot(x, y)
            local = (
                r * x / flat if flat else 0.0,
                r * y / flat if flat else 0.0,
                math.copysign(length / 2, z),
            )
        case Sphere(radius=r):
            norm = math.sqrt(x * x + y * y + z * z)
            local = (r * x / norm, r * y / norm, r * z / norm)
    return place(at, local)


def _nearest(simplex: list[Vector]) -> tuple[list[Vector], Vector]:
    """Return the part of a simplex (newest point last) that faces the origin, and the direction to
    the origin.

    A zero direction means that the origin is in it.
    """
    if len(simplex) == 1:
        return simplex, _negative(simplex[0])
    if len(simplex) == 2:
        return _line(simplex[0], simplex[1])
    if len(simplex) == 3:
        return _triangle(simplex[0], simplex[1], simplex[2])
    return _tetrahedron(*simplex)


def _line(b: Vector, a: Vector) -> tuple[list[Vector], Vector]:
    ab, ao = _minus(b, a), _negative(a)
    if _dot(ab, ao) <= 0:
        return [a], ao
    return [b, a], _cross(_cross(ab, ao), ab)


def _triangle(c: Vector, b: Vector, a: Vector) -> tuple[list[Vector], Vector]:
    ab, ac, ao = _minus(b, a), _minus(c, a), _negative(a)
    normal = _cross(ab, ac)
    if _dot(_cross(normal, ac), ao) > 0:
        return _line(c, a) if _dot(ac, ao) > 0 else _line(b, a)
    if _dot(_cross(ab, normal), ao) > 0:
        return _line(b, a)
    if _dot(normal, ao) >= 0:
        return [c, b, a], normal if _dot(normal, ao) > 0 else (0.0, 0.0, 0.0)
    return [b, c, a], _negative(normal)


def _tetrahedron(d: Vector, c: Vector, b: Vector, a: Vector) -> tuple[list[Vector], Vector]:
    ab, ac, ad, ao = _minus(b, a), _minus(c, a), _minus(d, a), _negative(a)
    if _dot(_cross(ab, ac), ao) > 0:
        return _triangle(c, b, a)
    if _dot(_cross(ac, ad), ao) > 0:
        return _triangle(d, c, a)
    if _dot(_cross(ad, ab), ao) > 0:
        return _triangle(b, d, a)
    return [d, c, b, a], (0.0, 0.0, 0.0)


def _minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _negative(a: Vector) -> Vector:
    return -a[0], -a[1], -a[2]


def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
