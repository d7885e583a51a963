"""The agent's way to the loop: what is asked is done by a loop process (turned in a thread, with a
pretended robot).
"""

import threading
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from doubles import PostDouble, eventually

from companion.languages.facts import Kind, fact
from companion.skills.loop_messages import FAULT, Mode, Phase, Release, motion
from services.executor import devices
from services.executor.device_messages import (
    Brake,
    Do,
    GoOn,
    Halt,
    Lost,
    Moved,
    Passing,
    Stands,
    Where,
)
from services.executor.devices import LoopDevice
from services.executor.loop.core import LoopCore
from services.executor.loop.link import AgentLink, Counter, LoopLink, StopLink
from services.executor.loop.process import LoopProcess, Pacer, Speed
from services.executor.memory import Felt
from velma.sim.mock_backend import MockBackend


class Turned:
    """A loop that turns in a thread until it is ended."""

    def __init__(self, path: Path) -> None:
        self.path, backend = path, MockBackend()
        self.process = LoopProcess(
            LoopCore(backend),
            LoopLink(path),
            speed=Speed.MAX,
            truth=None,
            pacer=Pacer(backend.period_s),
        )
        self._over, self.awake = threading.Event(), threading.Event()
        self.awake.set()
        self._thread = threading.Thread(target=self._turn, daemon=True)
        self._thread.start()

    def _turn(self) -> None:
        while not self._over.is_set():
            self.awake.wait()
            self.process.turn()

    def runs(self) -> bool:
        return self.process.core.report.phase is Phase.RUNNING

    def end(self) -> None:
        self._over.set()
        self.awake.set()
        self._thread.join()


def until(so: Callable[[], bool]) -> None:
    assert eventually(so, 20.0)


@pytest.fixture
def slots(tmp_path: Path) -> Path:
    return tmp_path / "loop.slots"


@pytest.fixture
def turned(slots: Path) -> Iterator[Turned]:
    loop = Turned(slots)
    yield loop
    loop.end()


class Reach:
    """The device, and what it posts."""

    def __init__(self, slots: Path) -> None:
        self.post = PostDouble()
        self.device = LoopDevice(self.post, slots)
        self.tell = self.device.tell

    def gives(self, kind: type) -> Any:
        """The next word, which is of this kind."""
        word = self.post.next()
        assert isinstance(word, kind), word
        return word

    def where(self) -> Felt:
        """The robot's state."""
        self.tell(Where(1))
        felt: Felt = self.gives(Stands).felt
        return felt

    def moves(self, felt: Felt, seconds: float, to: float = 0.3, off: float = 0.0, **more: Any):
        """Have the head of the right arm turned a little, over some simulated seconds."""
        q = np.tile(felt.setpoint(), (int(100 * seconds) + 1, 1)) + off
        q[:, 7] += np.linspace(0.0, to, len(q))
        self.tell(Do(1, motion("a", q, **more)))

    def moved(self, ended: str) -> Felt:
        """What is felt as the motion ends so."""
        word = self.gives(Moved)
        assert (word.number, word.felt.ended) == (1, ended), word.felt.why
        felt: Felt = word.felt
        return felt


@pytest.fixture
def reach(slots: Path) -> Iterator[Reach]:
    made = Reach(slots)
    yield made
    made.device.close()


def test_two_motions_of_one_key_are_done(turned: Turned, reach: Reach) -> None:
    """The robot's state after each is the one that the loop was asked for; the report of the first
    is not taken for that of the second.
    """
    felt = before = reach.where()
    for way in (0.3, 0.6):
        reach.moves(felt, 0.3)
        felt = reach.moved("done")
        assert felt.setpoint()[7] == pytest.approx(before.setpoint()[7] + way, abs=1e-6)


def test_a_motion_is_braked(turned: Turned, reach: Reach) -> None:
    """A cancel brings it to rest before its end, as a cancelled one."""
    reach.moves(reach.where(), 60.0)
    reach.tell(Brake(1, "a"))
    reach.moved("cancelled")


def test_a_motion_is_looked_at(turned: Turned, reach: Reach) -> None:
    """At speed max exactly as often as is asked for, whatever the answers take; after the last one
    it is done.
    """
    felt = reach.where()
    reach.moves(felt, 1.0, look_every_s=0.25)
    at = []
    while isinstance(word := reach.post.next(), Passing):
        assert (word.number, word.felt.ended) == (1, "running")
        at.append(word.felt.time - felt.time)
        reach.tell(GoOn(1, "a", 0.25))
    assert isinstance(word, Moved)
    assert word.felt.ended == "done"
    assert np.diff(at) == pytest.approx(0.25, abs=0.003)
    assert len(at) >= 4


