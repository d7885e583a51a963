"""The skills of ex: each turns one robot command (RC) into motions of the loop, from what the receptor saw last."""

from collections.abc import Callable
from typing import Any

from companion.languages import rc
from services.executor.skills import grasping, looking, moving, opening, pouring, releasing
from services.executor.skills.skill import Skill

# Command class -> generator function (situation, command) -> motions.
SKILLS: dict[type[rc.Command], Callable[[Any, Any], Skill]] = {
    rc.MoveJoint: moving.move_joint,
    rc.MoveCartesian: moving.move_cartesian,
    rc.Home: moving.home,
    rc.Grasp: grasping.grasp,
    rc.Release: releasing.release,
    rc.Pour: pouring.pour,
    rc.Look: looking.look,
    rc.OpenDoor: opening.open_door,
}
