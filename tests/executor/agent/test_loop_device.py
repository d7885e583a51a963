"""The agent's way to the loop: what is asked is done by a loop process (turned in a thread, with a
pretended robot).
"""

import queue
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from companion.languages.facts import Kind, fact
from companion.skills.loop_messages import FAULT, Mode, Phase, Release, motion
from services.executor import loop_device
from services.executor.device_messages import (
    Brake,
    Do,
    Felt,
    GoOn,
    Halt,
    Lost,
    Moved,
    Passing,
    Stands,
    Where,
)
from services.executor.loop.core import LoopCore
from services.executor.loop.link import AgentLink, LoopLink, StopLink
from services.executor.loop.process import LoopProcess, Speed
from services.executor.loop.slots import Counters
from services.executor.loop.timing import Pacer
from services.executor.loop_device import LoopDevice
from services.executor.telemetry import robot_state
from velma.sim.mock_backend import MockBackend

PATIENCE_S = 20.0


class Turned:
    """A loop that turns in a thread until it is ended."""

    def __init__(self, path: Path) -> None:
        self.path = path
        backend = MockBackend()
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

    def end(self) -> None:
        self._over.set()
        self.awake.set()
        self._thread.join()


class Heard:
    """A post that keeps what was said."""

    def __init__(self) -> None:
        self.words: queue.Queue[object] = queue.Queue()

    def __call__(self, content: object, delay_s: float = 0.0) -> None:
        self.words.put(content)

    def publish(self, kind: str, data: bytes) -> None:
        """Not wanted here."""

    def next(self) -> object:
        return self.words.get(timeout=PATIENCE_S)


def until(so: Callable[[], bool]) -> None:
    """Look again and again, and leave the loop's thread the interpreter meanwhile."""
    deadline = time.monotonic() + PATIENCE_S
    while not so():
        assert time.monotonic() < deadline
        threading.Event().wait(0.005)


@pytest.fixture
def slots(tmp_path: Path) -> Path:
    return tmp_path / "loop.slots"


@pytest.fixture
def turned(slots: Path) -> Iterator[Turned]:
    loop = Turned(slots)
    yield loop
    loop.end()


@pytest.fixture
def heard() -> Heard:
    return Heard()


@pytest.fixture
def reach(heard: Heard, slots: Path) -> Iterator[LoopDevice]:
    device = LoopDevice(heard, slots)
    yield device
    device.close()


def where(reach: LoopDevice, heard: Heard) -> Felt:
    """Return the robot's state."""
    reach.tell(Where(1))
    word = heard.next()
    assert isinstance(word, Stands), word
    return word.felt


def path(felt: Felt, seconds: float, to: float = 0.3) -> np.ndarray:
    """The head of the right arm turned a little, over some simulated seconds."""
    q = np.tile(felt.setpoint(), (int(100 * seconds) + 1, 1))
    q[:, 7] += np.linspace(0.0, to, len(q))
    return q


def test_a_motion_is_done(turned: Turned, reach: LoopDevice, heard: Heard) -> None:
    """The robot's state afterwards is the one that the loop was asked for."""
    felt = where(reach, heard)
    reach.tell(Do(1, motion("a", path(felt, 0.5))))
    word = heard.next()
    assert isinstance(word, Moved)
    assert (word.felt.ended, word.number) == ("done", 1)
    assert word.felt.setpoint()[7] == pytest.approx(felt.setpoint()[7] + 0.3, abs=1e-6)


def test_two_motions_of_one_key(turned: Turned, reach: LoopDevice, heard: Heard) -> None:
    """The report of an act's first motion is not taken for that of the second."""
    felt = where(reach, heard)
    reach.tell(Do(1, motion("a", path(felt, 0.3))))
    first = heard.next()
    assert isinstance(first, Moved)
    reach.tell(Do(1, motion("a", path(first.felt, 0.3))))
    second = heard.next()
    assert isinstance(second, Moved)
    assert second.felt.setpoint()[7] == pytest.approx(felt.setpoint()[7] + 0.6, abs=1e-6)


