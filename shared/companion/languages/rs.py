"""RS, the language of readings on channel C5: what the virtual receptor of ex saw, and the robot's
state.

Ours (the paper names no language for C5). A pose here was seen by the head camera, with noise; no
true pose travels.
"""

import msgspec

from companion.languages.values import BodyPosture, Name, Pose, Uncertainty


class Seen(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, omit_defaults=True):
    """An object seen: its id and model, its pose in the world, the time [s, simulated].

    `content`: mass of what was seen in it [kg], right to some grams; None: it was not looked into.
    `uncertainty`: of the pose; None: it is not known.
    """

    object: Name
    model: str
    pose: Pose
    at: float
    content: float | None = None
    uncertainty: Uncertainty | None = None


class RobotState(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True):
    """The robot's state, on subscription: posture, what the loop does, its lateness [us] and missed
    cycles.
    """

    body: BodyPosture
    mode: str
    act: str
    cycles: int
    missed: int
    lateness_us: float


Content = RobotState
"""RS without Seen, which is only a part of RC's Done."""
