"""Leaves as the robot sees them: how far they are open, and what they hide."""

import math
from collections.abc import Iterator

import mujoco
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from simulated import look_at

from companion.eyes import Eyes
from companion.look_around import POINTS
from companion.skills.situation import Eye, Sight
from services.executor.simulation import receptor
from velma import names
from velma.kinematics.frames import heading
from velma.model import scene
from velma.model.scene import CANONICAL, load
from velma.sim.mujoco_backend import compiled

DOORS = load(CANONICAL.with_stem("doors"))
MODEL = compiled(DOORS)
OPENS = {"door_1": -1.0, "door_2": 1.0}
angles = st.floats(0.0, scene.limits("door_left")[1])


def looked(eye: Eye, open_by: tuple[float, float]) -> dict[str, Sight]:
    """What a look around shows, with the leaves open so far."""
    data, seen = mujoco.MjData(MODEL), {}
    qpos = data.qpos
    for name, angle in zip(names.BODY, names.START, strict=True):
        qpos[MODEL.joint(name).qposadr[0]] = angle
    for (name, sign), angle in zip(OPENS.items(), open_by, strict=True):
        qpos[MODEL.joint(name).qposadr[0]] = sign * angle
    for point in POINTS:
        neck = look_at(MODEL, qpos, point)
        seen |= {one.name: one for one in eye.look(qpos.copy(), neck)}
    return seen


def angle(seen: dict[str, Sight], name: str) -> float:
    """How far a leaf is open by what was seen of it and of its cabinet."""
    leaf, cabinet = (
        heading(seen[one].T_world_object.rotation[:, 0]) for one in (name, "cabinet_2")
    )
    return OPENS[name] * math.remainder(leaf - cabinet, math.tau)


@pytest.fixture(scope="module")
def rays() -> Eye:
    """Eyes by rays, with the noise of the scene."""
    return receptor(DOORS, Eyes.RAYS)


@pytest.fixture(scope="module")
def pixels() -> Iterator[Eye]:
    """Eyes by pixels."""
    made = receptor(DOORS, Eyes.PIXELS)
    yield made
    made.close()


@settings(max_examples=25, deadline=None)
@given(open_by=st.tuples(angles, angles))
def test_rays_show_how_far_each_leaf_is_open(rays: Eye, open_by: tuple[float, float]) -> None:
    """Within the noise of two yaws, wherever the leaves are."""
    seen = looked(rays, open_by)
    assert [angle(seen, name) for name in OPENS] == pytest.approx(open_by, abs=math.radians(0.5))


@pytest.mark.needs_opengl
@pytest.mark.process
@pytest.mark.timeout(180)
@pytest.mark.parametrize("open_by", [(0.0, 0.0), (0.0, 1.5), (1.5, 0.0), (1.5, 1.5)])
def test_pixels_show_how_far_leaves_are_open(pixels: Eye, open_by: tuple[float, float]) -> None:
    """Closed and as open as the robot opens them, within a degree: by markers on both sides of each
    leaf.
    """
    seen = looked(pixels, open_by)
    assert [angle(seen, name) for name in OPENS] == pytest.approx(open_by, abs=math.radians(1.0))


def test_closed_leaves_hide_what_is_behind_them(rays: Eye) -> None:
    """Jar and bowl are seen when both are open, and not when both are closed."""
    behind = {"jar_1", "bowl_1"}
    assert not behind & set(looked(rays, (0.0, 0.0)))
    assert behind <= set(looked(rays, (1.4, 1.4)))
