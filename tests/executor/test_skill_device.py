"""The skill process is there for an act, and ends when none has come for a while; the next act has
a new one.
"""

from collections.abc import Iterator

import pytest
from doubles import PostDouble, eventually

from companion.languages import rc
from companion.skills.loop_messages import Phase
from services.executor import devices
from services.executor.device_messages import Drop, Ended, Feel, Move, Perform, Setup
from services.executor.devices import SkillDevice
from services.executor.memory import Felt, SituationRecord
from services.executor.renderer import Renderer
from velma.model.scene import load
from velma.names import START

pytestmark = [pytest.mark.process, pytest.mark.timeout(180)]

FELT = Felt(START.tobytes(), START.tobytes(), (0.0, 0.0), 0.0, ended=str(Phase.DONE))
REMEMBERED = SituationRecord(q=tuple(START.tolist()))


def look(number: int) -> Perform:
    """An act of some motions."""
    return Perform(number, rc.Look(f"look {number}", ((0.8, 0.3, 1.2),)), REMEMBERED, FELT)


@pytest.fixture
def agent() -> PostDouble:
    return PostDouble()


@pytest.fixture
def device(agent: PostDouble, monkeypatch: pytest.MonkeyPatch) -> Iterator[SkillDevice]:
    monkeypatch.setattr(devices, "REST_S", 0.3)
    made = SkillDevice(agent, Setup(), Renderer(load))
    yield made
    made.close()


def ended(device: SkillDevice, agent: PostDouble, number: int) -> bool:
    """Carry an act out; whether it ends."""
    device.tell(look(number))
    while isinstance(word := agent.next(), Move):
        assert device.pid
        device.tell(Feel(number, FELT))
    return isinstance(word, Ended)


def test_the_process_runs_for_acts_and_ends_after_a_rest(
    device: SkillDevice, agent: PostDouble
) -> None:
    """None before the first act; acts that follow each other have the same one; the end is no
    crash.
    """
    assert not device.pid
    assert ended(device, agent, 1)
    assert eventually(lambda: not device.pid)
    assert ended(device, agent, 2)
    assert eventually(lambda: not device.pid)
    assert agent.words.empty()


def test_an_act_is_not_cut_short(device: SkillDevice, agent: PostDouble) -> None:
    """However long its motion takes."""
    device.tell(look(1))
    assert isinstance(agent.next(), Move)
    pid = device.pid
    assert not device._rest.is_alive()
    device._rested()
    assert device.pid == pid


def test_after_a_drop_the_next_act_has_a_new_process(
    device: SkillDevice, agent: PostDouble
) -> None:
    """And the one before is gone at once."""
    device.tell(look(1))
    assert isinstance(agent.next(), Move)
    device.tell(Drop(1))
    assert not device.pid
    assert ended(device, agent, 2)
