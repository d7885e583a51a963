"""A jar that lies on a table is taken from above, across its axis, and stood up: true loop, simulated physics."""

import math

import pytest
from msgspec.structs import replace
from robot import LIFT_M, Acting

from companion.languages.values import Side
from velma.model.kinds import Model
from velma.model.scene import Thing, load

JAR, RIGHT = "jar_1", Side.RIGHT
pytestmark = pytest.mark.timeout(180)


@pytest.fixture(params=[0.3, 1.3])
def acting(request: pytest.FixtureRequest) -> Acting:
    """A robot that has looked around. The jar lies on the table; its axis has the given heading [rad]."""
    yaw: float = request.param
    jar = Thing(JAR, Model.JAR, (0.58, -0.52, 0.815), yaw=yaw, pitch=math.pi / 2)
    canonical = load()
    others = tuple(one for one in canonical.things if one.id != JAR)
    robot = Acting(0, replace(canonical, things=(*others, jar), content=None))
    robot.done(robot.look())
    return robot


def test_it_is_taken_and_stood_up(acting: Acting) -> None:
    """It comes along in three fingers, and stands upright where the hand puts it down."""
    lay = acting.truth
    assert lay.tilt_deg[JAR] == pytest.approx(90.0, abs=1.0)
    acting.plan_to_take_off_the_table(JAR, RIGHT)
    for command in acting.taking:
        acting.done(command)
    held = acting.truth
    assert held.fingers_on[JAR]["right"] >= 3
    assert held.at[JAR][2] > lay.at[JAR][2] + 0.6 * LIFT_M
    acting.done(acting.put_down(JAR, RIGHT))
    assert acting.truth.fingers_on[JAR] == {"right": 0, "left": 0}
    assert acting.truth.tilt_deg[JAR] < 2.0
