"""Situation of ex during an act: posture, what it saw, what its hands hold, and the collision world
of all this.

Poses come only from the receptor. A held object moves with the hand, by the last pose seen in it.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Protocol

import msgspec
import numpy as np
import pinocchio as pin

from companion import models
from companion.languages import rc
from companion.languages.facts import Facts, Kind, fact
from companion.languages.values import Side, Uncertainty
from velma import names
from velma.eyes.lens import HEIGHT, LENS, WIDTH
from velma.kinematics.collision import World
from velma.kinematics.robot import Robot
from velma.kinematics.shapes import Cylinder
from velma.model.kinds import DOORS
from velma.names import Array

Neck = tuple[float, float, float]
"""Measured torso, pan and tilt [rad]: the joints between the world and the camera."""


@dataclass(frozen=True)
class Sight:
    """A detected thing: its name, and its pose in the world with the error that eyes have.

    `content`: mass of what is seen in it [kg]; None where these eyes, or from there, do not tell.
    An arm before the opening hides some of it, and from low down its own wall does (not `whole`).
    `uncertainty`: of the pose; None where these eyes do not tell.
    """

    name: str
    T_world_object: pin.SE3
    content: float | None = None
    uncertainty: Uncertainty | None = None
    whole: bool = True


class Eye(Protocol):
    """Eyes in the robot's head. The simulator gives them its state in place of light.

    `wrong`: fault of the camera at the last look (velma.eyes.health.Wrong), "" for none; `off`:
    error of the measured torso or head by that look [rad], 0 for none. With a faulty camera or a
    large error, nothing is seen.
    """

    wrong: str
    off: float

    def look(self, world: Array, neck: Neck, /) -> list[Sight]:
        """What is seen in the state `world` (nq,). The robot is at rest."""
        ...

    def close(self) -> None:
        """End what the eyes started."""
        ...


# --- Content on its way from a held thing into another one, as ex remembers it from act to act ----


class Unfinished(msgspec.Struct, frozen=True):
    """A move of content that was begun: into which thing, and what the hand felt of the source
    [kg].

    `full`: the mass before the move, with what had left in earlier ones; None: it was not felt.
    `left`: the mass that left in all of them, None while the last one has not been weighed. `had`:
    the mass seen in the destination before.
    """

    destination: str
    full: float | None
    left: float | None = None
    had: float = 0.0


# --- Situation of ex during an act: posture, what it saw, what its hands hold, and the collision
# world of all this


# markers of all things are read from there: 1.00 up to 1.1 m, 0.92 to 1.5 m (trial, docs/eyes.md)
SURE_M = 1.3
# in view, by which a thing is surely seen: two would do where each is read (estimate)
SURE_MARKERS = 3
# least cosine of the angle at which a marker is surely read (estimate)
FACING = math.cos(math.radians(60.0))
SURE_PX = 11.0
"""Least width in the picture of a marker that is surely read. In four pours (`canonical` and
`env2`) 13 of 36 markers of 8 to 11 pixels were read, 291 of 308 of 11 to 16, 582 of 583 wider ones
(all face the eye within 60 degrees).
"""
FALLEN, ASIDE_M = math.cos(math.radians(20.0)), 0.05
"""From here on a thing fell over, or is not where it was put down. Estimates: one that stands is
seen within 2 degrees and 20 mm of where the hand left it
(tests/companion/tasks/put_down/test_placed.py).
"""
EDGE_POINTS = 12  # 5 cm apart on a bowl: narrower than a finger with its neighbours (estimate)
SAME_RAD, SAME_M = 0.03, 0.02
"""Most by which a thing turns and shifts in a hand from look to look. In 20 good pours (10 each in
`canonical` and `env2`, 113 looks at a held thing) it was 0.019 rad and 13 mm; in all, a jar turned
by up to 0.04 rad.
"""
# by which a joint's error shifts a hand [m/rad], an arm's length; beside it (estimates)
LEVER_M, LOOSE_M = 1.0, 0.01
# from the middle, as a share of width and height: a white rim is needed, too (estimate)
IN_PICTURE = 0.48
# above an opening; as high as a jar is when it begins to pour (velma.kinematics.tasks.pouring)
COLUMN_M = 0.25
# less than the opening's radius: what is seen again is up to 8 mm elsewhere (skills/moving.py)
BESIDE_M = 0.01
TINY = 1e-9  # above the rounding of a marker that faces along the z axis
MARGIN_M = 0.002  # pl plans with 6 mm; the difference is for poses that are seen again (estimate)


@dataclass
class Held:
    """The object in a hand: by which grasp, its pose in the hand (T_grip_object); mass [kg] fed
    forward.

    `steady`: the pose in the hand in which it was seen before, None: not yet; `apart`: looks since,
    one after the other, in which it was seen in another one; `slipped`: felt to have.
    """

    object: str
    grasp: str
    T_grip_object: pin.SE3
    mass: float
    steady: pin.SE3 | None = None
    apart: int = 0
    slipped: bool = False

    def see(self, inside: pin.SE3) -> None:
        """Take the pose in the hand by a look."""
        if self.steady is None or _same(self.steady, inside):
            self.steady, self.apart = inside, 0
        else:
            self.apart = self.apart + 1 if _same(self.T_grip_object, inside) else 1
        self.T_grip_object = inside

    def turned(self) -> tuple[float, float]:
        """How much [rad, m] the thing has jumped in the hand, as if a joint of the arm were
        measured wrong.

        0 where it has not, by two looks that agree, or where it only slid. A grip that slipped may
        look alike.
        """
        if self.steady is None or self.apart < 2:
            return 0.0, 0.0
        angle, shift = _apart(self.steady, self.T_grip_object)
        return (angle, shift) if shift < LEVER_M * angle + LOOSE_M else (0.0, 0.0)


@dataclass
class Situation:
    """The robot's set-point q (15,), head (pan, tilt) and finger angle per side [rad], things seen,
    things held.

    `fingers`: as wide as paths need room for, also where the hand is closed round a thing; `bent`:
    as measured. `placed`: things that a hand let go of in this act and that were not seen since,
    with the time [s]; `put`: where a hand left things that were not seen to stand there since.
    `unfinished`: moves of content that were begun and not ended, by source. `noted`: what the skill
    of this act has found out and its own row reads, a struct of its task; None: nothing.
    `contents`: mass seen in things [kg], by the last look into each that nothing hid;
    `looked_into`: those of this act; `at_least`: mass seen by the last look of this act, where an
    arm or the thing's own wall hid some. `filled`: things that something was poured into.
    `uncertain`: how far the poses in `seen` may be off, where eyes told it. `missing`: things that
    were looked for in this act and are not where they should be. `looked_at`: things that were seen
    in this act, after a hand took them or let go of them. `ill`: sensors whose readings cannot be
    true. `blind`: number of looks in a row that showed none of the furniture that must be in view;
    `numb`: hands without a working sensor in the wrist. `refused`: what was wrong with a motion
    that could not be made, for the log.
    """

    robot: Robot
    world: World
    models: dict[str, str]
    markers: Mapping[str, Array]
    q: np.ndarray = field(default_factory=lambda: np.array(names.START))
    head: tuple[float, float] = (0.0, 0.0)
    fingers: dict[str, float] = field(default_factory=lambda: {"left": 0.0, "right": 0.0})
    bent: dict[str, float] = field(default_factory=dict)
    seen: dict[str, pin.SE3] = field(default_factory=dict)
    held: dict[str, Held] = field(default_factory=dict)
    placed: dict[str, float] = field(default_factory=dict)
    put: dict[str, pin.SE3] = field(default_factory=dict)
    unfinished: dict[str, Unfinished] = field(default_factory=dict)
    time: float = 0.0
    noted: object = None
    contents: dict[str, float] = field(default_factory=dict)
    looked_into: set[str] = field(default_factory=set)
    at_least: dict[str, float] = field(default_factory=dict)
    filled: set[str] = field(default_factory=set)
    uncertain: dict[str, Uncertainty] = field(default_factory=dict)
    missing: set[str] = field(default_factory=set)
    looked_at: set[str] = field(default_factory=set)
    ill: tuple[rc.Ill, ...] = ()
    blind: int = 0
    numb: set[Side] = field(default_factory=set)
    refused: str = ""

    def begin(self) -> None:
        """Forget what is told at the end of one act only."""
        self.noted, self.refused = None, ""
        self.looked_into, self.at_least, self.missing, self.looked_at = set(), {}, set(), set()

    def stand(
        self, q: Array, head: tuple[float, float], bent: Mapping[str, float], time: float
    ) -> None:
        """Take the posture at this time."""
        self.q, self.head, self.time = q.copy(), head, time
        self.bent.update(bent)

    def see(self, sights: Sequence[Sight]) -> None:
        """Take sights of the receptor: the pose in the hand of a held object, of any other the pose
        in the world.
        """
        self.missing -= {sight.name for sight in sights}
        self.looked_at |= {sight.name for sight in sights}
        for sight in sights:
            side = self.holder(sight.name)
            if side is None:
                self.placed.pop(sight.name, None)
                self.place(sight.name, sight.T_world_object)
                self._note(sight.name, sight.uncertainty)
            else:
                grip = self.robot.grip(self.q, side)
                self.held[side].see(grip.inverse() * sight.T_world_object)
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
        """How many points of a thing's opening, else of its origin, are hidden from the head, at q
        (15,).

        By what is known. `head`: its pan and tilt [rad], None: as they are. Infinite for a thing in
        a hand, or farther away than it is surely seen.
        """
        if not self._stands(name):
            return math.inf
        eye = self._eye(q, head)
        hole = models.MODELS[self.models[name]].hole
        points = [
            self.seen[name].act(np.array(point))
            for point in (_edge(hole) if hole else [(0.0, 0.0, 0.0)])
        ]
        if np.linalg.norm(points[0] - eye) > SURE_M:
            return math.inf
        return self._hidden(q, eye, points, name)

    def _hidden(self, q: Array, eye: Array, points: Sequence[Array], name: str) -> int:
        """How many points of a thing are hidden, with the fingers as they are: open ones hide other
        things.
        """
        for side, angle in self.bent.items():
            self.world.fingers(side, angle)
        try:
            return self.world.hidden(q, eye, points, name)
        finally:
            for side in self.bent:
                self.world.fingers(side, self.fingers[side])

    def surely_seen(self, name: str, at: pin.SE3 | None = None) -> bool:
        """Whether a thing would be seen from here if it is where it should be: enough markers of it
        are in the picture, and nothing hides them.

        `at`: its pose in the world, also in a hand; None: as it was seen to stand. Markers inside a
        vessel may be covered by its content. The head does not turn everywhere: what it could not
        turn to may be there.
        """
        if at is None and not self._stands(name):
            return False
        shown, pose = self.in_view(name, at), self.seen[name] if at is None else at
        camera = self.robot.camera(float(self.q[names.TORSO]), *self.head)
        markers = self._markers_at(name, pose)
        framed = (number for number, corners in markers if _framed(corners, camera))
        return len(shown & set(framed)) >= SURE_MARKERS

    def in_view(self, name: str, at: pin.SE3 | None = None) -> frozenset[int]:
        """Which markers of a thing would be read from here: they face the eyes, and nothing known
        hides them.

        `at`, and markers inside a vessel: as of `surely_seen`. Empty if it is not known where the
        thing is.
        """
        if at is None and not self._stands(name):
            return frozenset()
        eye, pose = self._eye(self.q), self.seen[name] if at is None else at
        markers = self._markers_at(name, pose)
        return frozenset(number for number, at in markers if self._shown(name, at, eye))

    def _markers_at(self, name: str, pose: pin.SE3) -> Iterator[tuple[int, Array]]:
        """Yield the number and the corners (4, 3) [m, world] of each marker of a thing at this pose
        that no content covers.
        """
        covered = name in self.filled or self.contents.get(name, 0.0) > 0.0
        for number, corners in enumerate(self.markers.get(name, ())):
            if not (covered and _inwards(corners)):
                yield number, corners @ pose.rotation.T + pose.translation

    def _shown(self, name: str, corners: Array, eye: Array) -> bool:
        """Whether a marker of a thing is surely read, if it is in the picture."""
        return _read(corners, eye) and not self._hidden(self.q, eye, list(corners), name)

    def must_show(self) -> bool:
        """Whether enough markers of furniture are in the picture from here, and nothing hides
        them.
        """
        camera = self.robot.camera(float(self.q[names.TORSO]), *self.head)
        fixed = (
            name
            for name, model in self.models.items()
            if model not in DOORS and not models.MODELS[model].moveable
        )
        seen = ((name, self.seen[name]) for name in fixed if name in self.seen)
        corners = ((name, at) for name, pose in seen for _, at in self._markers_at(name, pose))
        framed = ((name, at) for name, at in corners if _framed(at, camera))
        sure = (at for name, at in framed if self._shown(name, at, camera.translation))
        return len(list(islice(sure, SURE_MARKERS))) == SURE_MARKERS

    def above(self, name: str, at: pin.SE3 | None = None) -> frozenset[str]:
        """Which things, beside those in hands, reach into the column above a thing's opening.

        `at`: pose of the thing, None: as it was seen. Empty for a thing without an opening.
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
        """The place (3,) [m] of the camera at q (15,) and a pan and tilt [rad]; None: as they
        are.
        """
        return np.asarray(
            self.robot.camera(float(q[names.TORSO]), *(head or self.head)).translation
        )

    def miss(self, name: str, sights: Sequence[Sight]) -> bool:
        """Forget where a thing is, if it is not seen though it surely would be there; return
        whether it is missing.

        Eyes that see nothing at all tell nothing: there is furniture everywhere.
        """
        if sights and name not in {sight.name for sight in sights} and self.surely_seen(name):
            self.give_up(name)
        return name in self.missing

    def give_up(self, name: str) -> None:
        """Note that a thing is not where it should be."""
        self.missing.add(name)
        self.forget(name)

    def astray(self) -> Facts:
        """Which thing was seen to have fallen over, or to be elsewhere than a hand left it; () for
        none.

        What was seen since is told once.
        """
        for name in [name for name in self.put if name in self.seen and name not in self.placed]:
            put, seen = self.put.pop(name), self.seen[name]
            aside = float(np.linalg.norm(seen.translation - put.translation))
            if seen.rotation[:, 2] @ put.rotation[:, 2] < FALLEN:
                return (fact(Kind.FELL_OVER, name),)
            if aside > ASIDE_M:
                return (fact(Kind.ASIDE, name, aside),)
        return ()

    def _note(self, name: str, uncertainty: Uncertainty | None) -> None:
        self.uncertain.pop(name, None)
        if uncertainty is not None:
            self.uncertain[name] = uncertainty

    def holder(self, name: str) -> str | None:
        """The side of the hand that holds it, None for none."""
        return next((side for side, held in self.held.items() if held.object == name), None)

    def take(self, side: str, held: Held) -> None:
        """Note that the hand holds this."""
        self.put.pop(held.object, None)
        self.looked_at.discard(held.object)
        self.held[side] = held
        self.world.attach(held.object, side, held.T_grip_object)

    def let_go(self, side: str) -> None:
        """Note that the hand is empty and the object stands where the hand left it."""
        held = self.held.pop(side)
        pose = self.robot.grip(self.q, side) * held.T_grip_object
        self.seen[held.object] = pose
        self.placed[held.object], self.put[held.object] = self.time, pose
        self.looked_at.discard(held.object)
        self._note(held.object, None)
        self.world.detach(held.object, pose)

    def leave(self, name: str) -> None:
        """Note that a hand is about to leave what it let go of: what was seen of it before tells
        nothing of then.
        """
        self.placed[name] = self.time
        self.looked_at.discard(name)
        self._note(name, None)

    def lose(self, side: str) -> str:
        """Note that the hand is empty, and that nobody knows where the object is; return its
        name.
        """
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


