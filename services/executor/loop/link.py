"""Both ends of the slot file: `AgentLink` for the executor's agent, `StopLink` for people,
`LoopLink` for the loop.
"""

import mmap
import os
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from agent_runtime.io.run_files import STOP_FILE, STOP_HELD, STOP_RELEASED
from companion.skills.loop_messages import Cancel, LookAgain, Mode, Motion, Refusal, Release, Report
from companion.telemetry import PageFaults
from services.executor.loop.slots import Counter, LoopFile, packed
from velma.sim.backend import State

Array = NDArray[np.float64]
LoopCommand = Motion | Cancel | LookAgain | Release


class LoopState(msgspec.Struct, frozen=True):
    """The robot as the loop sees it. Arrays travel as float64 bytes; read them with the methods."""

    time_s: float  # simulated
    cycles: int
    mode: Mode
    busy: bool
    work_J: float
    faults: int
    last_fault: str
    saturated: int  # cycles whose torque was cut to what the lower level accepts
    body: bytes  # q, v, set-point: (3, 15)
    hands: bytes  # head 2, spread 2, proximal 6, distal 6
    world: bytes  # every coordinate of the world model, for the receptor's mirror
    epoch: str = ""  # name of the simulated world, from its beginning to its end; "" for a real one

    @property
    def q(self) -> Array:
        """Return the measured joints (15,) [rad]."""
        return np.frombuffer(self.body, count=15)

    @property
    def v(self) -> Array:
        """Return the measured speeds (15,) [rad/s]."""
        return np.frombuffer(self.body, offset=15 * 8, count=15)

    @property
    def setpoint(self) -> Array:
        """Return the set-points of the joints (15,) [rad]: a motion starts here."""
        return np.frombuffer(self.body, offset=30 * 8, count=15)

    @property
    def head(self) -> Array:
        """Return pan and tilt (2,) [rad]."""
        return np.frombuffer(self.hands, count=2)

    def fingers(self, row: int) -> tuple[Array, Array]:
        """Return proximal and distal joints, (3,) each [rad], of a hand (0 right, 1 left)."""
        proximal = np.frombuffer(self.hands, offset=(4 + 3 * row) * 8, count=3)
        return proximal, np.frombuffer(self.hands, offset=(10 + 3 * row) * 8, count=3)

    @property
    def configuration(self) -> Array:
        """Return the coordinates of the world model (nq,); empty without one."""
        return np.frombuffer(self.world)


class LoopAnswer(msgspec.Struct, frozen=True):
    """The loop's answer: number of the last command taken, its refusal if any, the report of the
    motion.

    `look`: a look at the motion is due; the state that was published before this is that of its
    time.
    """

    taken: int = 0
    refusal: Refusal | None = None
    report: Report = Report()
    look: bool = False


class Timing(msgspec.Struct, frozen=True):
    """Lateness of cycles against their deadlines [us]. `missed`: cycles whose command came after
    the next deadline.
    """

    cycles: int = 0
    missed: int = 0
    skipped: int = 0  # periods that were skipped after a long delay
    lateness_us: dict[str, float] = {}  # p50, p99, p999, max
    compute_us: dict[str, float] = {}
    realtime: bool = False
    rested: int = 0  # periods of a simulated world that stands still, which were not computed
    page_faults: PageFaults = PageFaults()


_STATE = msgspec.msgpack.Decoder(LoopState).decode
_TOLD = msgspec.msgpack.Decoder(LoopAnswer).decode
_TIMING = msgspec.msgpack.Decoder(Timing).decode
_COMMAND = msgspec.msgpack.Decoder(LoopCommand).decode


