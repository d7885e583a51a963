"""Leaves in the simulation: what moves them, what stops them, and what is kept of them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from velma.model import scene
from velma.model.kinds import objects
from velma.model.scene import NOWHERE, Scene
from velma.sim.backend import no_command
from velma.sim.mujoco_backend import MujocoBackend

DOORS = {"door_1": -1.0, "door_2": 1.0}
CLOSED = scene.load(scene.CANONICAL.with_stem("doors"))
SLACK = 0.02  # [rad] by which a soft stop gives way to 10 N


def opened(angle: float) -> Scene:
    """The scene with both leaves open by an angle."""
    loose = tuple(
        replace(t, xyz=NOWHERE, yaw=0.0, open=angle) if t.of else t for t in CLOSED.things
    )
    return scene.checked(scene.hung(replace(CLOSED, things=loose)))


def angle(backend: MujocoBackend, name: str) -> float:
    """How far a leaf is open."""
    return DOORS[name] * float(backend.data.joint(name).qpos[0])


def run(backend: MujocoBackend, cycles: int, outwards_N: float = 0.0) -> None:
    """Let time pass with a force on each handle, square to its panel."""
    command = no_command()
    for _ in range(cycles):
        command.head[:] = backend.observe().head
        for name in DOORS if outwards_N else ():
            body = backend.data.body(name)
            turn = body.xmat.reshape(3, 3)
            model = "door_left" if name == "door_1" else "door_right"
            handle = turn @ np.array(objects()[model]["parts"]["handle"]["xyz"])
            arm = handle + body.xpos - body.xipos
            force = outwards_N * turn[:, 0]
            backend.data.xfrc_applied[backend.model.body(name).id] = [*force, *np.cross(arm, force)]
        backend.step(command)


@pytest.mark.timeout(120)
def test_a_leaf_stays_where_it_is_left() -> None:
    """Closed, ajar and open: nothing moves it, also not the cabinet, in whose side it hangs."""
    for left in (0.0, 0.5, 1.57):
        backend = MujocoBackend(opened(left))
        run(backend, 500)
        assert [angle(backend, name) for name in DOORS] == pytest.approx([left, left], abs=0.002)


@pytest.mark.timeout(120)
@settings(max_examples=8, deadline=None)
@given(start=st.floats(0.0, 1.5), force=st.floats(3.0, 10.0), pull=st.booleans())
def test_a_pulled_handle_opens_the_leaf_and_a_pushed_one_closes_it(
    start: float, force: float, pull: bool
) -> None:
    """Up to the stops of the hinge; nothing else in the scene is moved."""
    backend = MujocoBackend(opened(start))
    before = backend.data.body("jar_1").xpos.copy()
    run(backend, 750, force if pull else -force)
    least, most = scene.limits("door_left")
    for name in DOORS:
        now = angle(backend, name)
        reached = min(start + 0.1, most - SLACK) if pull else max(start - 0.1, least + SLACK)
        assert now > reached if pull else now < reached
        assert least - SLACK < now < most + SLACK
    assert backend.data.body("jar_1").xpos == pytest.approx(before, abs=0.003)


def test_a_leaf_at_rest_sleeps_and_wakes_when_it_is_pulled() -> None:
    """As other things do."""
    backend = MujocoBackend(CLOSED)
    run(backend, 250)
    assert backend.data.ntree_awake == 1
    run(backend, 100, 5.0)
    assert min(angle(backend, name) for name in DOORS) > 0.01


def test_a_saved_world_has_its_leaves() -> None:
    """What follows a restore follows bit by bit what followed the save."""
    backend, other = MujocoBackend(CLOSED), MujocoBackend(CLOSED)
    run(backend, 200, 4.0)
    other.restore(backend.save())
    for one in (backend, other):
        run(one, 100, 4.0)
    assert (other.configuration() == backend.configuration()).all()
    assert angle(other, "door_1") > 0.01
