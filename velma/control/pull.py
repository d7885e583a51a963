"""A steady pull at what a hand holds out, felt by two senses: the wrist, and the joints, which give way.

    p = d . ((M + m) e - F)        pull [N] along d, away from the robot; F, e, M, m as of velma.control.grip
    s = d . (x - x_set)            how far [m] the hand is beside its set-point along d

In a cycle somebody pulls with `least` N if p of the filtered readings is more, p of the reading itself more than half
of it, so that a knock does not last longer than it did, and s more than half of least / K, as the impedance of the arm
yields. d is horizontal, so the weight of the thing, however much is in it, is no pull. A sensor that reads no number,
zero or always the same gives no permission; nor does one that is off by a constant, since the arm does not yield.
"""

import math
from collections.abc import Sequence

import msgspec

from velma.control.cartesian import CartesianGains
from velma.control.grip import HAND_KG, STUCK_CYCLES

RAW_SHARE, GIVEN_SHARE = 0.5, 0.5  # estimates: noise of 0.3 N at 5 N, dry friction in the joints
STIFFNESS = CartesianGains().stiffness[0]  # N/m
Axes = Sequence[float]  # (3,)


class Pull(msgspec.Struct, frozen=True):
    """For how many cycles now somebody has pulled, and the wrist has read the same; its last reading (6,)."""

    steady: int = 0
    same: int = 0
    reading: tuple[float, ...] = ()


def size(force: Axes, gravity: Axes, kg: float, away: Axes) -> float:
    """Return the pull [N] along the unit vector `away`, at a hand with `kg` in it; all (3,) in the same axes."""
    return math.fsum(d * ((HAND_KG + kg) * g - f) for f, g, d in zip(force, gravity, away, strict=True))


def pulled(before: Pull, reading: Sequence[float], smooth: float, raw: float, beside: float, least: float) -> Pull:
    """Return what is felt one cycle later: pulls [N], filtered and of this reading (6,), the hand `beside` [m]."""
    same = before.same + 1 if tuple(reading) == before.reading else 0
    true = same < STUCK_CYCLES and all(map(math.isfinite, (smooth, raw, beside, *reading))) and any(reading)
    pulls = smooth > least and raw > RAW_SHARE * least and beside > GIVEN_SHARE * least / STIFFNESS
    return Pull(before.steady + 1 if true and pulls else 0, same, tuple(reading))
