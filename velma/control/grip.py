"""The thing in a hand, felt at the wrist: its mass, and the force that no held mass explains.

    e = R^T (a - g)                      apparent gravity at a point c of the hand, axes of the hand
    m = F.e / |e|^2 - M                  mass in the hand; F: force of the arm on the hand of mass M
    r = | F - (M + clip(m, low, high)) e |

While the hand holds a mass between low and high, r is the error of the sensors, whatever the arm
does; a thing that slips shows in r at once, in m later. `a` is the second difference of c from the
measured joints. F and a pass the same filters, or their lags would differ. Sides are rows: 0 right,
1 left. The numbers were measured in simulated pours (36 slips, 6 grips): warned within 60 ms, lost
within 0.2 s (0.6 s while tilted), no false alarm.
"""

import math
from collections.abc import Callable, Sequence
from enum import StrEnum
from typing import Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from velma.compiled import library
from velma.control.cartesian import GRAVITY, CartesianGains, Record

Array = NDArray[np.float64]

HAND_KG = 1.2421  # below the sensor: sum of robot.yaml (a test adds it up)
# VR: the left palm is turned by half a turn
SENSOR_TO_GRIP = np.array([[1.0, 1.0, 1.0], [-1.0, -1.0, 1.0]])
# c along z of the grip: 0.105 m before the sensor, the least error of the hand's mass centre in
# motion
POINT_M = -0.02
CUTOFF_HZ, WINDOW = 12.0, 25  # of each of two low-passes; samples of the mean after them: 50 ms
# N; normal maxima of r: jar 0.17, bowl 0.05, with noise of 0.3 N 0.26; a bowl that was turned by 45
# deg 0.52 (seed 10)
ARM_N, WARN_N = 0.2, 0.6
# s, time constant of the weight: settled to 0.1 % after 1 s at rest, noise of 0.1 N is 1 g
LOAD_S = 0.15
CALM_CYCLES, LIGHT_CYCLES = 25, 50  # 50, 100 ms
WARN_CYCLES = 5  # 10 ms: no single reading
# 20 ms: no true reading is the same for so long in motion; 0.5 s (estimates)
STUCK_CYCLES, WELL_CYCLES = 10, 250
OVER_CYCLES = 250  # 0.5 s: longer than a jar takes to slide out of a tilted hand (0.44 s, measured)


_WRISTS = {
    "wrist": (2, 6), "rotation": (2, 3, 3), "position": (2, 3),
    "sign": (2, 3), "up": (3,), "rate": (1,), "gain": (1,), "point": (1,),
    "cycle": (1,), "first": (2, 2, 3), "second": (2, 2, 3), "window": (WINDOW, 2, 2, 3),
    "points": (2, 2, 3),
    "before": (2, 3, 3), "felt": (2, 2, 3),
}  # fmt: skip
"""As in wrists.c of velma.compiled: what is read, constants, what is kept from cycle to cycle, what
is felt.
"""


