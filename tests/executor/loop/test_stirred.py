"""The loop in a world that somebody disturbs: it is computed then, also where it stood still or
time stands still.
"""

import numpy as np
import pytest

from services.executor.loop.__main__ import build
from services.executor.loop.link import AgentLink
from services.executor.loop.process import UNREST_S, LoopProcess, Speed
from velma.model import scene
from velma.sim import disturbances
from velma.sim.disturbances import Disturbance, Kind, Of
from velma.sim.mujoco_backend import MujocoBackend

pytestmark = [pytest.mark.process, pytest.mark.timeout(60)]
PUSH = Disturbance("a", Of.THING, Kind.PUSHED, "bowl_1", (-0.03, 0.0, 0.0))


@pytest.fixture
def file(tmp_path, monkeypatch):
    """The file of orders; each turn of a loop looks at it."""
    monkeypatch.setenv(disturbances.VARIABLE, str(tmp_path / "disturbances.json"))
    monkeypatch.setattr(disturbances, "LOOK_S", 0.0)
    return tmp_path / "disturbances.json"


def loop(tmp_path, speed: Speed) -> LoopProcess:
    return build(tmp_path / "loop.slots", MujocoBackend(scene.load()), speed=speed, realtime=False)


def bowl(one: LoopProcess) -> np.ndarray:
    return np.asarray(one.core.backend.data.body("bowl_1").xpos.copy())  # type: ignore[attr-defined]


def turns(one: LoopProcess, seconds: float) -> None:
    for _ in range(round(seconds / one.core.backend.period_s)):
        one.turn()


@pytest.mark.parametrize("speed", Speed)
def test_a_push_is_seen_though_the_world_stood_still(tmp_path, clock, file, speed):
    """The bowl moves; the push happens once; then the world stands still again."""
    one = loop(tmp_path, speed)
    turns(one, 3.0)
    before = bowl(one)
    disturbances.write(file, (PUSH,))
    turns(one, UNREST_S)
    pushed = bowl(one)
    assert pushed - before == pytest.approx([-0.03, 0.0, 0.0], abs=0.01)
    turns(one, UNREST_S)
    file.unlink()
    turns(one, UNREST_S)
    assert bowl(one) == pytest.approx(pushed, abs=0.001)
    time_s = one.core.state.time
    turns(one, 1.0)
    assert (one.core.state.time == time_s) == (speed is Speed.MAX)


def test_a_new_loop_does_not_push_again_but_its_senses_are_ill_again(tmp_path, clock, file):
    """The order stands in the file; the world that it goes on in has seen the push."""
    zero = Disturbance("b", Of.WRIST, Kind.ZERO)
    first = loop(tmp_path, Speed.MAX)
    disturbances.write(file, (PUSH, zero))
    turns(first, UNREST_S)
    pushed = bowl(first)
    second = loop(tmp_path, Speed.MAX)
    assert second.restored
    second.core.hold(1.0)
    assert bowl(second) == pytest.approx(pushed, abs=0.001)
    wrist = second.core.backend.observe().wrist
    assert wrist is not None
    assert not wrist.any()


def test_a_thing_that_was_removed_is_put_back_by_a_new_loop(tmp_path, clock, file):
    """Where the scene has it: the loop that took it away is gone."""
    first = loop(tmp_path, Speed.MAX)
    before = bowl(first)
    disturbances.write(file, (Disturbance("c", Of.THING, Kind.REMOVED, "bowl_1"),))
    turns(first, UNREST_S)
    assert bowl(first)[0] < 0.0
    second = loop(tmp_path, Speed.MAX)
    file.unlink()
    turns(second, UNREST_S)
    assert bowl(second) == pytest.approx(before, abs=0.005)


def test_nothing_of_it_is_in_what_the_agent_reads(tmp_path, clock, file):
    """Of an encoder that is off the slots have the readings, and nothing else."""
    well, ill = tmp_path / "well", tmp_path / "ill"
    told, fault = [], Disturbance("fault-of-a-sense", Of.ENCODER, Kind.BIAS, "torso_0_joint")
    for folder, orders in ((well, ()), (ill, (fault,))):
        folder.mkdir()
        disturbances.write(file, orders)
        turns(loop(folder, Speed.REAL), 0.5)
        told.append(AgentLink(folder / "loop.slots"))
        assert b"fault-of-a-sense" not in (folder / "loop.slots").read_bytes()
        assert b"fault-of-a-sense" not in (folder / "loop.memory").read_bytes()
    assert told[0].state().q[0] != told[1].state().q[0]
    assert told[0].told().report == told[1].told().report
