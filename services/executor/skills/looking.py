"""The skill that looks: turn the head to each point, rest a moment, take what the receptor sees.

Where a thing should be that is not seen, an arm may be before it: the torso is turned, and the head looks there again.
Where it is still not seen, and the robot's own model says that nothing hides the place, the thing is missing. So it is
before a grasp and before a tilt, where some pictures one after the other do not show it.
"""

from collections.abc import Generator, Iterator

import numpy as np

from companion.languages import rc
from services.executor.loop.program import Motion
from services.executor.skills import motions
from services.executor.skills.moving import joining
from services.executor.skills.senses import require
from services.executor.skills.situation import Situation
from services.executor.skills.skill import NotPossible, Sensed, Skill
from velma import names
from velma.kinematics.tasks.speeds import LOADED_SPEED

REST_S = 0.1  # estimate: a frame of the simulated camera takes 67 ms
THERE_M = 0.1  # a thing this near to the point is what the look is for (estimate)
MORE_LOOKS = 3  # before a thing is missing; estimate: of pictures up to 40 % too dark or bright some show no marker
TURNS = (0.4, -0.4)  # [rad] of the torso from where it was; estimate: an arm passes 0.3 m before the camera


def look(here: Situation, command: rc.Look) -> Skill:
    """Look at each point; what is seen there comes back in Sensed. Raises failed if nothing true is seen at the end."""
    for point in command.at:
        sought = _expected(here, point)
        sensed = yield motions.still(here, command.key, watch=point, settle_s=REST_S)
        for turned in _turned(here) if _unseen(here, sought, sensed) else ():
            if motion := _turning(here, command.key, turned, point):
                sensed = yield motion
            if not _unseen(here, sought, sensed):
                break
    require(here, command)


def missed(here: Situation, key: str, name: str, sensed: Sensed) -> Generator[Motion, Sensed, bool]:
    """Look again where a thing should be and is not seen, and return whether it is missing: no picture shows it."""
    for _ in range(MORE_LOOKS):
        if name in {sight.name for sight in sensed.sights} or not here.surely_seen(name):
            break
        point = here.seen[name].translation
        sensed = yield motions.still(here, key, watch=(point[0], point[1], point[2]), settle_s=REST_S)
    return here.miss(name, sensed.sights)


def _expected(here: Situation, point: tuple[float, float, float]) -> set[str]:
    """Return what should stand at the point."""
    near = (name for name, pose in here.seen.items() if np.linalg.norm(pose.translation - point) < THERE_M)
    return {name for name in near if here.holder(name) is None}


def _unseen(here: Situation, sought: set[str], sensed: Sensed) -> bool:
    """Whether something sought is not seen from here; where nothing hides it, it is missing."""
    for name in sought:
        here.miss(name, sensed.sights)
    return bool(sought - {sight.name for sight in sensed.sights})


def _turned(here: Situation) -> Iterator[np.ndarray]:
    """Yield postures (15,) with the torso turned from where it was at the first one, within its limits."""
    first = here.q.copy()
    for turn in TURNS:
        q = here.q.copy()
        q[names.TORSO] = first[names.TORSO] + turn
        if names.LOWER[names.TORSO] < q[names.TORSO] < names.UPPER[names.TORSO]:
            yield q


def _turning(here: Situation, key: str, q: np.ndarray, point: tuple[float, float, float]) -> Motion | None:
    """Return the motion to the posture q (15,) that ends with the head on the point; None if it is not free."""
    try:
        path = joining(here, q)
    except NotPossible:
        return None
    return motions.along(here, key, path, LOADED_SPEED, watch=point, settle_s=REST_S)
