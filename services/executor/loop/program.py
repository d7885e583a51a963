"""The words between the executor's agent and its control loop: motions in, reports out.

A motion is a whole timed joint trajectory with what head and hands do meanwhile and the rule that ends it, so nobody
streams set-points at 500 Hz. All of it is msgpack; the knots travel as bytes. Knows no FIPA and no simulator.
"""

from enum import StrEnum

import msgspec
import numpy as np
from numpy.typing import NDArray

from velma.errors import MotionError
from velma.names import BODY, SIDES, START

Array = NDArray[np.float64]

KNOT_S = 0.01  # between two knots; linear between them is smooth enough for a hand at 0.35 m/s


class Keep(msgspec.Struct, frozen=True, tag=True):
    """The hand stays as it is."""


class Move(msgspec.Struct, frozen=True, tag=True):
    """Unlocked fingers one, two, three go to angles [rad] at a speed [rad/s]; the spread to its own."""

    fingers: tuple[float, float, float]
    speed: float = 1.0
    spread: float = 0.0


class Close(msgspec.Struct, frozen=True, tag=True):
    """Each finger closes by itself until it touches, then all squeeze by `squeeze` [rad] and are locked.

    `effort` [Nm] is what counts as touch, `upto` [rad] where a finger that meets nothing stops. For a rim 0.8 deg of
    squeeze, for a jar against the palm 40 deg (estimates from grasping runs: the rim turns from 2 deg on).
    """

    squeeze: float
    upto: float = 2.3
    speed: float = 0.3
    effort: float = 0.12
    settle_s: float = 0.3
    lock: bool = True


class Open(msgspec.Struct, frozen=True, tag=True):
    """Unlock the fingers and open them by an angle [rad], slowly, so that what they hold is set down, not flicked."""

    by: float = 0.105
    speed: float = 0.15


HandCommand = Keep | Move | Close | Open


class HeadGoal(msgspec.Struct, frozen=True):
    """Pan and tilt [rad], reached at a speed [rad/s]. VS: look-at uses 0.5."""

    pan: float
    tilt: float
    speed: float = 0.5


class Payload(msgspec.Struct, frozen=True):
    """What a hand carries: mass [kg], and its centre [m] in the grip frame. Mass 0: nothing."""

    mass: float = 0.0
    lever: tuple[float, float, float] = (0.0, 0.0, 0.0)


class Until(StrEnum):
    """What ends a motion."""

    END = "end"  # its last knot
    CONTACT = "contact"  # a hand on its way down is held up
    TOUCH = "touch"  # the closing hands are closed


class Motion(msgspec.Struct, frozen=True, tag=True):
    """A motion of the whole body.

    `knots` are joint positions (n, 15) as float64 bytes, `KNOT_S` apart; the first is where the body is told to be now.
    Payload None leaves it as it was. The tolerance is a hand's largest distance from its path [m]; `contact_m` is how
    much further than at the start the set-point of the hand `contact_side` must be below the hand to count as contact.
    """

    key: str
    knots: bytes
    head: HeadGoal | None = None
    right: HandCommand = Keep()
    left: HandCommand = Keep()
    payload_right: Payload | None = None
    payload_left: Payload | None = None
    until: Until = Until.END
    contact_side: str = "right"
    contact_m: float = 0.003
    settle_s: float = 0.0
    tolerance_m: float = 0.1

    def path(self) -> Array:
        """The knots, (n, 15), read-only."""
        return np.frombuffer(self.knots, dtype=np.float64).reshape(-1, len(BODY))

    def hands(self) -> tuple[HandCommand, HandCommand]:
        """Commands by row: right, left."""
        return self.right, self.left

    def payloads(self) -> tuple[Payload | None, Payload | None]:
        """Payloads by row: right, left."""
        return self.payload_right, self.payload_left


class Cancel(msgspec.Struct, frozen=True, tag=True):
    """End the motion of this key smoothly; another one is left alone."""

    key: str


class Release(msgspec.Struct, frozen=True, tag=True):
    """Leave the held stop: granted when it has lasted its dwell time."""


class Mode(StrEnum):
    """Which law moves the joints."""

    MOTION = "motion"  # Cartesian impedance: a motion, or its last set-point
    DAMPING = "damping"  # after a fault
    HOLD = "hold"  # joint impedance, after damping
    STOPPED = "stopped"  # joint impedance, because a person asked for it


class Phase(StrEnum):
    """What became of a motion."""

    IDLE = "idle"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    INTERRUPTED = "interrupted"  # nobody commanded any more: the machine ended it, not the world
    CANCELLED = "cancelled"


class HandReport(msgspec.Struct, frozen=True):
    """A hand: which fingers touched while closing, their joints [rad], and whether they are locked."""

    touched: tuple[bool, bool, bool] = (False, False, False)
    proximal: tuple[float, float, float] = (0.0, 0.0, 0.0)
    distal: tuple[float, float, float] = (0.0, 0.0, 0.0)
    locked: bool = False


class Report(msgspec.Struct, frozen=True):
    """A motion's outcome so far: in words, in simulated seconds, and the largest distance of a hand from its path."""

    key: str = ""
    phase: Phase = Phase.IDLE
    reason: str = ""
    ended_by: Until | None = None
    time_s: float = 0.0
    right: HandReport = HandReport()
    left: HandReport = HandReport()
    largest_error_m: tuple[float, float] = (0.0, 0.0)

    def hand(self, side: str) -> HandReport:
        """The report of one hand."""
        return self.right if side == "right" else self.left


Result = Report


def motion(key: str, q: Array, **options: object) -> Motion:
    """A motion along the knots `q` (n, 15) or, standing still, at one posture (15,). Options are Motion's fields."""
    knots = np.ascontiguousarray(np.atleast_2d(np.asarray(q, dtype=np.float64)))
    return checked(msgspec.convert({"key": key, "knots": knots.tobytes(), **options}, Motion, from_attributes=True))


def checked(asked: Motion) -> Motion:
    """The motion itself, if the loop can follow it. Raises MotionError naming the field."""
    width = len(BODY) * START.itemsize
    if not asked.knots or len(asked.knots) % width:
        raise MotionError("knots", f"{len(asked.knots)} bytes", f"n x 15 float64, a multiple of {width} bytes")
    if not np.isfinite(asked.path()).all():
        raise MotionError("knots", "not finite", "finite joint positions in rad")
    if asked.contact_side not in SIDES:
        raise MotionError("contact_side", repr(asked.contact_side), f"one of {SIDES}")
    if asked.until is Until.TOUCH and not any(isinstance(hand, Close) for hand in asked.hands()):
        raise MotionError("until", "touch with no hand closing", "a Close for at least one hand")
    for name in ("settle_s", "tolerance_m", "contact_m"):
        if not getattr(asked, name) >= 0.0:
            raise MotionError(name, getattr(asked, name), "a number that is not negative")
    return asked
