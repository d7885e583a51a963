"""The skill that looks: turn the head to each point, rest a moment, take what the receptor sees.

Where a thing should be that is not seen, an arm may be before it: the torso is turned, and the head
looks there again. Where it is still not seen, and the robot's own model says that nothing hides the
place, the thing is missing.
"""

from collections.abc import Iterator

import numpy as np

from companion.languages import rc
from companion.skills import motions
from companion.skills.moving import joining
from companion.skills.senses import require_sight
from companion.skills.situation import Situation
from companion.skills.skill import NotPossible, Sensed, Skill, SkillRow
from velma import names
from velma.kinematics.tasks import LOADED_SPEED
from velma.kinematics.tasks.looking import REST_S

THERE_M = 0.1  # a thing this near to the point is what the look is for (estimate)
# [rad] of the torso from where it was; estimate: an arm passes 0.3 m before the camera
TURNS = (0.4, -0.4)


def look(here: Situation, command: rc.Look) -> Skill:
    """Look at each point; what is seen there comes back in Sensed. Raises failed if nothing true is
    seen at the end.
    """
    for point in command.at:
        distances = {
            name: np.linalg.norm(pose.translation - point) for name, pose in here.seen.items()
        }
        near = (name for name, distance in distances.items() if distance < THERE_M)
        sought = {name for name in near if here.holder(name) is None}  # what should stand there
        sensed = yield motions.still(here, command.key, watch=point, settle_s=REST_S)
        for turned in _turned(here) if _unseen(here, sought, sensed) else ():
            try:
                path = joining(here, turned)
            except NotPossible:  # it is not free
                continue
            sensed = yield motions.along(
                here, command.key, path, LOADED_SPEED, watch=point, settle_s=REST_S
            )
            if not _unseen(here, sought, sensed):
                break
    require_sight(here)


def _unseen(here: Situation, sought: set[str], sensed: Sensed) -> bool:
    """Whether something sought is not seen from here; where nothing hides it, it is missing."""
    for name in sought:
        here.miss(name, sensed.sights)
    return bool(sought - {sight.name for sight in sensed.sights})


def _turned(here: Situation) -> Iterator[np.ndarray]:
    """Yield postures (15,) with the torso turned from where it was at the first one, within its
    limits.
    """
    first = here.q.copy()
    for turn in TURNS:
        q = here.q.copy()
        q[names.TORSO] = first[names.TORSO] + turn
        if names.LOWER[names.TORSO] < q[names.TORSO] < names.UPPER[names.TORSO]:
            yield q


SKILLS = (SkillRow(rc.Look, look),)
