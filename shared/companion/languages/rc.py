"""RC, the language of robot commands on channel C5 (ta asks, ex acts) and of their outcomes.

The paper names no language for C5; this one is ours. A command is one skill. Its key names the act
(plan id and step), so that an act is never begun twice. Free motions carry joint paths planned by
pl; the other skills carry what is wanted in the object's frame, and ex solves the joints again from
its newest observation.

Here are the acts that several tasks share; the act of one task is in its room (companion.tasks,
part `done`). All of them, with what must be true after each, are in companion.acts.
"""

import math
from enum import StrEnum
from typing import Annotated

import msgspec

from companion.languages.evidence import Evidence
from companion.languages.facts import Facts
from companion.languages.rs import Seen
from companion.languages.values import BodyPosture, Pose, Side, Vector, Within

# What numbers may be; ex refuses others. As in velma.ranges, which has the sources (a test compares
# them).
Angle = Annotated[float, Within(-math.tau, math.tau)]  # rad
Bend = Annotated[float, Within(0.0, 2.443389)]  # rad, of a finger
ToolSpeed = Annotated[float, Within(0.01, 2.0)]  # m/s
FingerSpeed = Annotated[float, Within(0.1, 10.0)]  # rad/s
Kilograms = Annotated[float, Within(0.0, 10.0)]
Rest = Annotated[float, Within(0.0, 60.0)]  # s


class Command(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True):
    """One skill of ex. `key` is unique for an act of a plan."""

    key: str


class MoveJoint(Command, frozen=True):
    """Move the torso and one arm along a joint path; the other arm keeps its joints.

    `path`: points of 8 joint positions [rad], torso first. `speed`: limit of the tool [m/s].
    `fingers`: angle [rad] the moving hand takes at the start of the motion, or None to leave it as
    it is (always None while it holds something).
    """

    side: Side
    path: tuple[tuple[float, ...], ...]
    speed: ToolSpeed
    fingers: Bend | None = None


class Segment(msgspec.Struct, frozen=True):
    """A straight motion of the grip frame: offset in the world frame [m], speed [m/s]."""

    offset: Vector
    speed: ToolSpeed


class MoveCartesian(Command, frozen=True):
    """Move the grip frame straight, with its orientation kept and the torso still: lift, pull
    out.
    """

    side: Side
    segments: tuple[Segment, ...]


class ApproachPoint(msgspec.Struct, frozen=True):
    """A grip pose (see the command for its frame) and the finger angle [rad] to have there."""

    at: Pose
    fingers: Bend


class Grasp(Command, frozen=True):
    """Approach an object through `approach`, close until touch, squeeze, lock.

    `approach`: in the object's frame, outermost first, the grasp last. `squeeze`: motor travel
    after touch [rad]. `speed`: at which the fingers close [rad/s]. `mass`: what the hand will carry
    [kg], fed forward from the lock on.
    """

    side: Side
    object: str
    grasp: str
    approach: tuple[ApproachPoint, ...]
    squeeze: Bend
    speed: FingerSpeed
    mass: Kilograms


class Release(Command, frozen=True, omit_defaults=True):
    """Put a held object down at `place` (its wanted pose in the world) until contact, open,
    retreat.

    `retreat`: grip poses seen from the grip that lets go, nearest first. `surface`: what it is put
    on. Where the hand is not yet above the place, ex plans the way there itself; `place` None lets
    ex choose a free spot of the surface. `way`: offsets from the place [m, world frame] through
    which the object comes, the last one above the place; none: straight down from where every
    object comes down.
    """

    side: Side
    object: str
    surface: str
    place: Pose | None
    retreat: tuple[ApproachPoint, ...]
    way: tuple[Vector, ...] = ()


class Look(Command, frozen=True, omit_defaults=True):
    """Turn the head to each point in turn [m, world frame] and report what is seen from there.

    `put`: a thing that a hand has put there, which the look is to confirm; "" for none.
    """

    at: tuple[Vector, ...]
    put: str = ""


