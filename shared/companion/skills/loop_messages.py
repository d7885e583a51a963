"""Messages between the agent of ex and its control loop: motions in, reports out.

A motion is a whole timed joint trajectory with the goals of head and hands and the rule that ends
it, so set-points need not be streamed at 500 Hz. All of it is msgpack; the knots travel as bytes.
Knows no FIPA and no simulator.
"""

from enum import StrEnum
from typing import Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from companion.languages.facts import Facts, Kind, fact
from velma import ranges
from velma.errors import MotionError
from velma.names import BODY, START
from velma.ranges import (
    Bend,
    Effort,
    JointSpeed,
    Kilograms,
    Lever,
    Metres,
    Newtons,
    Pan,
    Seconds,
    Spread,
    Tilt,
)

Array = NDArray[np.float64]

SPLINE_SLACK = 0.02  # rad: a timed path is beside the lines between its points by less (its tests)
FAULT: Facts = (fact(Kind.FAULT),)
KNOT_S = 0.01  # between two knots; linear interpolation is smooth enough for a hand at 0.35 m/s


class Keep(msgspec.Struct, frozen=True, tag=True):
    """The hand stays as it is."""


class Move(msgspec.Struct, frozen=True, tag=True):
    """Move the unlocked fingers one, two, three to angles [rad] at a speed [rad/s], and the spread
    to its angle.
    """

    fingers: tuple[Bend, Bend, Bend]
    speed: JointSpeed = 1.0
    spread: Spread = 0.0


class Close(msgspec.Struct, frozen=True, tag=True):
    """Close each finger until it touches; if all do, squeeze with all by `squeeze` [rad] and lock
    them.

    `effort` [Nm] counts as touch; `upto` [rad] is where a finger stops that meets nothing. Squeeze
    0.8 deg for a rim, 40 deg for a jar against the palm (estimates from grasping runs: the rim
    turns from 2 deg on).
    """

    squeeze: Bend
    upto: Bend = 2.3
    speed: JointSpeed = 0.3
    effort: Effort = 0.12
    settle_s: Seconds = 0.3
    lock: bool = True


class Open(msgspec.Struct, frozen=True, tag=True):
    """Unlock the fingers and open them by an angle [rad], slowly, so that the object does not
    jump.
    """

    by: Bend = 0.105
    speed: JointSpeed = 0.15


HandCommand = Keep | Move | Close | Open


class HeadGoal(msgspec.Struct, frozen=True):
    """Pan and tilt [rad], reached at a speed [rad/s]. VS: look-at uses 0.5."""

    pan: Pan
    tilt: Tilt
    speed: JointSpeed = 0.5


class Payload(msgspec.Struct, frozen=True):
    """The load of a hand: mass [kg], and its centre [m] in the grip frame. Mass 0: nothing.

    `content`: mass [kg] that may be in it besides, and leave it.
    """

    mass: Kilograms = 0.0
    lever: tuple[Lever, Lever, Lever] = (0.0, 0.0, 0.0)
    content: Kilograms = 0.0


class Until(StrEnum):
    """The rule that ends a motion."""

    END = "end"  # its last knot
    CONTACT = "contact"  # something stops a hand on its way down
    TOUCH = "touch"  # the closing hands are closed
    PULL = "pull"  # somebody pulls at what a hand holds out


class Motion(msgspec.Struct, frozen=True, tag=True):
    """A motion of the whole body.

    `knots` are joint positions (n, 15) as float64 bytes, `KNOT_S` apart; the first is near the
    present set-point. Payload None: no change. The tolerance is a hand's largest distance from its
    path [m]; `contact_m` is how much further than at the start the set-point of the hand
    `contact_side` must be below the hand to count as contact. `tare`: side of the hand that is
    empty, at rest and free at the start, so that its wrist feels its own weight only.
    `look_every_s`: the first look at the motion under way is due after so long [s, simulated]; 0:
    nobody looks. Until PULL, it ends when what the hand `pull_side` holds has been pulled away from
    the robot with more than `pull_n` [N] for `pull_s` [s], or at its end: it waits for `settle_s`.
    That hand is not watched for what slips meanwhile.
    """

    key: str
    knots: bytes
    head: HeadGoal | None = None
    right: HandCommand = Keep()
    left: HandCommand = Keep()
    payload_right: Payload | None = None
    payload_left: Payload | None = None
    until: Until = Until.END
    contact_side: Literal["right", "left"] = "right"
    contact_m: Metres = 0.003
    settle_s: Seconds = 0.0
    tolerance_m: Metres = 0.1
    tare: Literal["", "right", "left"] = ""
    look_every_s: Seconds = 0.0
    pull_side: Literal["right", "left"] = "right"
    pull_n: Newtons = 5.0
    pull_s: Seconds = 0.3

    def path(self) -> Array:
        """The knots (n, 15) [rad], read-only."""
        return np.frombuffer(self.knots, dtype=np.float64).reshape(-1, len(BODY))

    def hands(self) -> tuple[HandCommand, HandCommand]:
        """The commands by row: right, left."""
        return self.right, self.left

    def payloads(self) -> tuple[Payload | None, Payload | None]:
        """The payloads by row: right, left."""
        return self.payload_right, self.payload_left


