"""Situation of ex during an act: posture, what it saw, what its hands hold, and the collision world of all this.

Poses come only from the receptor. A held object moves with the hand, by the last pose seen in it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from companion import models
from companion.languages.values import Side, Uncertainty
from services.executor.local import Array
from services.executor.remembered import Unfinished
from services.executor.sight import Sight
from velma import names
from velma.kinematics.collision import World
from velma.kinematics.robot import Robot
from velma.kinematics.shapes import Cylinder

SURE_M = 1.3  # markers of all things are read from there: 1.00 up to 1.1 m, 0.92 to 1.5 m (trial, docs/eyes.md)
SURE_MARKERS = 3  # in view, by which a thing is surely seen: two would do where each is read (estimate)
FACING = math.cos(math.radians(60.0))  # least cosine of the angle at which a marker is surely read (estimate)
FALLEN, ASIDE_M = math.cos(math.radians(20.0)), 0.05
"""From here on a thing fell over, or is not where it was put down. Estimates: one that stands is seen within 2 degrees
and 20 mm of where the hand left it (tests/executor/skills/test_placed.py)."""
EDGE_POINTS = 12  # 5 cm apart on a bowl: narrower than a finger with its neighbours (estimate)
COLUMN_M = 0.25  # above an opening; as high as a jar is when it begins to pour (velma.kinematics.tasks.pouring)
BESIDE_M = 0.01  # less than the opening's radius: what is seen again is up to 8 mm elsewhere (skills/moving.py)
TINY = 1e-9  # above the rounding of a marker that faces along the z axis
MARGIN_M = 0.002  # pl plans with 6 mm; the difference is for poses that are seen again (estimate)


@dataclass
class Held:
    """The object in a hand: by which grasp, its pose in the hand (T_grip_object); mass [kg] fed forward."""

    object: str
    grasp: str
    T_grip_object: pin.SE3
    mass: float


@dataclass
class Situation:
    """The robot's set-point q (15,), head (pan, tilt) and finger angle per side [rad], things seen, things held.

    `placed`: things that a hand let go of in this act and that were not seen since, with the time [s]; `put`: where a
    hand left things that were not seen to stand there since. `unfinished`:
    pours that were begun and not ended, by source. `weighed`: mass in the hand before and after the pour of this act
    [kg]; `arrived`: whether what left is seen in the destination. `contents`: mass seen in things [kg], by the last
    look into each that nothing hid; `looked_into`: those of this act; `at_least`: mass seen by the last look of this
    act, where an arm or the thing's own wall hid some. `filled`: things that something was poured into.
    `uncertain`: how far the poses in `seen` may be off, where eyes told it. `missing`: things that were looked for in
    this act and are not where they should be. `ill`: wrists that read what cannot be, and what.
    """

    robot: Robot
    world: World
    models: dict[str, str]
    markers: Mapping[str, Array]
    q: np.ndarray = field(default_factory=lambda: np.array(names.START))
    head: tuple[float, float] = (0.0, 0.0)
    fingers: dict[str, float] = field(default_factory=lambda: {"left": 0.0, "right": 0.0})
    seen: dict[str, pin.SE3] = field(default_factory=dict)
    held: dict[str, Held] = field(default_factory=dict)
    placed: dict[str, float] = field(default_factory=dict)
    put: dict[str, pin.SE3] = field(default_factory=dict)
    unfinished: dict[str, Unfinished] = field(default_factory=dict)
    time: float = 0.0
    weighed: tuple[float, float] | None = None
    arrived: bool | None = None
    contents: dict[str, float] = field(default_factory=dict)
    looked_into: set[str] = field(default_factory=set)
    at_least: dict[str, float] = field(default_factory=dict)
    filled: set[str] = field(default_factory=set)
    uncertain: dict[str, Uncertainty] = field(default_factory=dict)
    missing: set[str] = field(default_factory=set)
    ill: dict[Side, str] = field(default_factory=dict)

    def begin(self) -> None:
        """Forget what is told at the end of one act only."""
        self.weighed = self.arrived = None
        self.looked_into, self.at_least, self.missing = set(), {}, set()

    def see(self, sights: Sequence[Sight]) -> None:
        """Take sights of the receptor: the pose in the hand of a held object, of any other the pose in the world."""
        self.missing -= {sight.name for sight in sights}
        for sight in sights:
            side = self.holder(sight.name)
            if side is None:
                self.placed.pop(sight.name, None)
                self.place(sight.name, sight.T_world_object)
                self._note(sight.name, sight.uncertainty)
            else:
                grip = self.robot.grip(self.q, side)
                self.held[side].T_grip_object = grip.inverse() * sight.T_world_object
                self.world.attach(sight.name, side, self.held[side].T_grip_object)
        for sight in sights:
            if sight.content is None or self.holder(sight.name) is not None:
                continue
            if sight.whole and self.hidden(sight.name, self.q) == 0:
                self.contents[sight.name] = sight.content
                self.looked_into.add(sight.name)
            else:
                self.at_least[sight.name] = sight.content

    def hidden(self, name: str, q: np.ndarray, head: tuple[float, float] | None = None) -> float:
        """Return how many points of a thing's opening, else of its origin, are hidden from the head, at q (15,).

        By what is known. `head`: its pan and tilt [rad], None: as they are. Infinite for a thing in a hand, or farther
        away than it is surely seen.
        """
        if not self._stands(name):
            return math.inf
        eye = self._eye(q, head)
        hole = models.MODELS[self.models[name]].hole
        points = [self.seen[name].act(np.array(point)) for point in (_edge(hole) if hole else [(0.0, 0.0, 0.0)])]
        if np.linalg.norm(points[0] - eye) > SURE_M:
            return math.inf
        return self.world.hidden(q, eye, points, name)

    def surely_seen(self, name: str, at: pin.SE3 | None = None) -> bool:
        """Whether a thing would be seen from here if it is where it should be: nothing hides enough of its markers.

        `at`: its pose in the world, also in a hand; None: as it was seen to stand. Markers inside a vessel may be
        covered by its content.
        """
        return len(self.in_view(name, at)) >= SURE_MARKERS

    def in_view(self, name: str, at: pin.SE3 | None = None) -> frozenset[int]:
        """Return which markers of a thing would be read from here: they face the eyes, and nothing known hides them.

        `at`, and markers inside a vessel: as of `surely_seen`. None for a thing of which it is not known where it is.
        """
        if at is None and not self._stands(name):
            return frozenset()
        eye, pose = self._eye(self.q), self.seen[name] if at is None else at
        covered = name in self.filled or self.contents.get(name, 0.0) > 0.0
        bare = ((k, c) for k, c in enumerate(self.markers.get(name, ())) if not (covered and _inwards(c)))
        placed = ((k, corners @ pose.rotation.T + pose.translation) for k, corners in bare)
        return frozenset(k for k, at in placed if _read(at, eye) and not self.world.hidden(self.q, eye, list(at), name))

    def above(self, name: str, at: pin.SE3 | None = None) -> frozenset[str]:
        """Return which things, beside those in hands, reach into the column above a thing's opening.

        `at`: pose of the thing, None: as it was seen. None for a thing without an opening.
        """
        hole = models.MODELS[self.models[name]].hole
        if hole is None or (at is None and name not in self.seen):
            return frozenset()
        column = Cylinder(hole.radius - BESIDE_M, COLUMN_M)
        middle = (self.seen[name] if at is None else at).act(np.array(hole.centre))
        middle[2] += COLUMN_M / 2.0
        return frozenset(self.world.inside(column, pin.SE3(np.eye(3), middle))) - {name}

    def _stands(self, name: str) -> bool:
        """Whether it is known where a thing is, and no hand holds it."""
        return name in self.seen and self.holder(name) is None

    def _eye(self, q: np.ndarray, head: tuple[float, float] | None = None) -> Array:
        """Return the place (3,) [m] of the camera at q (15,) and a pan and tilt [rad]; None: as they are."""
        return np.asarray(self.robot.camera(float(q[names.TORSO]), *(head or self.head)).translation)

    def miss(self, name: str, sights: Sequence[Sight]) -> bool:
        """Forget where a thing is, if it is not seen though it surely would be there; return whether it is missing.

        Eyes that see nothing at all tell nothing: there is furniture everywhere.
        """
        if sights and name not in {sight.name for sight in sights} and self.surely_seen(name):
            self.give_up(name)
        return name in self.missing

    def give_up(self, name: str) -> None:
        """Note that a thing is not where it should be."""
        self.missing.add(name)
        self.forget(name)

    def astray(self) -> str:
        """Return which thing was seen to have fallen over, or to be elsewhere than a hand left it; "" for none.

        What was seen since is told once.
        """
        for name in [name for name in self.put if name in self.seen and name not in self.placed]:
            put, seen = self.put.pop(name), self.seen[name]
            aside = float(np.linalg.norm(seen.translation - put.translation))
            if seen.rotation[:, 2] @ put.rotation[:, 2] < FALLEN:
                return f"{name} fell over after it was put down"
            if aside > ASIDE_M:
                return f"{name} is {aside:.2f} m from where it was put down"
        return ""

    def _note(self, name: str, uncertainty: Uncertainty | None) -> None:
        self.uncertain.pop(name, None)
        if uncertainty is not None:
            self.uncertain[name] = uncertainty

    def holder(self, name: str) -> str | None:
        """Return the side of the hand that holds it, None for none."""
        return next((side for side, held in self.held.items() if held.object == name), None)

    def take(self, side: str, held: Held) -> None:
        """Note that the hand holds this."""
        self.put.pop(held.object, None)
        self.held[side] = held
        self.world.attach(held.object, side, held.T_grip_object)

    def let_go(self, side: str) -> None:
        """Note that the hand is empty and the object stands where the hand left it."""
        held = self.held.pop(side)
        pose = self.robot.grip(self.q, side) * held.T_grip_object
        self.seen[held.object] = pose
        self.placed[held.object], self.put[held.object] = self.time, pose
        self._note(held.object, None)
        self.world.detach(held.object, pose)

    def lose(self, side: str) -> str:
        """Note that the hand is empty, and that nobody knows where the object is; return its name."""
        name = self.held.pop(side).object
        self.unfinished.pop(name, None)
        self.seen.pop(name, None)
        self.world.remove(name)
        return name

    def forget(self, name: str) -> None:
        """Note that nobody knows where a thing is."""
        self.placed.pop(name, None)
        self.put.pop(name, None)
        if self.seen.pop(name, None) is not None:
            self.world.remove(name)

    def set_fingers(self, side: str, angle: float) -> None:
        """Note the angle [rad] of the fingers of a hand."""
        self.fingers[side] = angle
        self.world.fingers(side, angle)

    def place(self, name: str, pose: pin.SE3) -> None:
        """Note the pose of a thing."""
        self.seen[name] = pose
        model = models.MODELS[self.models[name]]
        self.world.put(name, model.shapes, pose, "object" if model.moveable else "furniture")


def _edge(hole: models.Opening) -> list[tuple[float, float, float]]:
    """Return points on the edge of an opening, and its centre, in the thing's frame."""
    x, y, z = hole.centre
    around = (math.tau * k / EDGE_POINTS for k in range(EDGE_POINTS))
    return [hole.centre, *((x + hole.radius * math.cos(a), y + hole.radius * math.sin(a), z) for a in around)]


def beginning(robot: Robot, things: dict[str, str], markers: Mapping[str, Array]) -> Situation:
    """Return a situation with nothing seen or held.

    `things`: the model by the id of each thing, as markers tell it; `markers`: their corners (n, 4, 3) [m] in the
    thing's frame.
    """
    return Situation(robot, World(robot, margin=MARGIN_M), things, markers)


def _read(corners: Array, eye: Array) -> bool:
    """Whether a marker with these corners (4, 3) is near enough to the eye (3,) and faces it, so that it is read."""
    outwards, way = _normal(corners), eye - corners.mean(axis=0)
    size = float(np.linalg.norm(outwards) * np.linalg.norm(way))
    return float(np.linalg.norm(way)) <= SURE_M and float(outwards @ way) >= FACING * size


def _inwards(corners: Array) -> bool:
    """Whether a marker (4, 3) in its thing's frame faces the z axis: it is inside a vessel."""
    return float(_normal(corners)[:2] @ corners.mean(axis=0)[:2]) < -TINY


def _normal(corners: Array) -> Array:
    """Return the direction (3,) that a marker with these corners (4, 3) faces, not of length 1."""
    return np.asarray(np.cross(corners[3] - corners[0], corners[1] - corners[0]))
