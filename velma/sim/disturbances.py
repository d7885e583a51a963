"""Faults of a simulated robot's senses and of its world, as plain data, and the file by which they
are ordered.

disturbed_world.py does what it says to the simulated senses and things. Only the simulator reads
the file: nobody who controls the robot is told. What stands in the file goes on; what is taken out
of it has ended. Simulated robots only.
"""

import os
import time
from enum import StrEnum
from pathlib import Path

import msgspec

from velma.names import BODY, FINGERS, HEAD, SIDES

VARIABLE = "ROCO_DISTURBANCES"
"""The variable of the environment that names the file; without it there is none."""
LOOK_S = 0.2
"""Between two looks for a new file [s, wall]; estimate: nobody orders faster."""


class Of(StrEnum):
    """Parts that a disturbance can befall."""

    WRIST = "wrist"
    CAMERA = "camera"
    ENCODER = "encoder"
    GRIP = "grip"
    JOINT = "joint"
    FINGER = "finger"
    HANDS = "hands"
    GRAINS = "grains"
    THING = "thing"


class Kind(StrEnum):
    """What befalls a part."""

    ZERO = "zero"
    STUCK = "stuck"
    NAN = "nan"
    BIAS = "bias"
    BLACK = "black"
    FROZEN = "frozen"
    DIMMED = "dimmed"
    MIRRORED = "mirrored"
    STICKS = "sticks"
    SLIPPERY = "slippery"
    HEAVY = "heavy"
    PUSHED = "pushed"
    REMOVED = "removed"
    TIPPED = "tipped"
    ADDED = "added"
    MOVED = "moved"
    PULLED = "pulled"
    KNOCKED = "knocked"


class Row(msgspec.Struct, frozen=True):
    """One kind of disturbance. `by`: its size where none is said; `unit`: of that size, "" where it
    has none; `most`: the largest one, from which on a wrong unit is meant (estimates).
    """

    by: tuple[float, ...] = ()
    unit: str = ""
    most: float = 0.0


_BIAS_N = 3.0  # estimate: six times the largest constant error of the scenes' wrist sensors
# estimate: a room at dusk; 8 of 255 levels then tell black from white fields of a marker
_DIM = 0.12
ROWS: dict[Of, dict[Kind, Row]] = {
    Of.WRIST: {
        **dict.fromkeys((Kind.ZERO, Kind.STUCK, Kind.NAN), Row()),
        Kind.BIAS: Row((_BIAS_N,), "N on each axis", 100.0),
    },
    Of.CAMERA: {
        **dict.fromkeys((Kind.BLACK, Kind.FROZEN), Row()),
        Kind.DIMMED: Row((_DIM,), "share of the light that is left", 1.0),
        Kind.MIRRORED: Row(),
    },
    # estimate: a slipped coupling
    Of.ENCODER: {Kind.BIAS: Row((0.05,), "rad", 3.0), Kind.STUCK: Row()},
    Of.GRIP: {Kind.STUCK: Row(), Kind.ZERO: Row()},
    # more than any drive has (velma.names.TORQUE)
    Of.JOINT: {Kind.STICKS: Row((500.0,), "Nm of dry friction", 1e4)},
    # as above: a finger has 1.5 Nm
    Of.FINGER: {Kind.STICKS: Row((50.0,), "Nm of dry friction", 1e4)},
    Of.HANDS: {Kind.SLIPPERY: Row()},
    # estimate: steel in place of beans
    Of.GRAINS: {Kind.HEAVY: Row((4.0,), "times as heavy", 100.0)},
    Of.THING: {
        Kind.PUSHED: Row((0.0, 0.05, 0.0), "m", 0.5),  # estimate: as far as a passing arm pushes
        Kind.REMOVED: Row(),
        Kind.TIPPED: Row((0.0, 1.0, 0.0), "direction", 10.0),
        Kind.ADDED: Row((), "m, place", 10.0),
        Kind.MOVED: Row((0.0, 0.05, 0.0), "m", 0.5),
        # estimate: away from the robot, as one takes a cup from a hand
        Kind.PULLED: Row((10.0, 0.0, 0.0), "N", 30.0),
        Kind.KNOCKED: Row((20.0, 0.0, 0.0), "N", 60.0),  # estimate: an elbow in passing
    },
}
"""What there is. A size of three numbers is a vector in the world frame."""
SENSES = (Of.WRIST, Of.CAMERA, Of.ENCODER, Of.GRIP)
FINGER_NAMES = tuple(f"{side} {finger}" for side in SIDES for finger in FINGERS)