class Home(Command, frozen=True):
    """Bring one arm, with an empty hand, back to its start posture by a way ex plans itself."""

    side: Side


class Sensor(StrEnum):
    """What the robot senses with."""

    RIGHT_WRIST = "right-wrist"
    LEFT_WRIST = "left-wrist"
    CAMERA = "camera"
    NECK = "neck"  # the encoders between the room and the camera: torso and head
    RIGHT_ARM = "right-arm"  # its encoders
    LEFT_ARM = "left-arm"


class Fault(StrEnum):
    """What is wrong with a sense. As in velma.control.grip and velma.eyes.health (a test compares
    them).
    """

    NO_NUMBER = "no-number"
    ZERO = "zero"
    STUCK = "stuck"  # the same while the hand turns
    FROZEN = "frozen"  # the same picture again
    DARK = "dark"
    UNIFORM = "uniform"  # of one brightness
    MIRRORED = "mirrored"
    BLIND = "blind"  # nothing is seen of what must be in view
    OFF = "off"  # what does not move is seen to have turned


class Ill(msgspec.Struct, frozen=True):
    """A faulty sensor, and its fault. `off`: error of encoders [rad]."""

    sense: Sensor
    fault: Fault
    off: float = 0.0


class Done(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True):
    """An act ended as wanted: what was seen at its end, the posture, what each hand holds (object,
    T_grip_object).

    `weighed`: mass in the hand before and after a pour, felt in the same posture [kg]; None: not
    felt. `placed`: things where a hand let go of them, not seen since. `arrived`: whether what left
    the source of a pour is in the destination, by a look into it; None: not looked into. `missing`:
    things that were looked for and are not where they should be, though nothing hides the place.
    `ill`: faulty sensors. `evidence`: for each check of the act, which senses told that it is true.
    """

    key: str
    body: BodyPosture
    seen: tuple[Seen, ...] = ()
    held: dict[Side, tuple[str, str, Pose]] = {}
    sim_time: float = 0.0
    weighed: tuple[float, float] | None = None
    placed: tuple[Seen, ...] = ()
    arrived: bool | None = None
    missing: tuple[str, ...] = ()
    ill: tuple[Ill, ...] = ()
    evidence: tuple[Evidence, ...] = ()


class NotDoneKind(StrEnum):
    """Reason why an act was not done, to decide what comes next."""

    REFUSED = "refused"
    BUSY = "busy"
    FAILED = "failed"
    REPLAN = "replan"  # the world is not as planned
    LOST = "lost"  # a hand lost what it held
    SLIPPED = "slipped"  # what a hand holds slipped in it
    EMPTY = "empty"  # the hand does not hold what it should
    MISSING = "missing"  # a thing is not where it should be
    BLOCKED = "blocked"  # a hand was beside its path: it met something
    CANCELLED = "cancelled"
    # the machine was too slow, or a process died while the robot stood still
    INTERRUPTED = "interrupted"
    UNKNOWN = "unknown"  # a process died while the robot moved
    NEW_WORLD = "new-world"  # the simulated world was lost: nothing that was known of it is so


class NotDone(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True):
    """An act ended otherwise. `kind`: a NotDoneKind; `lost`: what is in no hand any more.

    `placed`, `missing`, `ill`: as of Done.
    """

    key: str
    kind: str
    why: Facts
    body: BodyPosture | None = None
    seen: tuple[Seen, ...] = ()
    held: dict[Side, tuple[str, str, Pose]] = {}
    sim_time: float = 0.0
    lost: dict[Side, str] = {}
    placed: tuple[Seen, ...] = ()
    missing: tuple[str, ...] = ()
    ill: tuple[Ill, ...] = ()


class Accepted(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True):
    """The act is taken; it is expected to last this long [s, simulated]."""

    key: str
    duration: float
