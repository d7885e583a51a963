"""A straight line of the hand: blocked by what it would go into, not by what it leaves or only passes."""

import numpy as np
import pytest
from robot import Acting

from companion import models
from companion.languages.values import Side
from services.executor.skills.moving import straight
from services.executor.skills.situation import Situation
from services.executor.skills.skill import NotPossible
from velma.kinematics.frames import shifted, standing

LEFT = Side.LEFT
WAY_M = 0.06
pytestmark = pytest.mark.timeout(240)  # the first test of the folder also takes the jar


def beside(here: Situation, gap_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Put a box beside the held jar, this far from it; return the horizontal directions away and along its face."""
    jar = here.robot.grip(here.q, LEFT) * here.held[LEFT].T_grip_object
    away = np.array([0.0, 1.0, 0.0])
    reach = models.MODELS["jar"].base.radius + 0.055 + gap_m
    here.models = {**here.models, "box_1": "box1"}
    here.place("box_1", standing(jar.translation - reach * away))
    return away, np.array([-1.0, 0.0, 0.0])


def moved(here: Situation, way: np.ndarray) -> list[np.ndarray]:
    """Return the line of the left hand along a way (3,) [m]."""
    target = shifted(here.robot.grip(here.q, LEFT), way)
    return straight(here, LEFT, here.q, target, here.world.free)


@pytest.mark.parametrize("gap_m", [0.001, -0.004])
def test_what_is_close_or_touched_may_be_left(gap_m: float, jar_out: Acting) -> None:
    """The margin alone blocks nothing, nor does a thing that is touched and left."""
    here = jar_out.here
    away, _ = beside(here, gap_m)
    assert not here.world.free(here.q)
    assert len(moved(here, WAY_M * away)) > 1


def test_a_line_into_a_thing_is_blocked(jar_out: Acting) -> None:
    """From beside it, and deeper into one that is touched."""
    here = jar_out.here
    for gap_m in (0.001, -0.004):
        away, _ = beside(here, gap_m)
        with pytest.raises(NotPossible, match="cannot move straight"):
            moved(here, -WAY_M * away)
