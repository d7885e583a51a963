"""How long looks last in simulated physics, and how long pl says that they last."""

import numpy as np
import pytest
from grips import DYNAMICS

from companion.look_around import EVERYWHERE, POINTS
from companion.skills.loop_messages import HeadGoal, Phase, motion
from services.executor.loop.core import LoopCore
from velma import names
from velma.kinematics.tasks import LOOK_SPEED, looking
from velma.model import scene
from velma.sim.mujoco_backend import MujocoBackend

BEGINS = [
    (0.0, 0.0),
    (-0.6, 0.56),
    (0.6, 0.67),
    (1.5, 1.2),
    (-1.5, -0.9),
]
"""Pan and tilt [rad] from which the robot looks around."""
NEAR = 0.05
"""As a share of the time; a motion begins and ends at cycles."""


@pytest.fixture(scope="module")
def core() -> LoopCore:
    """A robot at rest."""
    made = LoopCore(MujocoBackend(scene.load()), dynamics=DYNAMICS)
    made.hold(0.2)
    return made


def lasts(core: LoopCore, goals: list[np.ndarray]) -> float:
    """The simulated time [s] of looks in these directions (2,) [rad], one after the other."""
    began = core.state.time
    for number, (pan, tilt) in enumerate(goals):
        goal = HeadGoal(float(pan), float(tilt), LOOK_SPEED)
        asked = motion(f"look-{number}", core.setpoint, head=goal, settle_s=looking.REST_S)
        assert core.run(asked).phase is Phase.DONE
    return core.state.time - began


@pytest.mark.parametrize("begin", BEGINS, ids=str)
def test_a_look_around_lasts_as_long_as_planned(begin, core):
    """From wherever the head looks at its begin."""
    planned_as_it_lasts(core, begin, POINTS)


def test_a_search_lasts_as_long_as_planned(core):
    """All that the head can be turned to."""
    planned_as_it_lasts(core, BEGINS[0], EVERYWHERE)


def planned_as_it_lasts(core, begin, points):
    lasts(core, [np.array(begin)])
    torso = float(core.setpoint[names.TORSO])
    planned = looking.duration(torso, begin, points)
    real = lasts(core, [looking.aim(torso, point) for point in points])
    assert real == pytest.approx(planned, rel=NEAR)
