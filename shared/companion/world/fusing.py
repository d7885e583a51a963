"""Fusing of two sights of a thing: by how far each may be off, and whether they agree.

Errors of sights by the same camera repeat: two of them are not worth more than the better one.
Covariance intersection (Julier and Uhlmann, 1997) never claims more than is known then, however the
errors depend on each other. Pure.
"""

import math

from companion.languages.values import Pose, Uncertainty, Vector
from companion.world.geometry import conjugate, product

AGREE = 18.5
"""Squared deviation, by both covariances, that 99.9 % of true pairs have at most: chi-squared, 4
degrees of freedom.
"""
TILT = math.radians(2.0)
"""Between two sights of a thing that stands; estimate: five times what the eyes err."""
SHARES = tuple(share / 32 for share in range(33))
"""Weights of the first sight that are tried."""
EQUAL = 1e-9
"""Share by which sizes of ellipsoids differ from rounding alone; estimate."""
Symmetric = tuple[float, float, float, float, float, float]
"""A symmetric matrix (3, 3): its upper triangle row by row."""
Sight = tuple[Pose, Uncertainty | None]


def fused(kept: Sight, seen: Sight) -> Sight:
    """Both sights as one; `seen`, the newer one, alone where they do not agree or one is of unknown
    quality.
    """
    (before, sure), (now, unsure) = kept, seen
    if sure is None or unsure is None:
        return seen
    about = _about_vertical(before, now)
    if about is None:
        return seen
    turn, off = sure.turn + unsure.turn, _less(now.xyz, before.xyz)
    if not (_positive(sure.xyz) and _positive(unsure.xyz) and turn > 0.0):
        return seen  # there is nothing to weigh by
    unlikely = _times(_inverse(_plus(sure.xyz, unsure.xyz)), off)
    if off[0] * unlikely[0] + off[1] * unlikely[1] + off[2] * unlikely[2] + about**2 / turn > AGREE:
        return seen
    xyz, place = _intersected(before.xyz, sure.xyz, now.xyz, unsure.xyz)
    if sure.turn < unsure.turn:
        return Pose(xyz, before.quat_wxyz), Uncertainty(place, sure.turn)
    return Pose(xyz, now.quat_wxyz), Uncertainty(place, unsure.turn)


def _about_vertical(before: Pose, now: Pose) -> float | None:
    """The rotation about the vertical between two poses [rad]; None where it is about another axis,
    too.
    """
    turned, x, y, about = product(now.quat_wxyz, conjugate(before.quat_wxyz))
    tilt = math.hypot(x, y)
    if 2.0 * math.asin(min(1.0, tilt)) > TILT:
        return None
    return math.remainder(2.0 * math.atan2(about, turned), math.tau)


def _intersected(
    a: Vector, of_a: Symmetric, b: Vector, of_b: Symmetric
) -> tuple[Vector, Symmetric]:
    """Place and covariance by the weights that leave the smallest ellipsoid, or the most even of
    equal ones.
    """
    known_a, known_b = _inverse(of_a), _inverse(of_b)
    sizes = {share: _determinant(_mixed(share, known_a, known_b)) for share in SHARES}
    good = (share for share, size in sizes.items() if size >= (1.0 - EQUAL) * max(sizes.values()))
    share = min(good, key=lambda one: abs(one - 0.5))
    covariance = _inverse(_mixed(share, known_a, known_b))
    x, y, z = _times(covariance, _times(known_b, _less(b, a)))
    return (a[0] + (1 - share) * x, a[1] + (1 - share) * y, a[2] + (1 - share) * z), covariance


def _less(a: Vector, b: Vector) -> Vector:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def _mixed(share: float, a: Symmetric, b: Symmetric) -> Symmetric:
    return _plus(_scaled(share, a), _scaled(1.0 - share, b))


def _plus(a: Symmetric, b: Symmetric) -> Symmetric:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5])


def _scaled(by: float, a: Symmetric) -> Symmetric:
    return (by * a[0], by * a[1], by * a[2], by * a[3], by * a[4], by * a[5])


def _times(a: Symmetric, v: Vector) -> Vector:
    (xx, xy, xz, yy, yz, zz), (x, y, z) = a, v
    return (xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z)


def _determinant(a: Symmetric) -> float:
    xx, xy, xz, yy, yz, zz = a
    return xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)


def _positive(a: Symmetric) -> bool:
    """Whether a matrix is positive definite (Sylvester's criterion)."""
    return a[0] > 0.0 and a[0] * a[3] - a[1] * a[1] > 0.0 and _determinant(a) > 0.0


def _inverse(a: Symmetric) -> Symmetric:
    xx, xy, xz, yy, yz, zz = a
    minors = (
        yy * zz - yz * yz,
        xz * yz - xy * zz,
        xy * yz - xz * yy,
        xx * zz - xz * xz,
        xy * xz - xx * yz,
        xx * yy - xy * xy,
    )
    return _scaled(1.0 / _determinant(a), minors)
