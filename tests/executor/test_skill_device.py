"""The skill process is there for an act, and ends when none has come for a while; the next act has
a new one.
"""

import threading
import time
from collections.abc import Callable, Iterator
from queue import Queue
from typing import Any

import pytest

from companion.languages import rc
from companion.skills.loop_messages import Phase
from services.executor import skill_device
from services.executor.device_messages import Drop, Ended, Feel, Felt, Move, Perform, Setup
from services.executor.renderer import Renderer
from services.executor.situation_record import SituationRecord
from services.executor.skill_device import SkillDevice
from velma.model.scene import load
from velma.names import START

pytestmark = [pytest.mark.process, pytest.mark.timeout(180)]

WITHIN_S = 120.0
FELT = Felt(
    q=START.tobytes(), measured=START.tobytes(), head=(0.0, 0.0), time=0.0, ended=str(Phase.DONE)
)
REMEMBERED = SituationRecord(q=tuple(START.tolist()))


def look(number: int) -> Perform:
    """An act of some motions."""
    return Perform(number, rc.Look(f"look {number}", ((0.8, 0.3, 1.2),)), REMEMBERED, FELT)


class Agent:
    """Takes what is posted."""

    def __init__(self) -> None:
        self.words = Queue[Any]()

    def __call__(self, content: Any, delay_s: float = 0.0) -> None:
        self.words.put(content)

    def publish(self, kind: str, data: bytes) -> None:
        raise AssertionError("skills publish nothing")


@pytest.fixture
def agent() -> Agent:
    return Agent()


@pytest.fixture
def device(agent: Agent, monkeypatch: pytest.MonkeyPatch) -> Iterator[SkillDevice]:
    monkeypatch.setattr(skill_device, "REST_S", 0.3)
    made = SkillDevice(agent, Setup(), Renderer(load))
    yield made
    made.close()


def eventually(there: Callable[[], object]) -> bool:
    """Whether it is true before long."""
    end, waiting = time.monotonic() + WITHIN_S, threading.Event()
    while not there() and time.monotonic() < end:
        waiting.wait(0.02)
    return bool(there())


def ended(device: SkillDevice, agent: Agent, number: int) -> bool:
    """Carry an act out; whether it ends."""
    device.tell(look(number))
    while isinstance(word := agent.words.get(timeout=WITHIN_S), Move):
        assert device.pid
        device.tell(Feel(number, FELT))
    return isinstance(word, Ended)


def test_the_process_runs_for_acts_and_ends_after_a_rest(device: SkillDevice, agent: Agent) -> None:
    """None before the first act; acts that follow each other have the same one; the end is no
    crash.
    """
    assert not device.pid
    assert ended(device, agent, 1)
    assert eventually(lambda: not device.pid)
    assert ended(device, agent, 2)
    assert eventually(lambda: not device.pid)
    assert agent.words.empty()


def test_an_act_is_not_cut_short(device: SkillDevice, agent: Agent) -> None:
    """However long its motion takes."""
    device.tell(look(1))
    assert isinstance(agent.words.get(timeout=WITHIN_S), Move)
    pid = device.pid
    assert not device._rest.is_alive()
    device._rested()
    assert device.pid == pid


def test_after_a_drop_the_next_act_has_a_new_process(device: SkillDevice, agent: Agent) -> None:
    """And the one before is gone at once."""
    device.tell(look(1))
    assert isinstance(agent.words.get(timeout=WITHIN_S), Move)
    device.tell(Drop(1))
    assert not device.pid
    assert ended(device, agent, 2)
