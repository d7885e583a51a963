"""Boxes are gripped from above, carried and put down, with the true loop and simulated physics."""

import pytest
from msgspec.structs import replace
from robot import LIFT_M, Acting

from companion import models
from companion.languages.values import Side
from velma.model.kinds import BOXES, Model
from velma.model.scene import CANONICAL, load

BOX, RIGHT = "box_1", Side.RIGHT
pytestmark = pytest.mark.timeout(180)  # 75 s at a load of 12 (measured)


@pytest.fixture(params=BOXES)
def acting(request: pytest.FixtureRequest) -> Acting:
    """A robot that has looked around, with a box of each size on the table."""
    model: Model = request.param
    scene = load(CANONICAL.with_name("box.toml"))
    height = -models.MODELS[model].base.z + 0.776
    things = (replace(one, model=model, xyz=(*one.xyz[:2], height)) if one.id == BOX else one for one in scene.things)
    robot = Acting(7, replace(scene, things=tuple(things)))
    robot.done(robot.look())
    return robot


def test_a_box_is_taken_and_put_down(acting: Acting) -> None:
    """It hangs upright in three fingers or more, comes along, and stands again."""
    stood = acting.truth.at[BOX]
    acting.plan_to_take_off_the_table(BOX, RIGHT)
    for command in acting.taking:
        acting.done(command)
    held = acting.truth
    assert held.fingers_on[BOX]["right"] >= 3
    assert held.at[BOX][2] > stood[2] + 0.6 * LIFT_M
    assert held.tilt_deg[BOX] < 5.0
    acting.done(acting.put_down(BOX, RIGHT))
    assert acting.truth.fingers_on[BOX] == {"right": 0, "left": 0}
    assert acting.truth.tilt_deg[BOX] < 2.0
    assert not acting.here.held
