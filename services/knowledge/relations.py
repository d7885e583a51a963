"""isOn and isIn, computed from poses and shapes only.

Pure functions of a scene. Must not know: where poses come from.
"""

from collections.abc import Set
from functools import cache

import msgspec

from companion.languages.values import Pose, Vector
from companion.models import MODELS, Flat, Model
from services.knowledge import geometry
from services.knowledge.extents import TOUCH_M, cells_of
from services.knowledge.scene import Scene, Thing

# The foot of an object is taken this far above its base, so that an object on a roof is not inside; estimate.
INSIDE_M = 0.01


def related(scene: Scene, now: float, *touched: str) -> Scene:
    """Return the scene with its relations computed again, after the things `touched` were moved, taken or released.

    `now`: time of the newest observation [s]. Relations between things that stayed are kept.
    """
    things = scene.marked
    moved = [things[name] for name in touched if name in things]
    near = {name for one in moved for name in (one.id, *things.upon(one.id), *_near(scene, one))}
    concerned = (things[name] for name in near if any(_concerns(one, things[name]) for one in moved))
    renewed = [after for thing in concerned if (after := _related(scene, thing, now)) is not thing]
    return msgspec.structs.replace(scene, things=things.having(renewed)) if renewed else scene


def _near(scene: Scene, thing: Thing) -> Set[str]:
    return scene.marked.near(cells_of(thing.model, thing.pose))


def _concerns(moved: Thing, thing: Thing) -> bool:
    """Whether the move may change what the thing is on or in."""
    if moved.id in (thing.id, thing.on) or moved.id in thing.inside:
        return True
    if moved.known is None or thing.known is None:
        return False
    return _is_in(thing, thing.known, moved, moved.known) or bool(_support(thing, thing.known, [moved]))


def relate(scene: Scene, thing: Thing) -> tuple[str, tuple[str, ...]]:
    """Return what a thing is on ("" for nothing) and in (sorted by id)."""
    model = thing.known
    if model is None:
        return "", ()
    if scene.holder(thing.id) is not None:
        return "", ()  # it moves with the hand
    others = [scene.things[name] for name in _near(scene, thing) if name != thing.id]
    inside = tuple(sorted(other.id for other in others if other.known and _is_in(thing, model, other, other.known)))
    return _support(thing, model, others), inside


def _related(scene: Scene, thing: Thing, now: float) -> Thing:
    on, inside = relate(scene, thing)
    if (on, inside) == (thing.on, thing.inside):
        return thing
    return msgspec.structs.replace(thing, on=on, inside=inside, related_at=now)


def _support(thing: Thing, model: Model, others: list[Thing]) -> str:
    """Return the thing with the nearest flat surface below the centre of the base."""
    base = geometry.place(thing.pose, (0.0, 0.0, model.base.z))
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


def _is_in(thing: Thing, model: Model, other: Thing, container: Model) -> bool:
    """Whether the foot of a thing is within a thing that has an opening."""
    if container.hole is None:
        return False
    foot = geometry.place(thing.pose, (0.0, 0.0, model.base.z + INSIDE_M))
    return geometry.within(_interior(container.name), geometry.unplace(other.pose, foot))


@cache
def _interior(model: str) -> geometry.Bounds:
    """Return the box around a model, in its own frame."""
    return geometry.bounds_of(MODELS[model].shapes, Pose((0.0, 0.0, 0.0)))
