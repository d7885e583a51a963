"""What the numbers of a motion may be. Outside its range a number is refused, with its field and
the range.

The types give ranges: msgspec checks them wherever bytes become a record, and `checked` where a
record is made here. NaN and infinity are in no range. Joints have ranges of their own: `joints`
checks whole paths.
"""

import re
from typing import Annotated, Any, TypeVar

import msgspec
import numpy as np
from msgspec import Meta

from velma.errors import MotionError
from velma.names import (
    BODY,
    FINGER_UPPER,
    HEAD_LOWER,
    HEAD_UPPER,
    LOWER,
    SPREAD_UPPER,
    UPPER,
    Array,
)

# m/s of a grip; estimates: a quarter of the slowest motion, 6 times the fastest
SLOWEST_TOOL, FASTEST_TOOL = 0.01, 2.0
# rad/s of fingers and head; estimates: a finger then opens in 25 s
SLOWEST_JOINT, FASTEST_JOINT = 0.1, 10.0
# of a timed path; its knots fit the slot of the loop (services/executor/loop/link.py)
LONGEST_S = 300.0

Bend = Annotated[float, Meta(ge=0.0, le=FINGER_UPPER)]  # rad
Spread = Annotated[float, Meta(ge=0.0, le=SPREAD_UPPER)]  # rad
Pan = Annotated[float, Meta(ge=float(HEAD_LOWER[0]), le=float(HEAD_UPPER[0]))]  # rad
Tilt = Annotated[float, Meta(ge=float(HEAD_LOWER[1]), le=float(HEAD_UPPER[1]))]  # rad
JointSpeed = Annotated[float, Meta(ge=SLOWEST_JOINT, le=FASTEST_JOINT)]  # rad/s
# Estimates from here on: a wrong unit is found, not every wrong number.
MOST_KG = 10.0
Kilograms = Annotated[float, Meta(ge=0.0, le=MOST_KG)]
Metres = Annotated[float, Meta(ge=0.0, le=10.0)]
MOST_LEVER_M = 1.0
Lever = Annotated[float, Meta(ge=-MOST_LEVER_M, le=MOST_LEVER_M)]
Seconds = Annotated[float, Meta(ge=0.0, le=60.0)]  # of a rest
Effort = Annotated[float, Meta(ge=0.0, le=100.0)]  # Nm
Newtons = Annotated[float, Meta(ge=1.0, le=100.0)]
Stiffness = Annotated[float, Meta(ge=0.0, le=1e4)]  # N/m, Nm/rad
Viscosity = Annotated[float, Meta(ge=0.0, le=1e3)]  # Nms/rad
DampingRatio = Annotated[float, Meta(ge=0.05, le=5.0)]
Cycles = Annotated[int, Meta(ge=1, le=500)]

Record = TypeVar("Record", bound=msgspec.Struct)


def checked(record: Record) -> Record:
    """Return the record with every field as its type says. Raises MotionError with the first one
    that is not.
    """
    try:
        # also of numbers of numpy
        plain = msgspec.to_builtins(record, builtin_types=(bytes,), enc_hook=float)
        return msgspec.convert(plain, type(record))
    except msgspec.ValidationError as error:
        expected, _, path = str(error).partition(" - at `$.")
        field = path.removesuffix("`")
        raise MotionError(
            field, _value(record, field), expected.removeprefix("Expected ")
        ) from None
    except TypeError as error:  # such as an array in the place of a number
        raise MotionError(type(record).__name__, "of no plain values", str(error)) from None


def _value(record: Any, field: str) -> Any:
    """Return what is in a field such as `left.fingers[2]`."""
    for part in re.findall(r"\w+", field):
        record = record[int(part)] if part.isdigit() else getattr(record, part, "absent")
    return record


def number(field: str, value: float, least: float, most: float) -> float:
    """Return the number. Raises MotionError if it is outside its range."""
    if not least <= value <= most:
        raise MotionError(field, value, f"a number from {least:g} to {most:g}")
    return value


def joints(field: str, path: Any, *, start: Array | None = None, slack: float = 0.0) -> Array:
    """Return a joint path as array (n, 15) [rad], n > 0. Raises MotionError if it is none or leaves
    the joints' limits.

    It may leave them by `slack` [rad]. A joint that is beyond its limit at `start` (15,), None: at
    the first point, may stay there, and goes no farther beyond.
    """
    try:
        points = np.asarray(path, dtype=np.float64)
    except (TypeError, ValueError) as error:  # of points of different lengths
        raise MotionError(field, error, f"n x {len(BODY)} joint positions") from None
    if points.ndim != 2 or points.shape[1] != len(BODY) or not len(points):
        expected = f"n x {len(BODY)} joint positions, at least one posture"
        raise MotionError(field, f"of shape {points.shape}", expected)
    low, high = points.min(axis=0), points.max(axis=0)  # NaN if one of them is
    least, most = LOWER - slack, UPPER + slack
    begin = points[0] if start is None else start
    least, most = np.fmin(least, begin), np.fmax(most, begin)
    wrong = ~((low >= least) & (high <= most) & np.isfinite(low) & np.isfinite(high))
    if wrong.any():
        k = int(np.argmax(wrong))
        found = high[k] if low[k] >= least[k] and np.isfinite(low[k]) else low[k]
        raise MotionError(
            f"{field}: {BODY[k]}", f"{found:.4g} rad", f"from {least[k]:.4g} to {most[k]:.4g}"
        )
    return points
