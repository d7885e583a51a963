"""What is at rest sleeps, wakes when something touches it, and moves as it would have moved
awake.
"""

import numpy as np
import pytest

from velma.model import scene
from velma.sim import mujoco_backend
from velma.sim.backend import no_command
from velma.sim.mujoco_backend import MujocoBackend

CALM = 250  # cycles: things of a scene are at rest after 150


def hold(backend: MujocoBackend, cycles: int) -> np.ndarray:
    """Coordinates (cycles, nq) while the drives hold the weight of the arms."""
    command, out = no_command(), []
    for _ in range(cycles):
        command.head[:] = backend.observe().head
        backend.step(command)
        out.append(backend.data.qpos.copy())
    return np.array(out)


def place(backend: MujocoBackend, name: str) -> int:
    """Where the coordinates of a thing begin."""
    return int(np.ravel(backend.model.joint(name).qposadr)[0])


def awake(backend: MujocoBackend, name: str) -> bool:
    """Whether a thing is simulated."""
    return bool(backend.data.body_awake[backend.model.body(name).id] == 1)


@pytest.fixture
def resting() -> MujocoBackend:
    """The canonical scene, after things came to rest."""
    backend = MujocoBackend(scene.load())
    hold(backend, CALM)
    return backend


def test_only_the_robot_is_awake_at_rest(resting):
    """Its drives keep it so."""
    assert resting.data.ntree_awake == 1
    assert not awake(resting, "jar_1")
    assert awake(resting, "torso_link0")


@pytest.mark.parametrize("how", ["moved", "pushed", "thrown"])
def test_what_is_disturbed_wakes_with_what_lies_in_it(resting, how):
    """The jar moves, and its grains with it."""
    before, jar = resting.data.qpos.copy(), place(resting, "jar_1")
    if how == "moved":
        resting.data.qpos[jar + 2] += 0.02
    elif how == "pushed":
        resting.data.xfrc_applied[resting.model.body("jar_1").id, 0] = 3.0
    else:
        resting.data.qvel[int(resting.model.joint("jar_1").dofadr[0]) + 2] = 0.5
    hold(resting, 2)
    assert awake(resting, "jar_1")
    hold(resting, 30)
    assert resting.data.ntree_awake > 10
    assert np.abs(resting.data.qpos - before)[jar : jar + 3].max() > 1e-4


def test_a_thing_that_falls_onto_another_one_wakes_it(resting):
    """By contact alone."""
    jar, bowl = place(resting, "jar_1"), place(resting, "bowl_1")
    above = np.add(resting.data.qpos[bowl : bowl + 3], (0.0, 0.0, 0.25))
    resting.data.qpos[jar : jar + 3] = above
    met = []
    for _ in range(150):
        hold(resting, 1)
        met.append(awake(resting, "bowl_1"))
    assert not met[5]
    assert any(met)


def test_sleep_changes_nothing_that_moves(monkeypatch):
    """Until something sleeps both worlds are equal bit for bit; then things agree to 0.1 mm,
    creeping grains to 1.
    """
    asleep = MujocoBackend(scene.load())
    monkeypatch.setattr(mujoco_backend, "allow_sleep", lambda model: None)
    never = MujocoBackend(scene.load())
    ours, theirs = hold(asleep, 400), hold(never, 400)
    assert (asleep.data.ntree_awake, never.data.ntree_awake == never.model.ntree) == (1, True)
    assert np.array_equal(ours[:10], theirs[:10])
    apart = np.abs(ours - theirs).max(axis=0)
    for name in ("jar_1", "bowl_1"):
        assert apart[place(asleep, name) : place(asleep, name) + 3].max() < 1e-4
    assert apart.max() < 1e-3
