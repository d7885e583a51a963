"""One pure function for each kind of query of WM: a scene and a query give an answer (paper,
section 5.4).

`ANSWERS` is the table: query class -> function; a test compares it with the design's interface.
Only observations, object models, grasps and the reach of the arms are known. For all else the
answer is Unknown, and why. Must not know: conversations, who asks.
"""

from collections.abc import Callable, Iterable
from typing import Any

from companion.languages import wm
from companion.languages.facts import Fact, Kind, fact
from companion.languages.facts import fitting as short
from companion.languages.values import Pose, Shape
from companion.models import GRASPS, REACH, Model, fitting
from companion.world import geometry
from companion.world.scene import Scene, SceneObject, cells, extent
from services.knowledge.memory import Overlays
from services.knowledge.store import below, is_kind

CONTENT = ".content"
"""`jar_1.content` is the name of what was in jar_1."""
LARGEST_WHY = 300
"""Bytes of the reason: 500 hold it with its envelope. The names of very many objects do not fit and
are left out.
"""
_WORLD = Pose((0.0, 0.0, 0.0))


class _NotKnown(Exception):
    """Raised with the answer Unknown."""

    def __init__(self, *why: Fact) -> None:
        self.answer = wm.Unknown(short(why, LARGEST_WHY))
        super().__init__(*(one.kind for one in why))


def ask(observed: Scene, overlays: Overlays, query: wm.AnyQuery) -> tuple[Overlays, wm.AnyAnswer]:
    """The hypothetical states after the query, and the answer."""
    if isinstance(query, wm.HypotheticalState):
        return overlays.make(query, observed)
    if isinstance(query, wm.DropStates):
        return overlays.drop(query.prefix), wm.Made(query.prefix)
    scene = overlays.scene(query.state, observed)
    if scene is None:
        return overlays, wm.UnknownState(query.state)
    try:
        return overlays, ANSWERS[type(query)](scene, query)
    except _NotKnown as unknown:
        return overlays, unknown.answer


def _list_objects(scene: Scene, query: wm.ListObjects) -> wm.AnyAnswer:
    if query.kind and query.kind not in below():
        raise _NotKnown(fact(Kind.UNKNOWN_TO_KM, query.kind))
    return _objects(
        t for t in scene.things.values() if not query.kind or is_kind(t.kind, query.kind)
    )


def _object_pose(scene: Scene, query: wm.ObjectPose) -> wm.AnyAnswer:
    one = _object(scene, query.object)
    return wm.PoseOf(one.id, one.pose, one.exact, one.on, scene.holder(one.id))


def _object_origin(scene: Scene, query: wm.ObjectOrigin) -> wm.AnyAnswer:
    one = _object(scene, query.object)
    if one.origin is None:
        raise _NotKnown(fact(Kind.FIRST_PLACE_UNKNOWN, one.id))
    return wm.PoseOf(one.id, one.origin.pose, exact=True, on=one.origin.on)


def _object_model(scene: Scene, query: wm.ObjectModel) -> wm.AnyAnswer:
    one = _object(scene, query.object)
    return _model(one).of(one.id)


def _hole(scene: Scene, query: wm.ObjectHole) -> wm.AnyAnswer:
    one = _object(scene, query.object)
    hole = _model(one).hole
    if hole is None:
        raise _NotKnown(fact(Kind.NO_OPENING, one.id))
    return wm.Hole(one.id, hole.centre, hole.radius, hole.axis)


def _surfaces(scene: Scene, query: wm.FlatSurfaces) -> wm.AnyAnswer:
    objects = [_object(scene, query.object)] if query.object else scene.things.values()
    found = ((one, flat) for one in objects for flat in (one.known.surfaces if one.known else ()))
    placed = ((one.id, geometry.compose(one.pose, Pose(flat.centre)), flat) for one, flat in found)
    surfaces = (wm.Surface(name, at, (top.along_x, top.along_y)) for name, at, top in placed)
    return wm.Surfaces(tuple(surfaces))


def _current_grasp(scene: Scene, query: wm.CurrentGrasp) -> wm.AnyAnswer:
    side = scene.holder(query.object) if query.object else None
    if side is None:
        return wm.GraspOf(_object(scene, query.object).id)
    held = scene.hands[side]
    return wm.GraspOf(held.object, side, held.grasp, held.pose)


def _grasp_at_side(scene: Scene, query: wm.GraspAtSide) -> wm.AnyAnswer:
    held = scene.hands.get(query.side)
    if held is None:
        raise _NotKnown(fact(Kind.UNKNOWN_TO_KM, f"{query.side}_hand"))
    return wm.GraspOf(held.object, query.side, held.grasp, held.pose)


def _grasp_set(scene: Scene, query: wm.GraspSet) -> wm.AnyAnswer:
    one = _object(scene, query.object)
    return wm.Grasps(one.id, fitting(_grasps(one), one.pose))


def _grasp_definition(scene: Scene, query: wm.GraspDefinition) -> wm.AnyAnswer:
    one = _object(scene, query.object)
    found = tuple(grasp for grasp in _grasps(one) if grasp.id == query.grasp)
    if not found:
        raise _NotKnown(fact(Kind.UNKNOWN_TO_KM, query.grasp))
    return wm.Grasps(one.id, found)


def _environment(scene: Scene, query: wm.EnvironmentShapes) -> wm.AnyAnswer:
    """The shapes around the robot. Held objects are left out, since they move with the robot."""
    seen = (one for one in scene.things.values() if one.id not in query.ignored)
    around = (one for one in seen if scene.holder(one.id) is None)
    known = ((one, one.known) for one in around if one.known)
    return wm.Shapes(tuple(wm.PlacedShape(one.id, one.pose, of.shapes) for one, of in known))


