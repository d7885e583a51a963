"""One pure function for each kind of query of WM: a scene and a query give an answer (paper, section 5.4).

`ANSWERS` is the table: query class -> function; a test compares it with the design's interface. Only observations,
object models, grasps and the reach of the arms are known. For all else the answer is Unknown, and why. Must not know:
stores, conversations, who asks.
"""

from collections.abc import Callable, Iterable
from typing import Any

from companion.languages import wm
from companion.languages.facts import Fact, Kind, fact
from companion.languages.facts import fitting as short
from companion.languages.values import Pose
from companion.models import GRASPS, REACH, Model, fitting
from services.knowledge import geometry
from services.knowledge.extents import cells, extent
from services.knowledge.overlays import Overlays
from services.knowledge.scene import Scene, Thing
from services.knowledge.store import Store
from services.knowledge.subjects import below, is_kind

CONTENT = ".content"
"""`jar_1.content` is the name of what was in jar_1."""
LARGEST_WHY = 300
"""Bytes of the reason: 500 hold it with its envelope. The names of very many things do not fit and are left out."""
_WORLD = Pose((0.0, 0.0, 0.0))


class _NotKnown(Exception):
    """Raised with the answer Unknown."""

    def __init__(self, *why: Fact) -> None:
        self.answer = wm.Unknown(short(why, LARGEST_WHY))
        super().__init__(*(one.kind for one in why))


def answer(store: Store, query: wm.AnyQuery, overlays: Overlays | None = None) -> wm.AnyAnswer:
    """Return the answer from the store and the hypothetical states; change neither."""
    return ask(store.scene, overlays or Overlays(), query)[1]


def ask(observed: Scene, overlays: Overlays, query: wm.AnyQuery) -> tuple[Overlays, wm.AnyAnswer]:
    """Return the hypothetical states after the query, and the answer."""
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
    return _objects(t for t in scene.things.values() if not query.kind or is_kind(t.kind, query.kind))


def _object_pose(scene: Scene, query: wm.ObjectPose) -> wm.AnyAnswer:
    thing = _thing(scene, query.object)
    return wm.PoseOf(thing.id, thing.pose, thing.exact, thing.on, scene.holder(thing.id))


def _object_origin(scene: Scene, query: wm.ObjectOrigin) -> wm.AnyAnswer:
    thing = _thing(scene, query.object)
    if thing.origin is None:
        raise _NotKnown(fact(Kind.FIRST_PLACE_UNKNOWN, thing.id))
    return wm.PoseOf(thing.id, thing.origin.pose, exact=True, on=thing.origin.on)


def _object_model(scene: Scene, query: wm.ObjectModel) -> wm.AnyAnswer:
    thing = _thing(scene, query.object)
    return _model(thing).of(thing.id)


def _moveable(scene: Scene, query: wm.MoveableObjects) -> wm.AnyAnswer:
    return _objects(thing for thing in scene.things.values() if thing.moveable)


def _static(scene: Scene, query: wm.StaticObjects) -> wm.AnyAnswer:
    return _objects(thing for thing in scene.things.values() if not thing.moveable)


def _hole(scene: Scene, query: wm.ObjectHole) -> wm.AnyAnswer:
    thing = _thing(scene, query.object)
    hole = _model(thing).hole
    if hole is None:
        raise _NotKnown(fact(Kind.NO_OPENING, thing.id))
    return wm.Hole(thing.id, hole.centre, hole.radius, hole.axis)


def _surfaces(scene: Scene, query: wm.FlatSurfaces) -> wm.AnyAnswer:
    things = [_thing(scene, query.object)] if query.object else scene.things.values()
    return wm.Surfaces(
        tuple(
            wm.Surface(thing.id, geometry.compose(thing.pose, Pose(flat.centre)), (flat.along_x, flat.along_y))
            for thing in things
            for flat in (thing.known.surfaces if thing.known else ())
        )
    )


def _current_grasp(scene: Scene, query: wm.CurrentGrasp) -> wm.AnyAnswer:
    side = scene.holder(query.object) if query.object else None
    if side is None:
        return wm.GraspOf(_thing(scene, query.object).id)
    held = scene.hands[side]
    return wm.GraspOf(held.object, side, held.grasp, held.pose)


def _grasp_at_side(scene: Scene, query: wm.GraspAtSide) -> wm.AnyAnswer:
    held = scene.hands.get(query.side)
    if held is None:
        raise _NotKnown(fact(Kind.UNKNOWN_TO_KM, f"{query.side}_hand"))
    return wm.GraspOf(held.object, query.side, held.grasp, held.pose)


def _grasp_set(scene: Scene, query: wm.GraspSet) -> wm.AnyAnswer:
    thing = _thing(scene, query.object)
    return wm.Grasps(thing.id, fitting(_grasps(thing), thing.pose))


def _grasp_definition(scene: Scene, query: wm.GraspDefinition) -> wm.AnyAnswer:
    thing = _thing(scene, query.object)
    found = tuple(grasp for grasp in _grasps(thing) if grasp.id == query.grasp)
    if not found:
        raise _NotKnown(fact(Kind.UNKNOWN_TO_KM, query.grasp))
    return wm.Grasps(thing.id, found)


def _arm(scene: Scene, query: wm.ArmConfiguration) -> wm.AnyAnswer:
    return _joints(scene, f"{query.side.value}_arm")


def _torso(scene: Scene, query: wm.TorsoConfiguration) -> wm.AnyAnswer:
    return _joints(scene, "torso")


def _head(scene: Scene, query: wm.HeadConfiguration) -> wm.AnyAnswer:
    return _joints(scene, "head")


def _gripper(scene: Scene, query: wm.GripperConfiguration) -> wm.AnyAnswer:
    return _joints(scene, f"{query.side.value}_hand")


