"""isOn and isIn, computed from poses and shapes only.

Pure functions of a scene. Must not know: where poses come from.
"""

from collections.abc import Set
from functools import cache

from msgspec.structs import replace

from companion.languages.values import Pose, Vector
from companion.models import MODELS, Flat, Model
from companion.world import geometry
from companion.world.scene import TOUCH_M, Scene, SceneObject, cells_of

# The foot of an object is taken this far above its base, so that an object on a roof is not inside;
# estimate.
INSIDE_M = 0.01


def related(scene: Scene, now: float, *touched: str) -> Scene:
    """Return the scene with its relations computed again, after the objects `touched` were moved,
    taken or released.

    `now`: time of the newest observation [s]. Relations between objects that stayed are kept.
    """
    objects = scene.marked
    moved = [objects[name] for name in touched if name in objects]
    near = {name for one in moved for name in (one.id, *objects.upon(one.id), *_near(scene, one))}
    close = (objects[name] for name in near)
    concerned = (other for other in close if any(_concerns(one, other) for one in moved))
    computed = ((object, *relate(scene, object)) for object in concerned)
    renewed = [
        replace(object, on=on, inside=inside, related_at=now)
        for object, on, inside in computed
        if (on, inside) != (object.on, object.inside)
    ]
    return replace(scene, things=objects.having(renewed)) if renewed else scene


def _near(scene: Scene, object: SceneObject) -> Set[str]:
    return scene.marked.near(cells_of(object.model, object.pose))


def _concerns(moved: SceneObject, object: SceneObject) -> bool:
    """Whether the move may change what the object is on or in."""
    if moved.id in (object.id, object.on) or moved.id in object.inside:
        return True
    if moved.known is None or object.known is None:
        return False
    return _is_in(object, object.known, moved, moved.known) or bool(
        _support(object, object.known, [moved])
    )


def relate(scene: Scene, object: SceneObject) -> tuple[str, tuple[str, ...]]:
    """Return what an object is on ("" for nothing) and in (sorted by id)."""
    model = object.known
    if model is None or scene.holder(object.id) is not None:  # it moves with the hand
        return "", ()
    others = [scene.things[name] for name in _near(scene, object) if name != object.id]
    known = ((other, other.known) for other in others if other.known)
    inside = tuple(sorted(other.id for other, of in known if _is_in(object, model, other, of)))
    return _support(object, model, others), inside


def _support(object: SceneObject, model: Model, others: list[SceneObject]) -> str:
    """Return the object with the nearest flat surface below the centre of the base."""
    base = geometry.place(object.pose, (0.0, 0.0, model.base.z))
    found = [
        (abs(gap), other.id)
        for other in others
        if other.known
        for flat in other.known.surfaces
        if (gap := _gap(flat, other.pose, base)) is not None
    ]
    return min(found)[1] if found else ""


def _gap(flat: Flat, pose: Pose, base: Vector) -> float | None:
    """Return the height of a point above a surface, None if it is not above it or too far away."""
    x, y, z = geometry.unplace(pose, base)
    over = abs(x - flat.x) <= flat.along_x / 2 and abs(y - flat.y) <= flat.along_y / 2
    return z - flat.z if over and abs(z - flat.z) <= TOUCH_M else None


def _is_in(object: SceneObject, model: Model, other: SceneObject, container: Model) -> bool:
    """Whether the foot of an object is within an object that has an opening."""
    if container.hole is None:
        return False
    foot = geometry.place(object.pose, (0.0, 0.0, model.base.z + INSIDE_M))
    return geometry.within(_interior(container.name), geometry.unplace(other.pose, foot))


@cache
def _interior(model: str) -> geometry.Bounds:
    """Return the box around a model, in its own frame."""
    return geometry.bounds_of(MODELS[model].shapes, Pose((0.0, 0.0, 0.0)))