def _collisions(scene: Scene, query: wm.CollisionsInVolume) -> wm.AnyAnswer:
    box = geometry.bounds(query.volume, _WORLD)
    near = scene.marked.near(cells(box)) - set(query.ignored)
    close = (one for name, one in scene.things.items() if name in near)
    found = (one for one in close if scene.holder(one.id) is None)
    return _objects(one for one in found if _reaches_into(one, query.volume, box))


def _reaches_into(one: SceneObject, volume: Shape, box: geometry.Bounds) -> bool:
    around = extent(one.model, one.pose)
    if around is not None and geometry.apart(around, box):
        return False
    shapes = one.known.shapes if one.known else ()
    return any(geometry.overlap(shape, one.pose, volume, _WORLD) for shape in shapes)


def _reserved(scene: Scene, query: wm.ReservedSpace) -> wm.AnyAnswer:
    kept_free = scene.reserved.items()
    return wm.Shapes(tuple(wm.PlacedShape(name, _WORLD, (shape,)) for name, shape in kept_free))


def _holds(scene: Scene, query: wm.Holds) -> wm.AnyAnswer:
    if query.relation not in list(wm.Relation):
        raise _NotKnown(fact(Kind.UNKNOWN_TO_KM, query.relation))
    if query.relation == wm.Relation.IS_IN and query.subject.endswith(CONTENT):
        source = _object(scene, query.subject.removesuffix(CONTENT)).id
        return wm.Truth(_among(scene.contents.get(source, ""), query.value))
    one = _object(scene, query.subject)
    match query.relation:
        case wm.Relation.IS_IN:
            return wm.Truth(query.value in one.inside if query.value else bool(one.inside))
        case wm.Relation.IS_ON:
            return wm.Truth(_among(one.on, query.value))
        case wm.Relation.IS_GRASPED_BY:
            side = scene.holder(one.id)
            return wm.Truth(_among(side.value if side else "", query.value.removesuffix("_hand")))
        case wm.Relation.IS_INSTANCE_OF:
            return wm.Truth(
                not query.value or query.value == one.model or is_kind(one.kind, query.value)
            )
        case _:
            return wm.Truth(one.exact)


def _among(found: str, wanted: str) -> bool:
    """Whether something was found, and the wanted one if one is wanted."""
    return bool(found) and wanted in ("", found)


# --- parts of answers -----------------------------------------------------------------------------


def _object(scene: Scene, name: str) -> SceneObject:
    """The object with this id, or the first of this class."""
    if name in scene.things:
        return scene.things[name]
    for known in scene.things.values():
        if name == known.kind.lower():
            return known
    for id, lost in scene.lost.items():
        if name in (id, lost.kind.lower()):
            if lost.side is None:
                raise _NotKnown(fact(Kind.NOT_SEEN_SINCE, id))
            raise _NotKnown(fact(Kind.GIVEN_AWAY if lost.given else Kind.LOST_SINCE, lost.side, id))
    seen = fact(Kind.SEEN, *sorted(scene.things)) if scene.things else fact(Kind.SEEN_NOTHING)
    raise _NotKnown(fact(Kind.NOT_SEEN, name), seen)


def _model(one: SceneObject) -> Model:
    if one.known is None:
        raise _NotKnown(fact(Kind.UNKNOWN_TO_KM, one.model))
    return one.known


def _grasps(one: SceneObject) -> tuple[wm.GraspDef, ...]:
    if one.model not in GRASPS:
        raise _NotKnown(fact(Kind.NO_KNOWN_GRASP, one.id))
    return GRASPS[one.model]


def _joints(scene: Scene, part: str) -> wm.Configuration:
    if part not in scene.joints:
        raise _NotKnown(fact(Kind.UNKNOWN_TO_KM, part))
    return wm.Configuration(scene.joints[part])


def _objects(objects: Iterable[SceneObject]) -> wm.Objects:
    return wm.Objects(tuple(wm.Object(one.id, one.model, one.kind) for one in objects))


ANSWERS: dict[type, Callable[[Scene, Any], wm.AnyAnswer]] = {
    wm.ListObjects: _list_objects,
    wm.ObjectPose: _object_pose,
    wm.ObjectOrigin: _object_origin,
    wm.ObjectModel: _object_model,
    wm.MoveableObjects: lambda scene, query: _objects(
        one for one in scene.things.values() if one.moveable
    ),
    wm.StaticObjects: lambda scene, query: _objects(
        one for one in scene.things.values() if not one.moveable
    ),
    wm.ObjectHole: _hole,
    wm.FlatSurfaces: _surfaces,
    wm.CurrentGrasp: _current_grasp,
    wm.GraspAtSide: _grasp_at_side,
    wm.GraspSet: _grasp_set,
    wm.GraspDefinition: _grasp_definition,
    wm.ArmConfiguration: lambda scene, query: _joints(scene, f"{query.side.value}_arm"),
    wm.TorsoConfiguration: lambda scene, query: _joints(scene, "torso"),
    wm.HeadConfiguration: lambda scene, query: _joints(scene, "head"),
    wm.GripperConfiguration: lambda scene, query: _joints(scene, f"{query.side.value}_hand"),
    wm.EnvironmentShapes: _environment,
    wm.CollisionsInVolume: _collisions,
    wm.ReservedSpace: _reserved,
    wm.RobotReach: lambda scene, query: REACH[query.side],
    wm.Holds: _holds,
}
"""Queries that read a state."""

MAKERS: frozenset[type] = frozenset({wm.HypotheticalState, wm.DropStates})
"""Queries that make or drop states; `ask` hands them to the overlays."""
