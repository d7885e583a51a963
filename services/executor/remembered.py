"""What ex remembers from act to act: posture, what was seen, what the hands hold. Plain words and numbers, journalled.

A new worker's situation is made of it, so neither the death of the worker nor that of the agent makes ex forget what
it holds. Must not know: geometry, the simulator.
"""

import msgspec

from companion.languages import rc, rs
from companion.languages.values import BodyPosture, Pose, Side


class Holding(msgspec.Struct, frozen=True):
    """What a hand holds, by which grasp, where in the hand (T_grip_object), what is fed forward for it [kg]."""

    object: str
    grasp: str
    pose: Pose
    mass: float


class Remembered(msgspec.Struct, frozen=True):
    """`q`: set-points of torso, right arm, left arm (15,) [rad], () before the first word of the loop.

    `fingers`: angle per side [rad]. `seen`: last pose of each thing in the world (of a held one: before it was taken).
    `time`: simulated [s].
    """

    q: tuple[float, ...] = ()
    head: tuple[float, float] = (0.0, 0.0)
    fingers: dict[Side, float] = {}
    seen: dict[str, rs.Seen] = {}
    held: dict[Side, Holding] = {}
    time: float = 0.0

    def posture(self) -> BodyPosture | None:
        """The whole body as it travels; None before it is known."""
        if not self.q:
            return None
        right, left = ((angle, angle, angle, 0.0) for angle in (self.fingers.get(s, 0.0) for s in SIDES))
        return BodyPosture(self.q[0], self.q[1:8], self.q[8:15], self.head, right, left)

    def holding(self) -> dict[Side, tuple[str, str, Pose]]:
        """What each hand holds, as it travels."""
        return {side: (one.object, one.grasp, one.pose) for side, one in self.held.items()}

    def not_done(self, key: str, kind: str, reason: str) -> rc.NotDone:
        """An outcome that says how the robot stands."""
        return rc.NotDone(key, kind, reason, self.posture(), held=self.holding())


SIDES = (Side.RIGHT, Side.LEFT)