def test_a_look_may_take_long(
    turned: Turned, reach: Reach, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Longer than a loop may stand still; it is asked for once, and the loop is not taken for
    dead.
    """
    monkeypatch.setattr(devices, "SILENT_S", 0.05)
    reach.moves(reach.where(), 0.5, look_every_s=0.3)
    reach.gives(Passing)
    beats = Counter(AgentLink(turned.path).file.slots["beat"])
    first = beats.read()
    until(lambda: beats.read() > first + 20)
    assert reach.post.words.empty()
    reach.tell(GoOn(1, "a", 60.0))
    reach.gives(Moved)


def test_a_look_brakes_the_motion(turned: Turned, reach: Reach) -> None:
    """A late answer to it does not touch the next motion of the same act."""
    felt = reach.where()
    reach.moves(felt, 20.0, look_every_s=0.3)
    reach.gives(Passing)
    reach.tell(Brake(1, "a"))
    braked = reach.moved("cancelled")
    assert braked.time - felt.time < 1.0
    reach.tell(Brake(1, "a"))
    reach.tell(GoOn(1, "a", 0.1))
    reach.moves(braked, 0.3)
    reach.moved("done")


@pytest.mark.parametrize(
    ("seconds", "off", "why", "words"),
    [(0.3, 1.0, "first_knot", "set-point"), (600.0, 0.0, "knots", "bytes")],
    ids=["begins elsewhere", "too long for the slot"],
)
def test_a_refused_motion_has_failed(
    turned: Turned, reach: Reach, seconds: float, off: float, why: str, words: str
) -> None:
    """With the reason, and words for the log; the next one is served."""
    reach.moves(reach.where(), seconds, off=off)
    felt = reach.moved("failed")
    assert felt.why == (fact(Kind.MOTION_REFUSED, why),)
    assert words in felt.text
    reach.where()


def test_a_fault_of_the_loop_is_told_with_its_words(turned: Turned, reach: Reach) -> None:
    """The words are for the log."""
    reach.moves(reach.where(), 200.0)
    until(turned.runs)
    turned.process.core.impedance.torque = lambda *_: np.full(15, np.nan)  # type: ignore[method-assign]
    felt = reach.moved("failed")
    assert felt.why == FAULT
    assert "torque" in felt.text


def test_a_new_loop_loses_the_motion(turned: Turned, reach: Reach, slots: Path) -> None:
    """Another loop's file in the same place: nobody knows how the motion ended; the new loop is
    found at once.
    """
    reach.moves(reach.where(), 200.0)
    until(turned.runs)  # or the new loop would be given it
    turned.end()
    second = Turned(slots)
    reach.gives(Lost)
    reach.where()
    second.end()


def test_without_a_loop(reach: Reach, slots: Path) -> None:
    """`Where` is answered at once that there is none; `Halt` waits until there is one."""
    reach.tell(Where(1))
    word = reach.gives(Lost)
    assert word.why == (fact(Kind.ENDED, "loop"),)
    assert "does not run" in word.text
    reach.tell(Halt(2))
    loop = Turned(slots)
    reach.gives(Stands)
    loop.end()


def test_halt_stops_what_moves(turned: Turned, reach: Reach, slots: Path) -> None:
    """After a restart of the agent the motion of its former life is brought to rest."""
    stranger, q = AgentLink(slots), reach.where().setpoint()
    number = stranger.send(motion("old", np.tile(q, (20_000, 1))))
    until(lambda: stranger.told().taken == number)
    reach.tell(Halt(3))
    reach.gives(Stands)
    assert stranger.told().report.phase != "running"


def test_a_motion_that_was_lost_before_the_loop_took_it_never_begins(
    turned: Turned, reach: Reach, slots: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The loop stands still when it is sent; when it goes on, the robot stays, and the next motion
    is done.
    """
    monkeypatch.setattr(devices, "TAKEN_WITHIN_S", 0.1)
    felt, link = reach.where(), AgentLink(slots)
    turned.awake.clear()
    until(partial(_stands_still, link))
    reach.moves(felt, 0.5)
    reach.gives(Lost)
    slot = link.file.slots["command"]
    lost = slot.number
    reach.tell(Halt(1))
    until(lambda: slot.number > lost)
    turned.awake.set()
    reach.gives(Stands)
    reach.moves(felt, 0.5, to=-0.3)
    assert reach.moved("done").setpoint()[7] == pytest.approx(felt.setpoint()[7] - 0.3, abs=1e-6)


def _stands_still(link: AgentLink) -> bool:
    """Whether the loop takes no commands any more."""
    number = link.send(Release())
    threading.Event().wait(0.02)
    return link.told().taken != number


def test_a_fault_is_released_and_a_stop_is_not(turned: Turned, reach: Reach, slots: Path) -> None:
    """`Where` ends the hold after a lost heartbeat; a person's stop stays until a person ends
    it.
    """
    stranger, q = AgentLink(slots), reach.where().setpoint()

    def mode() -> Mode:
        state = stranger.state()
        assert state is not None
        return state.mode

    stranger.send(motion("nobody beats for this", np.tile(q, (20_000, 1))))
    until(lambda: mode() is not Mode.MOTION)
    reach.where()
    assert mode() is Mode.MOTION
    StopLink(slots).stop()
    until(lambda: mode() is not Mode.MOTION)
    reach.where()
    assert mode() is Mode.STOPPED
