"""Before a thing that should be there is missing, the head looks again: some pictures do not show what is there."""

from collections.abc import Generator

from companion.skills import motions
from companion.skills.loop_messages import Motion
from companion.skills.situation import Situation
from companion.skills.skill import Sensed

REST_S = 0.1  # of a look; estimate: a frame of the simulated camera takes 67 ms
MORE_LOOKS = 3  # before a thing is missing; estimate: of pictures up to 40 % too dark or bright some show no marker


def missed(here: Situation, key: str, name: str, sensed: Sensed) -> Generator[Motion, Sensed, bool]:
    """Look again where a thing should be and is not seen, and return whether it is missing: no picture shows it."""
    for _ in range(MORE_LOOKS):
        if name in {sight.name for sight in sensed.sights} or not here.surely_seen(name):
            break
        point = here.seen[name].translation
        sensed = yield motions.still(here, key, watch=(point[0], point[1], point[2]), settle_s=REST_S)
    return here.miss(name, sensed.sights)
