"""A state of the world as km knows it: immutable, typed records by id.

The observed world is one Scene, each hypothetical state another. A change makes a new Scene that
shares all other records, so a hypothesis needs only the memory of its changes. It is encoded whole
into the journal. Objects are found by cells of the floor plan: two that touch share a cell, or the
cells of one are not known, so only objects of the same cells are compared, however many there are.
An object reaches as far as relations look: its shapes, and what stands on its surfaces. Must not
know: stores, agents, queries.
"""

import math
from collections.abc import Iterable, Mapping, Set
from functools import cache, lru_cache
from itertools import product

import msgspec
from msgspec.structs import replace

from companion.languages.values import Box, Pose, Shape, Side, Uncertainty
from companion.models import MODELS, Model
from companion.world import geometry

# An object whose base is this close to a surface stands on it: poses are seen with some 4 mm error,
# and an object tilted by a degree or two stands a few mm higher; estimate.
TOUCH_M = 0.03

# Edge of a cell; estimate: some objects of a hand's size stand in it, and a table reaches over some
# twenty.
CELL_M = 0.25
# What is wider is compared with everything; estimate: the widest model is a table of 1.3 m by its
# diagonal.
WIDE_M = 4.0
# What is farther away is compared with everything; estimate: no room is so large, and rounding is
# far below ROUNDING_M.
FAR_M = 1e6
# Largest error of a quaternion's length; beyond it a pose is not rigid. Estimate: four digits are
# within.
UNIT = 1e-3
# Added to each side of a box: more than a quaternion within UNIT moves any point of a model
# (estimate).
ROUNDING_M = 0.01

Cells = frozenset[tuple[int, int]]


def cells(box: geometry.Bounds) -> Cells | None:
    """Return the cells that a box reaches, None where all objects are to be compared with it."""
    (x0, y0, _), (x1, y1, _) = box
    if not (x1 - x0 <= WIDE_M and y1 - y0 <= WIDE_M and abs(x0) + abs(y0) <= FAR_M):
        return None
    return frozenset(product(_steps(x0, x1), _steps(y0, y1)))


@lru_cache(maxsize=4096)  # estimate: the objects of some scenes
def cells_of(model: str, pose: Pose) -> Cells | None:
    """Return the cells that an object reaches: none if its model is not known, for nothing is known
    of it then.
    """
    box = extent(model, pose)
    return frozenset() if model not in MODELS else cells(box) if box is not None else None


def extent(model: str, pose: Pose) -> geometry.Bounds | None:
    """Return a box around all that an object reaches; None where its model is not known, or its
    pose is not rigid.
    """
    if model not in MODELS or not abs(math.hypot(*pose.quat_wxyz) - 1.0) <= UNIT:
        return None
    return geometry.bounds(_around(model), pose)


def _steps(low: float, high: float) -> range:
    return range(math.floor(low / CELL_M), math.floor(high / CELL_M) + 1)


@cache
def _around(model: str) -> Box:
    """Return a box around all that a model reaches, its base too, in its own frame."""
    known = MODELS[model]
    above = (
        Box((flat.along_x, flat.along_y, 2 * TOUCH_M), Pose(flat.centre)) for flat in known.surfaces
    )
    low, high = geometry.bounds_of((*known.shapes, *above), Pose((0.0, 0.0, 0.0)))
    x, y, z = (b - a + 2 * ROUNDING_M for a, b in zip(low, high, strict=True))
    a, b, c = ((a + b) / 2 for a, b in zip(low, high, strict=True))
    return Box((x, y, z), Pose((a, b, c)))


PARTS = {"torso": 1, "right_arm": 7, "left_arm": 7, "head": 2, "right_hand": 4, "left_hand": 4}
"""Number of joints by part of the body."""


class Origin(msgspec.Struct, frozen=True):
    """Place of an object before the robot took it: its pose, and what it was on ("" if that is not
    known).
    """

    pose: Pose
    on: str


class SceneObject(msgspec.Struct, frozen=True, omit_defaults=True):
    """An object, with the pose where it was last seen, where a hand let go of it, or where it is
    predicted to be.

    `exact`: it was seen there. `on`, `inside`: computed from poses and shapes. `at`: time of that
    observation, `related_at`: of the newest observation behind its relations [s, observer's clock].
    `origin`: of the first time that the robot took it; None before, and after somebody else moved
    it. `content`: mass of what was seen in it [kg] when it was looked into last, None if it never
    was. `uncertainty`: of the pose where it was seen; None: it is not known.
    """

    id: str
    model: str
    pose: Pose
    at: float = 0.0
    exact: bool = True
    on: str = ""
    inside: tuple[str, ...] = ()
    related_at: float = 0.0
    origin: Origin | None = None
    content: float | None = None
    uncertainty: Uncertainty | None = None

    @property
    def known(self) -> Model | None:
        return MODELS.get(self.model)

    @property
    def kind(self) -> str:
        """The name of its class in the ontology."""
        return self.known.kind if self.known else "PhysicalObject"

    @property
    def moveable(self) -> bool:
        return self.known is not None and self.known.moveable


