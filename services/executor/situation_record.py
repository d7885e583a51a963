"""Memory of ex from act to act: posture, what was seen, what the hands hold. Plain data, kept in
the journal.

A new skill process starts from it, so neither its death nor that of the agent makes ex forget what
it holds. Must not know: geometry, the simulator.
"""

import msgspec
from msgspec.structs import replace

from companion.languages import rc, rs
from companion.languages.facts import Facts
from companion.languages.values import BodyPosture, Pose, Side
from companion.skills.situation import Unfinished


class Holding(msgspec.Struct, frozen=True):
    """The object in a hand: by which grasp, its pose in the hand (T_grip_object), the mass that is
    fed forward [kg].

    `steady`, `apart`, `slipped`: as of companion.skills.situation.Held.
    """

    object: str
    grasp: str
    pose: Pose
    mass: float
    steady: Pose | None = None
    apart: int = 0
    slipped: bool = False


class SituationRecord(msgspec.Struct, frozen=True):
    """`q`: set-points of torso, right arm, left arm (15,) [rad], () before the first message of the
    loop.

    `fingers`: angle per side [rad]. `seen`: last pose of each thing in the world (of a held one:
    before it was taken). `placed`: things that a hand let go of and that were not seen since, by id
    the time [s]; `seen` has where. `unfinished`: moves of content that were begun and not ended, by
    source. `time`: simulated [s]. `epoch`: name of the simulated world in which all that is so, ""
    of a real one. `ill`: sensors whose readings could not be true at the last look.
    """

    q: tuple[float, ...] = ()
    head: tuple[float, float] = (0.0, 0.0)
    fingers: dict[Side, float] = {}
    seen: dict[str, rs.Seen] = {}
    held: dict[Side, Holding] = {}
    placed: dict[str, float] = {}
    unfinished: dict[str, Unfinished] = {}
    time: float = 0.0
    epoch: str = ""
    ill: tuple[rc.Ill, ...] = ()

    def posture(self) -> BodyPosture | None:
        """Return the posture for a communicate; None before it is known."""
        if not self.q:
            return None
        right, left = (
            (angle, angle, angle, 0.0) for angle in (self.fingers.get(s, 0.0) for s in SIDES)
        )
        return BodyPosture(self.q[0], self.q[1:8], self.q[8:15], self.head, right, left)

    def holding(self) -> dict[Side, tuple[str, str, Pose]]:
        """Return what each hand holds, for a communicate."""
        return {side: (one.object, one.grasp, one.pose) for side, one in self.held.items()}

    def not_done(self, key: str, kind: str, why: Facts) -> rc.NotDone:
        """Return the outcome of an act that was not done, with the posture."""
        placed = tuple(replace(self.seen[name], at=at) for name, at in self.placed.items())
        return rc.NotDone(key, kind, why, self.posture(), held=self.holding(), placed=placed)


SIDES = (Side.RIGHT, Side.LEFT)