class Disturbance(msgspec.Struct, frozen=True, omit_defaults=True, forbid_unknown_fields=True):
    """One fault. `on`: the side, joint, finger or thing that it befalls, "" for both sides; `by`:
    its size, () for that of its row. `until`: when it ends by itself [unix s]; None: when it is
    taken away.
    """

    id: str
    of: Of
    kind: Kind
    on: str = ""
    by: tuple[float, ...] = ()
    until: float | None = None

    @property
    def size(self) -> tuple[float, ...]:
        """Its size, or that of its row."""
        return self.by or ROWS[self.of][self.kind].by


ON: dict[Of, tuple[str, ...]] = {
    Of.WRIST: ("", *SIDES),
    Of.GRIP: ("", *SIDES),
    Of.ENCODER: (*BODY, *HEAD),
    Of.JOINT: BODY,
    Of.FINGER: FINGER_NAMES,
    **dict.fromkeys((Of.CAMERA, Of.HANDS, Of.GRAINS), ("",)),
}
"""What a disturbance can befall; "": all of them, or the only one. Things are known to the
scene.
"""


def wrong(one: Disturbance) -> str:
    """Return what is wrong with a disturbance and what would be right; "" where it can be done."""
    kinds = ROWS[one.of]
    if one.kind not in kinds:
        return f"{one.of} cannot be {one.kind}; it can be {', '.join(kinds)}"
    on = ON.get(one.of)
    if on is not None and one.on not in on:
        there = (
            f"there are {', '.join(filter(None, on))}"
            if any(on)
            else f"{one.of} has no parts, name none"
        )
        return f"no {one.of} at {one.on!r}; {there}"
    row = kinds[one.kind]
    if one.by and not row.unit:
        return f"{one.of} {one.kind} has no size"
    if one.by and len(one.by) != (len(row.by) or 3):
        return (
            f"{one.of} {one.kind} by {len(one.by)} numbers; it takes {len(row.by) or 3}"
            f" ({row.unit})"
        )
    if not all(abs(x) <= row.most for x in one.by):
        return (
            f"{one.of} {one.kind} by {', '.join(f'{x:g}' for x in one.by)}; at most {row.most:g}"
            f" ({row.unit})"
        )
    return ""


def encoded(going_on: tuple[Disturbance, ...]) -> bytes:
    """Return what the file has while this goes on."""
    return msgspec.json.encode(going_on)


def decoded(data: bytes) -> tuple[Disturbance, ...]:
    """Return what stands in a file; () for one that cannot be read."""
    try:
        return msgspec.json.decode(data, type=tuple[Disturbance, ...])
    except msgspec.MsgspecError:
        return ()


def write(path: Path, going_on: tuple[Disturbance, ...]) -> None:
    """Replace the file at once: a reader finds the old one or the new one."""
    fresh = path.with_name(f".{path.name}.{os.getpid()}")
    fresh.write_bytes(encoded(going_on))
    fresh.replace(path)


def read(path: Path) -> tuple[Disturbance, ...]:
    """Return what stands in the file; () where there is none, or one that cannot be read."""
    try:
        return decoded(path.read_bytes())
    except OSError:
        return ()


class Orders:
    """The file as the simulator looks at it. `going_on`: what has been ordered and has not ended.

    A look is one call of the system at most every LOOK_S, none without a file's name: it may be
    made in every cycle.
    """

    def __init__(self, path: Path | None) -> None:
        self._path, self._next = path, 0.0
        self._seen: tuple[int, int] | None = None
        self.going_on: tuple[Disturbance, ...] = ()

    @classmethod
    def named(cls) -> "Orders":
        """Return those of the file that the environment names."""
        return cls(Path(name) if (name := os.environ.get(VARIABLE, "")) else None)

    def changed(self) -> bool:
        """Look, where it is time; whether something has begun or ended since."""
        if self._path is None or (now := time.monotonic()) < self._next:
            return False
        self._next = now + LOOK_S
        return self.look()

    def look(self) -> bool:
        """Look now; whether something has begun or ended since."""
        if self._path is None:
            return False
        try:
            found = self._path.stat()
            stamp = (found.st_ino, found.st_mtime_ns)
        except OSError:
            stamp = None
        ordered = self.going_on if stamp == self._seen else read(self._path) if stamp else ()
        now, self._seen = time.time(), stamp
        before = self.going_on
        self.going_on = tuple(one for one in ordered if not (one.until and one.until < now))
        return self.going_on != before