def _environment(scene: Scene, query: wm.EnvironmentShapes) -> wm.AnyAnswer:
    """Return the shapes around the robot. Held objects are left out, since they move with the robot."""
    return wm.Shapes(
        tuple(
            wm.PlacedShape(thing.id, thing.pose, thing.known.shapes)
            for thing in scene.things.values()
            if thing.known and thing.id not in query.ignored and scene.holder(thing.id) is None
        )
    )


def _collisions(scene: Scene, query: wm.CollisionsInVolume) -> wm.AnyAnswer:
    box = geometry.bounds(query.volume, _WORLD)
    near = scene.marked.near(cells(box)) - set(query.ignored)
    found = (thing for name, thing in scene.things.items() if name in near and scene.holder(name) is None)
    return _objects(thing for thing in found if _reaches_into(thing, query.volume, box))


def _reserved(scene: Scene, query: wm.ReservedSpace) -> wm.AnyAnswer:
    return wm.Shapes(tuple(wm.PlacedShape(name, _WORLD, (volume,)) for name, volume in scene.reserved.items()))


def _reach(scene: Scene, query: wm.RobotReach) -> wm.AnyAnswer:
    return REACH[query.side]


def _holds(scene: Scene, query: wm.Holds) -> wm.AnyAnswer:
    if query.relation not in list(wm.Relation):
        raise _NotKnown(fact(Kind.UNKNOWN_TO_KM, query.relation))
    if query.relation == wm.Relation.IS_IN and query.subject.endswith(CONTENT):
        source = _thing(scene, query.subject.removesuffix(CONTENT)).id
        return wm.Truth(_among(scene.contents.get(source, ""), query.value))
    thing = _thing(scene, query.subject)
    return wm.Truth(_true_of(scene, thing, query))


def _true_of(scene: Scene, thing: Thing, query: wm.Holds) -> bool:
    match query.relation:
        case wm.Relation.IS_IN:
            return query.value in thing.inside if query.value else bool(thing.inside)
        case wm.Relation.IS_ON:
            return _among(thing.on, query.value)
        case wm.Relation.IS_GRASPED_BY:
            side = scene.holder(thing.id)
            return _among(side.value if side else "", query.value.removesuffix("_hand"))
        case wm.Relation.IS_INSTANCE_OF:
            return not query.value or query.value == thing.model or is_kind(thing.kind, query.value)
        case _:
            return thing.exact


def _among(found: str, wanted: str) -> bool:
    """Whether something was found, and the wanted one if one is wanted."""
    return bool(found) and wanted in ("", found)


def _thing(scene: Scene, name: str) -> Thing:
    if name in scene.things:
        return scene.things[name]
    for known in scene.things.values():
        if name == known.kind.lower():
            return known
    for thing, lost in scene.lost.items():
        if name in (thing, lost.kind.lower()):
            if lost.side is None:
                raise _NotKnown(fact(Kind.NOT_SEEN_SINCE, thing))
            raise _NotKnown(fact(Kind.GIVEN_AWAY if lost.given else Kind.LOST_SINCE, lost.side, thing))
    seen = fact(Kind.SEEN, *sorted(scene.things)) if scene.things else fact(Kind.SEEN_NOTHING)
    raise _NotKnown(fact(Kind.NOT_SEEN, name), seen)


def _model(thing: Thing) -> Model:
    if thing.known is None:
        raise _NotKnown(fact(Kind.UNKNOWN_TO_KM, thing.model))
    return thing.known


def _grasps(thing: Thing) -> tuple[wm.GraspDef, ...]:
    if thing.model not in GRASPS:
        raise _NotKnown(fact(Kind.NO_KNOWN_GRASP, thing.id))
    return GRASPS[thing.model]


def _joints(scene: Scene, part: str) -> wm.Configuration:
    if part not in scene.joints:
        raise _NotKnown(fact(Kind.UNKNOWN_TO_KM, part))
    return wm.Configuration(scene.joints[part])


def _objects(things: Iterable[Thing]) -> wm.Objects:
    return wm.Objects(tuple(wm.Object(thing.id, thing.model, thing.kind) for thing in things))


def _reaches_into(thing: Thing, volume: Any, box: geometry.Bounds) -> bool:
    around = extent(thing.model, thing.pose)
    if around is not None and geometry.apart(around, box):
        return False
    shapes = thing.known.shapes if thing.known else ()
    return any(geometry.overlap(shape, thing.pose, volume, _WORLD) for shape in shapes)


ANSWERS: dict[type, Callable[[Scene, Any], wm.AnyAnswer]] = {
    wm.ListObjects: _list_objects,
    wm.ObjectPose: _object_pose,
    wm.ObjectOrigin: _object_origin,
    wm.ObjectModel: _object_model,
    wm.MoveableObjects: _moveable,
    wm.StaticObjects: _static,
    wm.ObjectHole: _hole,
    wm.FlatSurfaces: _surfaces,
    wm.CurrentGrasp: _current_grasp,
    wm.GraspAtSide: _grasp_at_side,
    wm.GraspSet: _grasp_set,
    wm.GraspDefinition: _grasp_definition,
    wm.ArmConfiguration: _arm,
    wm.TorsoConfiguration: _torso,
    wm.HeadConfiguration: _head,
    wm.GripperConfiguration: _gripper,
    wm.EnvironmentShapes: _environment,
    wm.CollisionsInVolume: _collisions,
    wm.ReservedSpace: _reserved,
    wm.RobotReach: _reach,
    wm.Holds: _holds,
}
"""Queries that read a state."""

MAKERS: frozenset[type] = frozenset({wm.HypotheticalState, wm.DropStates})
"""Queries that make or drop states; `ask` hands them to the overlays."""