class Cancel(msgspec.Struct, frozen=True, tag=True):
    """End the motion with this key smoothly; any other one goes on. None: end whichever runs."""

    key: str | None


class LookAgain(msgspec.Struct, frozen=True, tag=True):
    """The answer to a look at the motion with this key: it goes on, the next look is due after
    `in_s` [s, simulated].

    Counted from when the last one was due.
    """

    key: str
    in_s: Seconds


class Release(msgspec.Struct, frozen=True, tag=True):
    """Leave the held stop when its dwell time is over."""


class Mode(StrEnum):
    """The law that moves the joints."""

    MOTION = "motion"  # Cartesian impedance: a motion, or its last set-point
    DAMPING = "damping"  # after a fault
    HOLD = "hold"  # joint impedance, after damping
    STOPPED = "stopped"  # joint impedance, because a person asked for it


class Phase(StrEnum):
    """The state of a motion."""

    IDLE = "idle"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    INTERRUPTED = "interrupted"  # no agent or no loop any more: the machine ended it, not the world
    CANCELLED = "cancelled"
    LOST = "lost"  # a hand lost what it held
    SLIPPED = "slipped"  # what a hand holds slipped in it
    BLOCKED = "blocked"  # a hand was beside its path: it met something


class GripReport(msgspec.Struct, frozen=True):
    """Feeling of a hand's wrist: a velma.control.grip.Grip ("": empty hand or no sensor), the mass
    in the hand [kg].

    The mass is that of the last 0.5 s: at rest for a second, it is a weight. `wrong`: a
    velma.control.grip.Wrong of the sensor, "" for nothing; such a one feels nothing. `pull`: of the
    steady pull that ended the motion [N], 0 for none.
    """

    felt: str = ""
    mass: float = 0.0
    wrong: str = ""
    pull: float = 0.0


class HandReport(msgspec.Struct, frozen=True):
    """State of a hand: which fingers touched while closing, their joints [rad], whether they are
    locked, its grip.
    """

    touched: tuple[bool, bool, bool] = (False, False, False)
    proximal: tuple[float, float, float] = (0.0, 0.0, 0.0)
    distal: tuple[float, float, float] = (0.0, 0.0, 0.0)
    locked: bool = False
    grip: GripReport = GripReport()


class Report(msgspec.Struct, frozen=True):
    """The outcome of a motion so far, with its simulated time and the largest distance of each hand
    from its path.
    """

    key: str = ""
    phase: Phase = Phase.IDLE
    why: Facts = ()
    ended_by: Until | None = None
    time_s: float = 0.0
    right: HandReport = HandReport()
    left: HandReport = HandReport()
    largest_error_m: tuple[float, float] = (0.0, 0.0)

    def hand(self, side: str) -> HandReport:
        return self.right if side == "right" else self.left


class Refusal(msgspec.Struct, frozen=True):
    """Why the loop does not take a command; `text`: the same for a log."""

    why: Facts
    text: str


def refusal(error: MotionError) -> Refusal:
    """Why a motion cannot be made."""
    return Refusal((fact(Kind.MOTION_REFUSED, error.field),), str(error))


def motion(key: str, q: Array, **options: Any) -> Motion:
    """A motion along knots `q` (n, 15), or at rest in a posture (15,). Options are the fields of
    Motion.

    Raises MotionError.
    """
    knots = np.ascontiguousarray(np.atleast_2d(np.asarray(q, dtype=np.float64)))
    return checked(Motion(key, knots.tobytes(), **options))


def checked(asked: Motion) -> Motion:
    """The motion if a loop can follow it. Raises MotionError with the field and what is allowed."""
    asked, width = ranges.checked(asked), len(BODY) * START.itemsize
    if not asked.knots or len(asked.knots) % width:
        raise MotionError(
            "knots", f"{len(asked.knots)} bytes", f"n x 15 float64, a multiple of {width} bytes"
        )
    followed(asked)
    if asked.until is Until.TOUCH and not any(isinstance(hand, Close) for hand in asked.hands()):
        raise MotionError("until", "touch with no hand closing", "a Close for at least one hand")
    return asked


def followed(asked: Motion, told: Array | None = None) -> None:
    """Raise MotionError if a joint goes beyond its limit, or farther beyond than at `told` (15,),
    None: its begin.
    """
    ranges.joints("knots", asked.path(), start=told, slack=SPLINE_SLACK)