Mark = tuple[int, int] | str | None
"""A cell that an object reaches, None for any cell; or the id of another object, which it is on or
in.
"""


class SceneObjects(dict[str, SceneObject]):
    """Objects by id, and the ids of those that have a mark. Never changed in place.

    It is encoded as any other dict; the marks are made again from it.
    """

    def __init__(self, objects: Mapping[str, SceneObject]) -> None:
        super().__init__(objects)
        self._marked: dict[Mark, frozenset[str]] = {}
        if isinstance(objects, SceneObjects):
            self._marked |= objects._marked
        else:
            for name, object in objects.items():
                self._mark(name, frozenset(), _marks(object))

    def having(self, objects: Iterable[SceneObject]) -> "SceneObjects":
        after = SceneObjects(self)
        for object in objects:
            after._mark(object.id, _marks(self.get(object.id)), _marks(object))
            after[object.id] = object
        return after

    def without(self, name: str) -> "SceneObjects":
        after = SceneObjects(self)
        after._mark(name, _marks(after.pop(name, None)), frozenset())
        return after

    def near(self, cells: Cells | None) -> Set[str]:
        """The ids of all objects that may touch what reaches these cells, and of some others."""
        if cells is None:
            return self.keys()
        return frozenset().union(*(self._marked.get(mark, ()) for mark in (None, *cells)))

    def upon(self, name: str) -> Set[str]:
        """The ids of the objects that are on or in another one."""
        return self._marked.get(name, frozenset())

    def _mark(self, name: str, old: frozenset[Mark], new: frozenset[Mark]) -> None:
        for mark in old - new:
            left = self._marked.pop(mark) - {name}
            self._marked |= {mark: left} if left else {}
        for mark in new - old:
            self._marked[mark] = self._marked.get(mark, frozenset()) | {name}


def _marks(object: SceneObject | None) -> frozenset[Mark]:
    if object is None:
        return frozenset()
    cells = cells_of(object.model, object.pose)
    anywhere: tuple[Mark, ...] = (None,)
    on = (object.on,) if object.on else ()
    return frozenset((*(anywhere if cells is None else cells), *object.inside, *on))


class Held(msgspec.Struct, frozen=True, omit_defaults=True):
    """The object in a hand ("" if it is empty), by which grasp, and T_grip_object."""

    object: str = ""
    grasp: str = ""
    pose: Pose | None = None


class Lost(msgspec.Struct, frozen=True, omit_defaults=True):
    """An object whose place is unknown: its class in the ontology, and the hand that lost it, or
    gave it to a person (`given`); None: it was missing where it should have been.
    """

    kind: str
    side: Side | None
    given: bool = False


class Scene(msgspec.Struct, frozen=True, omit_defaults=True):
    """Objects, hands, joints [rad] per part of the body, spaces kept free, contents poured (source
    -> destination).

    `lost`: objects that left a hand, or were missing where they should be, and were not seen since.

    `versions`: the newest observation of each subject; `times`: when it was made, or when it
    arrived if it carries no time. A missing hand or part was never observed.
    """

    things: dict[str, SceneObject] = {}
    hands: dict[Side, Held] = {}
    joints: dict[str, tuple[float, ...]] = {}
    reserved: dict[str, Shape] = {}
    contents: dict[str, str] = {}
    versions: dict[str, tuple[int, int]] = {}
    times: dict[str, float] = {}
    lost: dict[str, Lost] = {}

    def __post_init__(self) -> None:
        """Mark the objects."""
        # omit_defaults leaves only a plain empty dict out
        kind = SceneObjects if self.things else dict
        if type(self.things) is not kind:
            msgspec.structs.force_setattr(self, "things", kind(self.things))

    @property
    def marked(self) -> SceneObjects:
        return self.things if isinstance(self.things, SceneObjects) else SceneObjects({})

    def holder(self, object: str) -> Side | None:
        return next((side for side, held in self.hands.items() if held.object == object), None)

    def with_object(self, object: SceneObject) -> "Scene":
        lost = {name: one for name, one in self.lost.items() if name != object.id}
        return replace(self, things=self.marked.having((object,)), lost=lost)

    def without(self, name: str, side: Side | None, *, given: bool = False) -> "Scene":
        """The scene after the hand `side` lost this object, or gave it to a person, or it was
        missing (None).
        """
        known = self.things.get(name) or self.lost.get(name)
        kind = known.kind if known is not None else "PhysicalObject"
        items = self.hands.items()
        hands = {where: Held() if held.object == name else held for where, held in items}
        lost = {**self.lost, name: Lost(kind, side, given)}
        return replace(self, things=self.marked.without(name), hands=hands, lost=lost)

    def with_hand(self, side: Side, held: Held) -> "Scene":
        """The scene with this hand; an object in it leaves the other hand, and its pose is not
        exact.
        """
        hands = {
            other: Held() if held.object and what.object == held.object else what
            for other, what in self.hands.items()
        }
        scene = replace(self, hands={**hands, side: held})
        object = self.things.get(held.object)
        if object is None:
            return scene
        return scene.with_object(replace(object, exact=False, on=""))
