"""Boxes, and a jar that lies, are taken off the table, carried and put down: true loop, simulated
physics.
"""

import math

import pytest
from msgspec.structs import replace
from robot import LIFT_M, Acting

from companion import models
from companion.languages.values import Side
from velma.model.kinds import BOXES, Model
from velma.model.scene import CANONICAL, SceneObject, load

BOX, JAR, RIGHT = "box_1", "jar_1", Side.RIGHT
pytestmark = pytest.mark.timeout(180)  # 75 s at a load of 12 (measured)


def taken(name, seed, scene):
    """A robot that has looked around and taken it: it comes along in three fingers or more."""
    acting = Acting(seed, scene)
    acting.done(acting.look())
    stood = acting.truth.at[name]
    acting.plan_to_take_off_the_table(name, RIGHT)
    for command in acting.taking:
        acting.done(command)
    assert acting.truth.fingers_on[name]["right"] >= 3
    assert acting.truth.at[name][2] > stood[2] + 0.6 * LIFT_M
    return acting


def stands_again(acting, name):
    acting.done(acting.put_down(name, RIGHT))
    assert acting.truth.fingers_on[name] == {"right": 0, "left": 0}
    assert acting.truth.tilt_deg[name] < 2.0
    assert not acting.here.held


@pytest.mark.parametrize("model", BOXES)
def test_a_box_is_taken_and_put_down(model):
    """From above, of each size; it hangs upright, and stands again."""
    scene = load(CANONICAL.with_name("box.toml"))
    height = -models.MODELS[model].base.z + 0.776
    box = next(one for one in scene.things if one.id == BOX)
    box = replace(box, model=model, xyz=(*box.xyz[:2], height))
    things = (box if one.id == BOX else one for one in scene.things)
    acting = taken(BOX, 7, replace(scene, things=tuple(things)))
    assert acting.truth.tilt_deg[BOX] < 5.0
    stands_again(acting, BOX)


@pytest.mark.parametrize("yaw", [0.3, 1.3])
def test_a_jar_that_lies_is_taken_and_stood_up(yaw):
    """Across its axis, which has this heading [rad]."""
    jar = SceneObject(JAR, Model.JAR, (0.58, -0.52, 0.815), yaw=yaw, pitch=math.pi / 2)
    canonical = load()
    others = tuple(one for one in canonical.things if one.id != JAR)
    stands_again(taken(JAR, 0, replace(canonical, things=(*others, jar), content=None)), JAR)
