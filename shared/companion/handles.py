"""How a hand takes a leaf by the bar of its handle, as grasps of the leaf: numbers from models.toml.

The bar is upright, parallel to the hinge. The fingers close across it; the hand's approach is slanted to the panel.
"""

import math

import msgspec

from companion.languages import wm
from companion.languages.values import Pose, Vector
from companion.quaternions import Quat, conjugate, product

HANDLE = "handle"
"""Kind of these grasps: the leaf is turned by them, not taken."""
_HALF = math.sqrt(0.5)
_UPWARDS, _DOWNWARDS = (0.0, _HALF, 0.0, _HALF), (_HALF, 0.0, _HALF, 0.0)
"""T_leaf_grip with the grip's z along the leaf's x, the grip's x up or down."""


class Handle(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The bar in the leaf's frame [m]; `depth`: its distance from the grip frame, `before`: way of the hand to it [m].

    Fingers before they close, and where one stops that meets nothing [rad]; squeeze and speed as of a grasp; slants of
    the hand against the panel, best first.
    """

    model: str
    bar: Vector
    depth: float
    before: float
    fingers: float
    closed: float
    squeeze_deg: float
    speed: float
    slants_deg: tuple[float, ...]

    def grasps(self) -> tuple[wm.GraspDef, ...]:
        """Return each slant with the grip's x down, then each with it up."""
        ways = [(name, turn, up) for name, turn, up in (("down", _DOWNWARDS, -1.0), ("up", _UPWARDS, 1.0))]
        return tuple(self._grasp(slant, *way) for way in ways for slant in self.slants_deg)

    def _grasp(self, slant: float, name: str, turn: Quat, up: float) -> wm.GraspDef:
        steps = (self._step(slant, turn, up, self.depth + self.before), self._step(slant, turn, up, self.depth))
        squeeze = math.radians(self.squeeze_deg)
        return wm.GraspDef(f"{name}_{slant:g}", steps, self.closed, squeeze, self.speed, self.before, HANDLE)

    def _step(self, slant: float, turn: tuple[float, float, float, float], up: float, depth: float) -> wm.GraspStep:
        """T_grip_leaf with the bar `depth` before the grip. The slant brings the hand from the side of the hinge."""
        yaw = math.pi - math.radians(slant) * math.copysign(1.0, self.bar[1])
        c, s = math.cos(yaw), math.sin(yaw)
        x, y, z = self.bar
        ahead, across = c * x + s * y, up * (s * x - c * y)
        quat = conjugate(product((math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)), turn))
        return wm.GraspStep(Pose((-up * z, -across, depth - ahead), quat), self.fingers)