def _apart(one: pin.SE3, other: pin.SE3) -> tuple[float, float]:
    """The turn [rad] and the shift [m] between two poses."""
    between = one.inverse() * other
    return float(np.linalg.norm(pin.log3(between.rotation))), float(
        np.linalg.norm(between.translation)
    )


def _same(one: pin.SE3, other: pin.SE3) -> bool:
    angle, shift = _apart(one, other)
    return angle < SAME_RAD and shift < SAME_M


def _framed(corners: Array, camera: pin.SE3) -> bool:
    """Whether the points (n, 3) are in the picture of the camera."""
    inside = (corners - camera.translation) @ camera.rotation
    if (inside[:, 2] < TINY).any():
        return False
    return bool((np.abs(LENS.project(inside) / (WIDTH, HEIGHT) - 0.5) < IN_PICTURE).all())


def _edge(hole: models.Opening) -> list[tuple[float, float, float]]:
    """Points on the edge of an opening, and its centre, in the thing's frame."""
    x, y, z = hole.centre
    around = (math.tau * k / EDGE_POINTS for k in range(EDGE_POINTS))
    return [
        hole.centre,
        *((x + hole.radius * math.cos(a), y + hole.radius * math.sin(a), z) for a in around),
    ]


def beginning(robot: Robot, things: dict[str, str], markers: Mapping[str, Array]) -> Situation:
    """A situation with nothing seen or held.

    `things`: the model by the id of each thing, as markers tell it; `markers`: their corners (n, 4,
    3) [m] in the thing's frame.
    """
    return Situation(robot, World(robot, margin=MARGIN_M), things, markers)


def _read(corners: Array, eye: Array) -> bool:
    """Whether a marker with these corners (4, 3) is near enough to the eye (3,) and faces it, so
    that it is read.
    """
    outwards, way = _normal(corners), eye - corners.mean(axis=0)
    far, side = float(np.linalg.norm(way)), float(np.linalg.norm(corners[1] - corners[0]))
    facing = float(outwards @ way) / (float(np.linalg.norm(outwards)) * far)
    return far <= SURE_M and facing >= FACING and LENS.focal * side * facing / far >= SURE_PX


def _inwards(corners: Array) -> bool:
    """Whether a marker (4, 3) in its thing's frame faces the z axis: it is inside a vessel."""
    return float(_normal(corners)[:2] @ corners.mean(axis=0)[:2]) < -TINY


def _normal(corners: Array) -> Array:
    """The direction (3,) that a marker with these corners (4, 3) faces, not of length 1."""
    return np.asarray(np.cross(corners[3] - corners[0], corners[1] - corners[0]))
