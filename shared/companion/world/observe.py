"""Observations become facts: the newest one of a subject counts, older ones are ignored; poses that
agree are fused.

Errors of sights by the same camera repeat: two of them are not worth more than the better one.
Covariance intersection (Julier and Uhlmann, 1997) never claims more than is known then, however the
errors depend on each other. Pure: a scene in, a scene out. Must not know: who observed, protocols.
"""

import math

from msgspec.structs import replace

from companion.languages import wm
from companion.languages.values import Pose, Uncertainty, Vector
from companion.world.geometry import conjugate, product
from companion.world.relations import related
from companion.world.scene import PARTS, Held, Origin, Scene, SceneObject

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


ELSEWHERE_M = 0.1
"""Farther than an object is pushed by a hand that misses it, and than a sight errs (estimate)."""
Version = tuple[int, int]
"""Incarnation of the observer and number of the observation."""


WORLD = "world"
"""Subject of the loss of the world: no older observation of any subject counts."""


def subject_of(observation: wm.AnySight) -> str:
    """Return the subject of an observation; the latest version of each subject counts."""
    match observation:
        case (
            wm.SeenObject(object=name)
            | wm.PlacedObject(object=name)
            | wm.LostObject(object=name)
            | wm.GivenObject(object=name)
            | wm.MissingObject(object=name)
        ):
            return f"object:{name}"
        case wm.SeenHand(side=side):
            return f"hand:{side.value}"
        case wm.FeltContent(source=name):
            return f"content:{name}"
        case wm.SeenBody():
            return "body"


def observed(scene: Scene, observation: wm.AnySight, version: Version, now: float = 0.0) -> Scene:
    """Return the scene with this observation, or the same object if the scene is as new or newer
    for this subject.

    `now`: time of observations that do not carry one themselves [s].
    """
    subject = subject_of(observation)
    if any(
        version <= scene.versions[known] for known in (subject, WORLD) if known in scene.versions
    ):
        return scene
    at = observation.at if isinstance(observation, wm.SeenObject | wm.PlacedObject) else now
    stamped = replace(
        scene, versions={**scene.versions, subject: version}, times={**scene.times, subject: at}
    )
    return _noted(stamped, observation, at)


def forgotten(scene: Scene, version: Version) -> Scene:
    """Return a scene of which nothing is known, after the loss of the world; the same object if
    that is old news.
    """
    if version <= max(scene.versions.values(), default=(0, 0)):
        return scene
    return Scene(reserved=scene.reserved, versions={**scene.versions, WORLD: version})


def _noted(scene: Scene, observation: wm.AnySight, at: float) -> Scene:
    match observation:
        case wm.SeenObject(object=name, model=model, pose=pose, content=content):
            # A held object moves with the hand: its pose is valid only at the moment of the
            # observation.
            exact = scene.holder(name) is None
            kept = scene.things.get(name, SceneObject(name, model, pose))
            origin = None if _moved_by_others(kept, pose) else kept.origin
            sure = kept.uncertainty if exact and kept.exact else None
            pose, uncertainty = fused((kept.pose, sure), (pose, observation.uncertainty))
            content = kept.content if content is None else content
            told = {"pose": pose, "uncertainty": uncertainty, "content": content}
            seen = replace(kept, model=model, at=at, exact=exact, origin=origin, **told)
            return related(scene.with_object(seen), at, name)
        case wm.PlacedObject(object=name, model=model, pose=pose):
            kept = scene.things.get(name, SceneObject(name, model, pose))
            left = replace(kept, model=model, pose=pose, at=at, exact=False, uncertainty=None)
            return related(scene.with_object(left), at, name)
        case wm.SeenHand(side=side, object=name, grasp=grasp, pose=pose):
            before = scene.hands.get(side, Held()).object
            return related(
                _taken(scene, name).with_hand(side, Held(name, grasp, pose)), at, before, name
            )
        case wm.LostObject(object=name, side=side):
            return scene.without(name, side)
        case wm.GivenObject(object=name, side=side):
            return scene.without(name, side, given=True)
        case wm.MissingObject(object=name):
            return scene.without(name, None)
        case wm.FeltContent(source=source, destination=destination):
            return replace(scene, contents={**scene.contents, source: destination})
        case wm.SeenBody(body=body):
            joints = {part: getattr(body, part) for part in PARTS}
            return replace(scene, joints=joints | {"torso": (body.torso,)})


def _taken(scene: Scene, name: str) -> Scene:
    """Return the scene in which an object that is now in a hand has its origin, if it was seen
    where it stood.
    """
    object = scene.things.get(name)
    if object is None or object.origin is not None or not object.exact:
        return scene
    return scene.with_object(replace(object, origin=Origin(object.pose, object.on)))


def _moved_by_others(object: SceneObject, pose: Pose) -> bool:
    """Whether an object that was seen where it stood is now seen elsewhere, and no hand of the
    robot had it between.
    """
    return object.exact and math.dist(object.pose.xyz, pose.xyz) > ELSEWHERE_M