class Wrists:
    """Filtered readings of both wrists; call `feel` once a cycle. `record`: all that it keeps."""

    def __init__(self, period_s: float, record: Record | None = None) -> None:
        self._period_s, self.record = period_s, record or Record(_WRISTS)
        self._part = self.record.part
        self._set_constants()
        built = library()
        self._feel = None if built is None else built.wrists_feel

    def __reduce__(self) -> tuple[Any, ...]:
        return Wrists, (self._period_s, self.record)

    def _set_constants(self) -> None:
        part = self._part
        part["sign"][:] = SENSOR_TO_GRIP
        part["up"][:] = (0.0, 0.0, GRAVITY)
        part["point"][:] = POINT_M
        part["rate"][:] = 1.0 / (self._period_s * self._period_s)
        part["gain"][:] = 1.0 - math.exp(-2.0 * math.pi * CUTOFF_HZ * self._period_s)

    def take(self, saved: bytes) -> None:
        """Take what was kept in the bytes of another record, not its constants."""
        self.record.take(saved)
        self._set_constants()

    def restart(self) -> None:
        """Forget the past: cycles were left out."""
        self._part["cycle"][:] = 0.0

    @property
    def settled(self) -> bool:
        """Whether the filters have heard enough since the start."""
        return bool(self._part["cycle"][0] > 2 * WINDOW)

    def feel(self, wrist: Array, rotation: Array, position: Array) -> Array:
        """Return force F and apparent gravity e of each hand in grip axes: (2, 2, 3), F and e in
        the second axis.

        `wrist` (2, 6): the reading, of the cycle before; `rotation` (2, 3, 3), `position` (2, 3):
        T_world_grip now.
        """
        part = self._part
        part["wrist"][:], part["rotation"][:], part["position"][:] = wrist, rotation, position
        if self._feel is not None:
            self._feel(self.record.at)
        else:
            self._plain(int(part["cycle"][0]))
        return part["felt"].copy()

    def _plain(self, cycle: int) -> None:
        """Compute what wrists.c does."""
        part, rotation, points = self._part, self._part["rotation"], self._part["points"]
        first, second, window = part["first"], part["second"], part["window"]
        point = part["position"] + part["point"] * rotation[:, :, 2]
        if cycle == 0:
            points[:], part["before"][:] = point, rotation
        x = np.empty((2, 2, 3))
        # Rows times R^T are R times columns: from grip axes to world axes, as the hand was when its
        # force was felt.
        x[:, :1] = (part["wrist"][:, :3] * part["sign"])[:, None] @ part["before"].transpose(
            0, 2, 1
        )
        x[:, 1] = (point - 2.0 * points[0] + points[1]) * part["rate"] + part["up"]
        points[1], points[0], part["before"][:] = points[0], point, rotation
        if cycle < 3:
            x[:, 1] = part["up"]  # no second difference yet
            first[:], second[:] = x, x
        first += part["gain"] * (x - first)
        second += part["gain"] * (first - second)
        window[cycle % WINDOW] = second @ rotation
        if cycle < WINDOW:
            window[cycle + 1 :] = window[cycle]
        part["felt"][:] = np.add.reduce(window, 0) / WINDOW
        part["cycle"] += 1.0


class Wrong(StrEnum):
    """Reason why a wrist's readings cannot be true."""

    NO_NUMBER = "no-number"
    ZERO = "zero"
    STUCK = "stuck"  # the same while the hand turns


class Health:
    """Whether the readings of a wrist may be true: they are numbers, hold the weight of the hand,
    and change as the hand turns.

    `wrong`: why they may not, "" where nothing is known against them.
    """

    def __init__(self) -> None:
        self.wrong: Wrong | Literal[""] = ""
        self._reading, self._rotation, self._stuck, self._well = [math.nan], [math.nan], 0, 0

    def judge(self, reading: list[float], rotation: list[float]) -> bool:
        """Take the reading (6,) and the rotation (9,) of the hand in a cycle; whether this reading
        may be true.

        What was wrong is so until nothing has been for a while.
        """
        changed, turned = reading != self._reading, rotation != self._rotation
        self._reading, self._rotation = reading, rotation
        self._stuck = 0 if changed else self._stuck + turned
        wrong: Wrong | Literal[""] = ""
        if not all(map(math.isfinite, reading)):
            wrong = Wrong.NO_NUMBER
        elif not any(reading):
            wrong = Wrong.ZERO
        elif self._stuck >= STUCK_CYCLES:
            wrong = Wrong.STUCK
        self._well = 0 if wrong else self._well + 1
        if wrong or self._well >= WELL_CYCLES:
            self.wrong = wrong
        return not wrong


def tare(force: Array, gravity: Array) -> Array:
    """Return the error (3,) [N] of the sensor at an empty hand: what is felt beyond its own
    weight.
    """
    return np.asarray(force - HAND_KG * gravity)


def mass(force: Sequence[float], gravity: Sequence[float]) -> float:
    """Return the mass m [kg] in a hand; `force` (3,) without the sensor's error, `gravity` (3,)."""
    # plain numbers: small arrays take three times as long
    (fx, fy, fz), (gx, gy, gz) = force, gravity
    return (fx * gx + fy * gy + fz * gz) / (gx * gx + gy * gy + gz * gz) - HAND_KG


def residual(
    force: Sequence[float], gravity: Sequence[float], felt: float, low: float, high: float
) -> float:
    """Return r [N] for a hand in which a mass is felt, and that holds between low and high [kg]."""
    believed = HAND_KG + min(max(felt, low), high)
    return math.hypot(*(f - believed * g for f, g in zip(force, gravity, strict=True)))


