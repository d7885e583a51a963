"""Pours that are possible: the jar is in the left hand, the bowl on the nearest table."""

from itertools import islice

import numpy as np

from companion import models
from companion.languages.values import Side
from companion.skills.motions import aim
from companion.tasks.pour.done import Pour
from velma import names
from velma.kinematics import motion
from velma.kinematics.frames import standing
from velma.kinematics.tasks.carrying import upright
from velma.kinematics.tasks.pouring import FIRST_TILT, LAST_TILT, Stream, tiltings

JAR, BOWL, LEFT = "jar_1", "bowl_1", Side.LEFT
EMPTY_KG = 0.2  # velma/model/objects.yaml
SPILLS_NOTHING = np.radians(40.0)  # largest tilt on the way to the bowl
MOST = 20  # tilts that are tried


def in_view(acting):
    """Return a pour over a bowl that is seen below the jar; in the situation alone, the robot is
    where it begins.
    """
    here = acting.here
    tilting = next(one for one in islice(_possible(acting), MOST) if stands_and_sees(here, one))
    return _pour(tilting)


def hidden(acting):
    """Return a pour over a bowl that the jar hides before the tilt; in the situation alone, as
    `in_view`.
    """
    here = acting.here
    possible = islice(_possible(acting), MOST)
    return _pour(next(one for one in possible if not stands_and_sees(here, one)))


def brought(acting, seen=False):
    """Return a pour; the robot has moved to where it begins, in physics. `seen`: the bowl is seen
    from there.
    """
    here = acting.here
    data, joint = acting.core.backend.data, acting.core.backend.model.joint(BOWL).qposadr[0]
    possible = _possible(acting)
    data.qpos[joint : joint + 7] = (*here.seen[BOWL].translation, 1.0, 0.0, 0.0, 0.0)
    keep = upright(here.robot, LEFT, here.held[LEFT].T_grip_object, SPILLS_NOTHING)
    q, head = here.q.copy(), here.head
    for tilting in possible:
        visible = not seen or stands_and_sees(here, tilting)
        here.q, here.head = q, head
        way = None
        if visible:
            way = motion.plan(here.robot, here.world, LEFT, here.q, tilting.path[0], keep=keep)
        if way is not None:
            acting.done(acting.move(LEFT, way.path[1:]))
            return _pour(tilting)
    raise AssertionError("no way to a tilt")


def stands_and_sees(here, tilting):
    """Put the robot of the situation below this tilt's beginning, and return whether the bowl is
    surely seen there.
    """
    here.q = tilting.path[0].copy()
    rim = models.MODELS[here.models[BOWL]].hole
    goal = aim(float(here.q[names.TORSO]), here.seen[BOWL].act(np.array(rim.centre)))
    here.head = (goal.pan, goal.tilt)
    return here.surely_seen(BOWL)


def _possible(acting):
    """Put the bowl on the table, in the situation alone, and return the tilts over it."""
    here = acting.here
    table = here.seen["table_1"].translation
    z = 0.78 - models.MODELS[acting.things[BOWL]].base.z
    here.place(BOWL, standing(np.array([table[0], table[1] + 0.25, z])))
    rim, opening = (models.MODELS[acting.things[name]].hole for name in (BOWL, JAR))
    flow = Stream(here.seen[BOWL].act(np.array(rim.centre)), rim.radius, opening.centre[2])
    held = here.held[LEFT].T_grip_object
    return tiltings(here.robot, here.world, LEFT, here.q, held, flow, np.random.default_rng(1))


def _pour(tilting):
    tilts = (FIRST_TILT, LAST_TILT)
    return Pour("pour", LEFT, JAR, BOWL, tilting.azimuth, tilting.spin, tilts, 1.0, EMPTY_KG)