def test_a_motion_is_braked(turned: Turned, reach: LoopDevice, heard: Heard) -> None:
    """A cancel brings it to rest before its end, as a cancelled one."""
    felt = where(reach, heard)
    reach.tell(Do(1, motion("a", path(felt, 60.0))))
    reach.tell(Brake(1, "a"))
    word = heard.next()
    assert isinstance(word, Moved)
    assert word.felt.ended == "cancelled"


def test_a_motion_is_looked_at(turned: Turned, reach: LoopDevice, heard: Heard) -> None:
    """At speed max exactly as often as is asked for, whatever the answers take; after the last one
    it is done.
    """
    felt = where(reach, heard)
    reach.tell(Do(1, motion("a", path(felt, 1.0), look_every_s=0.25)))
    at = []
    while isinstance(word := heard.next(), Passing):
        assert (word.number, word.felt.ended) == (1, "running")
        at.append(word.felt.time - felt.time)
        reach.tell(GoOn(1, "a", 0.25))
    assert isinstance(word, Moved)
    assert word.felt.ended == "done"
    assert np.diff(at) == pytest.approx(0.25, abs=0.003)
    assert len(at) >= 4


def test_a_look_may_take_long(
    turned: Turned, reach: LoopDevice, heard: Heard, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Longer than a loop may stand still; it is asked for once, and the loop is not taken for
    dead.
    """
    monkeypatch.setattr(loop_device, "SILENT_S", 0.05)
    felt = where(reach, heard)
    reach.tell(Do(1, motion("a", path(felt, 0.5), look_every_s=0.3)))
    assert isinstance(heard.next(), Passing)
    beats = Counters(AgentLink(turned.path).file.slots["beat"], 1)
    first = beats.read()[0]
    until(lambda: beats.read()[0] > first + 20)
    assert heard.words.empty()
    reach.tell(GoOn(1, "a", 60.0))
    word = heard.next()
    assert isinstance(word, Moved), word


def test_a_look_brakes_the_motion(turned: Turned, reach: LoopDevice, heard: Heard) -> None:
    """A late answer to it does not touch the next motion of the same act."""
    felt = where(reach, heard)
    reach.tell(Do(1, motion("a", path(felt, 20.0), look_every_s=0.3)))
    assert isinstance(heard.next(), Passing)
    reach.tell(Brake(1, "a"))
    word = heard.next()
    assert isinstance(word, Moved)
    assert word.felt.ended == "cancelled"
    assert word.felt.time - felt.time < 1.0
    reach.tell(Brake(1, "a"))
    reach.tell(GoOn(1, "a", 0.1))
    reach.tell(Do(1, motion("a", path(word.felt, 0.3))))
    word = heard.next()
    assert isinstance(word, Moved)
    assert word.felt.ended == "done"


def test_a_refused_motion_has_failed(turned: Turned, reach: LoopDevice, heard: Heard) -> None:
    """A motion that begins elsewhere is refused by the loop, with its reason."""
    felt = where(reach, heard)
    reach.tell(Do(1, motion("a", path(felt, 0.3) + 1.0)))
    word = heard.next()
    assert isinstance(word, Moved)
    assert word.felt.ended == "failed"
    assert word.felt.why == (fact(Kind.MOTION_REFUSED, "first_knot"),)
    assert "set-point" in word.felt.text


def test_a_motion_too_long_for_the_slot(turned: Turned, reach: LoopDevice, heard: Heard) -> None:
    """It has failed, with the sizes for the log, and the next one is served."""
    felt = where(reach, heard)
    reach.tell(Do(1, motion("a", path(felt, 600.0))))
    word = heard.next()
    assert isinstance(word, Moved)
    assert word.felt.why == (fact(Kind.MOTION_REFUSED, "knots"),)
    assert "bytes" in word.felt.text
    where(reach, heard)


def test_a_fault_of_the_loop_is_told_with_its_words(
    turned: Turned, reach: LoopDevice, heard: Heard
) -> None:
    """The words are for the log."""
    felt = where(reach, heard)
    reach.tell(Do(1, motion("a", path(felt, 200.0))))
    until(lambda: turned.process.core.report.phase is Phase.RUNNING)
    turned.process.core.impedance.torque = lambda *_: np.full(15, np.nan)  # type: ignore[method-assign]
    word = heard.next()
    assert isinstance(word, Moved)
    assert (word.felt.ended, word.felt.why) == ("failed", FAULT)
    assert "torque" in word.felt.text


def test_a_new_loop_loses_the_motion(
    turned: Turned, reach: LoopDevice, heard: Heard, slots: Path
) -> None:
    """Another loop's file in the same place: nobody knows how the motion ended; the new loop is
    found at once.
    """
    felt = where(reach, heard)
    reach.tell(Do(1, motion("a", path(felt, 200.0))))
    # or the new loop would be given it
    until(lambda: turned.process.core.report.phase is Phase.RUNNING)
    turned.end()
    second = Turned(slots)
    word = heard.next()
    assert isinstance(word, Lost)
    assert isinstance(where(reach, heard), Felt)
    second.end()


def test_without_a_loop(reach: LoopDevice, heard: Heard, slots: Path) -> None:
    """`Where` is answered at once that there is none; `Halt` waits until there is one."""
    reach.tell(Where(1))
    word = heard.next()
    assert isinstance(word, Lost)
    assert word.why == (fact(Kind.ENDED, "loop"),)
    assert "does not run" in word.text
    reach.tell(Halt(2))
    loop = Turned(slots)
    assert isinstance(heard.next(), Stands)
    loop.end()


def test_halt_stops_what_moves(
    turned: Turned, reach: LoopDevice, heard: Heard, slots: Path
) -> None:
    """After a restart of the agent the motion of its former life is brought to rest."""
    felt = where(reach, heard)
    stranger = AgentLink(slots)
    number = stranger.send(motion("old", path(felt, 200.0)))
    while stranger.told().taken != number:
        pass
    reach.tell(Halt(3))
    word = heard.next()
    assert isinstance(word, Stands)
    assert AgentLink(slots).told().report.phase != "running"


def test_a_motion_that_was_lost_before_the_loop_took_it_never_begins(
    turned: Turned, reach: LoopDevice, heard: Heard, slots: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The loop stands still when it is sent; when it goes on, the robot stays, and the next motion
    is done.
    """
    monkeypatch.setattr(loop_device, "TAKEN_WITHIN_S", 0.1)
    felt = where(reach, heard)
    turned.awake.clear()
    until(lambda: not _turns(turned))
    reach.tell(Do(1, motion("lost", path(felt, 0.5))))
    assert isinstance(heard.next(), Lost)
    slot = AgentLink(slots).file.slots["command"]
    lost = slot.number
    reach.tell(Halt(1))
    until(lambda: slot.number > lost)
    turned.awake.set()
    assert isinstance(heard.next(), Stands)
    reach.tell(Do(2, motion("next", path(felt, 0.5, to=-0.3))))
    word = heard.next()
    assert isinstance(word, Moved), word
    assert word.felt.ended == "done", word.felt.why
    assert word.felt.setpoint()[7] == pytest.approx(felt.setpoint()[7] - 0.3, abs=1e-6)


def _turns(turned: Turned) -> bool:
    """Whether the loop still takes commands."""
    link = AgentLink(turned.path)
    number = link.send(Release())
    threading.Event().wait(0.02)
    return link.told().taken == number


def test_a_fault_is_released_and_a_stop_is_not(
    turned: Turned, reach: LoopDevice, heard: Heard, slots: Path
) -> None:
    """`Where` ends the hold after a lost heartbeat; a person's stop stays until a person ends
    it.
    """
    felt = where(reach, heard)
    stranger = AgentLink(slots)
    stranger.send(motion("nobody beats for this", path(felt, 200.0)))
    until(lambda: stranger.state().mode is not Mode.MOTION)
    where(reach, heard)
    assert stranger.state().mode is Mode.MOTION
    StopLink(slots).stop()
    until(lambda: stranger.state().mode is not Mode.MOTION)
    where(reach, heard)
    assert stranger.state().mode is Mode.STOPPED


def test_telemetry_shows_the_state(
    turned: Turned, reach: LoopDevice, heard: Heard, slots: Path
) -> None:
    """Measured joints, mode and act are those of the loop."""
    felt = where(reach, heard)
    link = AgentLink(slots)
    shown = robot_state(link.state(), link.told(), link.timing(), "Grasp")
    assert shown.body == tuple(np.frombuffer(felt.measured))
    assert (shown.mode, shown.act, shown.skill) == ("motion", "", "")
