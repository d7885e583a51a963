"""The thing in a hand, felt at the wrist: its mass, and the force that no held mass explains.

    e = R^T (a - g)                      apparent gravity at a point c of the hand, axes of the hand
    m = F.e / |e|^2 - M                  mass in the hand; F: force of the arm on the hand of mass M
    r = | F - (M + clip(m, low, high)) e |

While the hand holds a mass between low and high, r is the error of the sensors, whatever the arm does; a thing that
slips shows in r at once, in m later. `a` is the second difference of c from the measured joints. F and a pass the same
filters, or their lags would differ. Sides are rows: 0 right, 1 left. The numbers were measured in simulated pours
(36 slips, 6 grips): warned within 60 ms, lost within 0.2 s (0.6 s while tilted), no false alarm.
"""

import math
from collections.abc import Callable
from enum import StrEnum

import msgspec
import numpy as np
from numpy.typing import NDArray

from velma.control.cartesian import GRAVITY

Array = NDArray[np.float64]

HAND_KG = 1.2421  # below the sensor: sum of robot.yaml (a test adds it up)
SENSOR_TO_GRIP = np.array([[1.0, 1.0, 1.0], [-1.0, -1.0, 1.0]])[:, None]  # VR: the left palm is turned by half a turn
POINT_M = -0.02  # c along z of the grip: 0.105 m before the sensor, the least error of the hand's mass centre in motion
CUTOFF_HZ, WINDOW = 12.0, 25  # of each of two low-passes; samples of the mean after them: 50 ms
# N; normal maxima of r: jar 0.17, bowl 0.05, with noise of 0.3 N 0.26; a bowl that was turned by 45 deg 0.52 (seed 10)
ARM_N, WARN_N = 0.2, 0.6
LOAD_S = 0.15  # s, time constant of the weight: settled to 0.1 % after 1 s at rest, noise of 0.1 N is 1 g
CALM_CYCLES, LIGHT_CYCLES = 25, 50  # 50, 100 ms
WARN_CYCLES = 5  # 10 ms: no single reading
OVER_CYCLES = 250  # 0.5 s: longer than a jar takes to slide out of a tilted hand (0.44 s, measured)


class Wrists:
    """Filtered readings of both wrists; call `feel` once a cycle."""

    def __init__(self, period_s: float) -> None:
        self._rate = 1.0 / (period_s * period_s)
        self._gain = 1.0 - math.exp(-2.0 * math.pi * CUTOFF_HZ * period_s)
        self._x, self._first, self._second = np.zeros((3, 2, 2, 3))  # rows: force, acceleration, in world axes
        self._window = np.zeros((WINDOW, 2, 2, 3))
        self._points, self._rotation = np.zeros((2, 2, 3)), np.zeros((2, 3, 3))
        self._up = np.array([0.0, 0.0, GRAVITY])
        self._cycles = 0

    def restart(self) -> None:
        """Forget the past: cycles were left out."""
        self._cycles = 0

    @property
    def settled(self) -> bool:
        """Whether the filters have heard enough since the start."""
        return self._cycles > 2 * WINDOW

    def feel(self, wrist: Array, rotation: Array, position: Array) -> Array:
        """Return force F and apparent gravity e of each hand in grip axes: (2, 2, 3), F and e in the second axis.

        `wrist` (2, 6): the reading, of the cycle before; `rotation` (2, 3, 3), `position` (2, 3): T_world_grip now.
        """
        point = position + POINT_M * rotation[:, :, 2]
        if self._cycles == 0:
            self._points[:], self._rotation[:] = point, rotation
        last, before = self._points
        x = self._x
        # Rows times R^T are R times columns: from grip axes to world axes, as the hand was when its force was felt.
        x[:, :1] = (wrist[:, None, :3] * SENSOR_TO_GRIP) @ self._rotation.transpose(0, 2, 1)
        x[:, 1] = (point - 2.0 * last + before) * self._rate + self._up
        self._points[1], self._points[0], self._rotation[:] = last, point, rotation
        if self._cycles < 3:
            x[:, 1] = self._up  # no second difference yet
            self._first[:], self._second[:] = x, x
        self._first += self._gain * (x - self._first)
        self._second += self._gain * (self._first - self._second)
        self._window[self._cycles % WINDOW] = self._second @ rotation
        if self._cycles < WINDOW:
            self._window[self._cycles + 1 :] = self._window[self._cycles]
        self._cycles += 1
        return np.asarray(np.add.reduce(self._window, 0) / WINDOW)


def tare(force: Array, gravity: Array) -> Array:
    """Return the error (3,) [N] of the sensor at an empty hand: what is felt beyond its own weight."""
    return np.asarray(force - HAND_KG * gravity)


def mass(force: Array, gravity: Array) -> Array:
    """Return the masses m (2,) [kg] in the hands; `force` (2, 3) without the sensors' errors."""
    along = (force * gravity).sum(axis=1)
    return np.asarray(along / (gravity * gravity).sum(axis=1) - HAND_KG)


def residual(force: Array, gravity: Array, masses: Array, low: Array, high: Array) -> Array:
    """Return r (2,) [N] for hands that hold between low and high (2,) [kg]."""
    believed = HAND_KG + np.minimum(np.maximum(masses, low), high)
    rest = force - believed[:, None] * gravity
    return np.asarray(np.sqrt((rest * rest).sum(axis=1)))


class Grip(StrEnum):
    """State of the grip on a thing that a hand has closed on, as it is felt."""

    UNSURE = "unsure"  # not felt in the hand: its support still carries it, or the hand is empty
    HELD = "held"
    WARNED = "warned"  # it may be slipping
    SLIPPED = "slipped"  # it slipped or was pushed, and is still held
    LOST = "lost"


class Watch(msgspec.Struct, frozen=True):
    """Feeling of one thing; for how many cycles now r has been small, too large, too large with half the mass."""

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
    """Return what is felt one cycle later: residual r [N], mass m [kg] in a hand that holds at least `low` [kg].

    A reading that is not a number counts as none. What slipped or was lost stays so. A hand that lost its thing feels
    about nothing; less than that is a push from below.
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
