"""The skill that looks: turn the head to each point, rest a moment, take what the receptor sees."""

from companion.languages import rc
from services.executor.skills import motions
from services.executor.skills.situation import Situation
from services.executor.skills.skill import Skill

REST_S = 0.1  # estimate: a frame of the simulated camera takes 67 ms


def look(here: Situation, command: rc.Look) -> Skill:
    """Look at each point; what is seen there comes back in Sensed."""
    for point in command.at:
        yield motions.still(here, command.key, watch=point, settle_s=REST_S)