class Grip(StrEnum):
    """State of the grip on a thing that a hand has closed on, as it is felt."""

    UNSURE = "unsure"  # not felt in the hand: its support still carries it, or the hand is empty
    HELD = "held"
    WARNED = "warned"  # it may be slipping
    SLIPPED = "slipped"  # it slipped or was pushed, and is still held
    LOST = "lost"


class Watch(msgspec.Struct, frozen=True):
    """Feeling of one thing; for how many cycles now r has been small, too large, too large with
    half the mass.
    """

    grip: Grip = Grip.UNSURE
    calm: int = 0
    over: int = 0
    light: int = 0


_Row = tuple[Grip, Callable[[Watch], bool], Grip]
_NEXT: tuple[_Row, ...] = (
    (Grip.UNSURE, lambda w: w.calm >= CALM_CYCLES, Grip.HELD),
    (Grip.HELD, lambda w: w.over >= WARN_CYCLES, Grip.WARNED),
    (Grip.WARNED, lambda w: w.light >= LIGHT_CYCLES, Grip.LOST),
    # With more than half of its mass in the hand it is not lost, but it meets something.
    (Grip.WARNED, lambda w: w.calm >= CALM_CYCLES or w.over >= OVER_CYCLES, Grip.SLIPPED),
)


def watched(before: Watch, r: float, m: float, low: float) -> Watch:
    """Return what is felt one cycle later: residual r [N], mass m [kg] in a hand that holds at
    least `low` [kg].

    A reading that is not a number counts as none. What slipped or was lost stays so. A hand that
    lost its thing feels about nothing; less than that is a push from below.
    """
    small = r < (ARM_N if before.grip is Grip.UNSURE else WARN_N)
    over = r > WARN_N
    now = Watch(
        before.grip,
        before.calm + 1 if small else 0,
        before.over + 1 if over else 0,
        before.light + 1 if over and abs(m) < low / 2.0 else 0,
    )
    for grip, reached, following in _NEXT:
        if before.grip is grip and reached(now):
            return Watch(following)
    return now


# --- A steady pull at what a hand holds out, felt by two senses: the wrist, and the joints, which
# give way
# p = d . ((M + m) e - F)        pull [N] along d, away from the robot; F, e, M, m as in the
# module's docstring
#     s = d . (x - x_set)            how far [m] the hand is beside its set-point along d
#
# In a cycle somebody pulls with `least` N if p of the filtered readings is more, p of the reading
# itself more than half of it, so that a knock does not last longer than it did, and s more than
# half of least / K, as the impedance of the arm yields. d is horizontal, so the weight of the
# thing, however much is in it, is no pull. A sensor that reads no number, zero or always the same
# gives no permission; nor does one that is off by a constant, since the arm does not yield.


RAW_SHARE, GIVEN_SHARE = 0.5, 0.5  # estimates: noise of 0.3 N at 5 N, dry friction in the joints
STIFFNESS = CartesianGains().stiffness[0]  # N/m
Axes = Sequence[float]  # (3,)


class Pull(msgspec.Struct, frozen=True):
    """For how many cycles now somebody has pulled, and the wrist has read the same; its last
    reading (6,).
    """

    steady: int = 0
    same: int = 0
    reading: tuple[float, ...] = ()


def size(force: Axes, gravity: Axes, kg: float, away: Axes) -> float:
    """Return the pull [N] along the unit vector `away`, at a hand with `kg` in it; all (3,) in the
    same axes.
    """
    return math.fsum(
        d * ((HAND_KG + kg) * g - f) for f, g, d in zip(force, gravity, away, strict=True)
    )


def pulled(
    before: Pull, reading: Sequence[float], smooth: float, raw: float, beside: float, least: float
) -> Pull:
    """Return what is felt one cycle later: pulls [N], filtered and of this reading (6,), the hand
    `beside` [m].
    """
    same = before.same + 1 if tuple(reading) == before.reading else 0
    true = (
        same < STUCK_CYCLES
        and all(map(math.isfinite, (smooth, raw, beside, *reading)))
        and any(reading)
    )
    pulls = smooth > least and raw > RAW_SHARE * least and beside > GIVEN_SHARE * least / STIFFNESS
    return Pull(before.steady + 1 if true and pulls else 0, same, tuple(reading))