class AgentLink:
    """The end of the agent."""

    def __init__(self, path: Path) -> None:
        """Raise SlotError if there is no file of a loop of this version."""
        self.file = LoopFile.open(path)
        self._beat = Counter(self.file.slots["beat"])

    def send(self, command: LoopCommand) -> int:
        """Send a command; return its number. Wait until `told().taken` shows it before sending the
        next.
        """
        return self.file.slots["command"].write(packed(command))

    def beat(self) -> None:
        """Send a heartbeat: at least every 50 ms during an act."""
        self._beat.add()

    def state(self) -> LoopState | None:
        """Return the newest state; None before the first cycle of the loop."""
        found = self.file.slots["state"].read()
        return _STATE(found[1]) if found else None

    def told(self) -> LoopAnswer:
        """Return what the loop told last."""
        found = self.file.slots["told"].read()
        return _TOLD(found[1]) if found else LoopAnswer()

    def sealed_truth(self) -> bytes:
        """Return the newest truth, encoded, for the monitor; the agent must not read it. Empty if
        there is none.
        """
        found = self.file.slots["truth"].read()
        return found[1] if found else b""

    def timing(self) -> Timing:
        """Return the deadline statistics so far."""
        found = self.file.slots["timing"].read()
        return _TIMING(found[1]) if found else Timing()


def reopened(link: AgentLink | None, path: Path) -> AgentLink:
    """The link to the loop, or another one where a new loop has replaced its file. Raise SlotError
    where none is.
    """
    if link is not None and not link.file.replaced:
        return link
    newer = AgentLink(path)  # where this raises, the old one stays open, and is asked again
    if link is not None:
        link.file.close()
    return newer


class StopLink:
    """The end of a person: one byte in a file beside the slots (docs/run-folder.md). It works with
    every agent dead.

    `path`: the slot file. The byte is written in place, since the loop has the file mapped.
    """

    def __init__(self, path: Path) -> None:
        self._file = os.open(path.with_name(STOP_FILE), os.O_RDWR | os.O_CREAT, 0o600)
        if os.fstat(self._file).st_size == 0:
            os.pwrite(self._file, STOP_RELEASED, 0)
        self._byte = mmap.mmap(self._file, 1)

    def stop(self) -> None:
        """Hold the robot where it is."""
        os.pwrite(self._file, STOP_HELD, 0)

    def release(self) -> None:
        """End the stop; the loop leaves it when its dwell time is over."""
        os.pwrite(self._file, STOP_RELEASED, 0)

    @property
    def held(self) -> bool:
        """Whether a stop is requested."""
        return self._byte[:1] == STOP_HELD


class LoopLink:
    """The end of the loop: reads new commands, publishes states."""

    def __init__(self, path: Path) -> None:
        self.file = LoopFile.create(path)
        self._slots = self.file.slots
        self._beat, self._stop = Counter(self._slots["beat"]), StopLink(path)
        self._taken, self.held = 0, False
        self._body, self._hands = np.zeros((3, 15)), np.zeros(16)

    def command(self) -> tuple[int, LoopCommand | msgspec.DecodeError] | None:
        """Return the next command with its number, once; a DecodeError in place of bytes that are
        no command.
        """
        slot = self._slots["command"]
        if slot.number in (self._taken, self._taken + 1):
            return None
        found = slot.read()
        if found is None or found[0] == self._taken:
            return None
        self._taken = found[0]
        try:
            return found[0], _COMMAND(found[1])
        except msgspec.DecodeError as error:
            return found[0], error

    def people(self) -> tuple[bool, bool]:
        """Return whether a stop, and whether a release, was requested since the last call."""
        before, self.held = self.held, self._stop.held
        return self.held and not before, before and not self.held

    def heartbeat(self) -> int:
        """Return the heartbeat counter of the agent."""
        return self._beat.read()

    def show_state(self, state: State, setpoint: Array, rest: LoopState) -> None:
        """Publish a state; `rest` has all fields that are no arrays."""
        self._body[0], self._body[1], self._body[2] = state.q, state.v, setpoint
        self._hands[:2], self._hands[2:4] = state.head, state.spread
        self._hands[4:10], self._hands[10:] = state.proximal.ravel(), state.distal.ravel()
        body, hands = self._body.tobytes(), self._hands.tobytes()
        self._slots["state"].write(packed(msgspec.structs.replace(rest, body=body, hands=hands)))

    def show(self, slot: str, record: msgspec.Struct) -> None:
        """Publish told, truth or timing."""
        self._slots[slot].write(packed(record))
