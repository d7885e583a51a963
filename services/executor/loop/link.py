"""Shared memory between the loop and the rest: fixed slots in an mmap'ed file, each with a single
writer. The ends: `AgentLink` for the executor's agent, `StopLink` for people, `LoopLink` for the
loop.

A slot is a sequence number, a length and bytes. Its writer makes the number odd, writes, and makes
it even; a reader that sees an odd or a changed number reads again, so nobody waits for a lock. The
file outlives a process that dies. A new loop puts a new file in the same place; `LoopFile.replaced`
tells those who still hold the old one.

    command   agent -> loop    a motion, cancel or release, numbered by the slot itself
    beat      agent -> loop    a counter: the agent lives
    state     loop -> agent    LoopState, every few cycles
    told      loop -> agent    Told: what became of the last command, the present report
    truth     loop -> monitor  true state of the simulation; no agent may read it
    timing    loop -> monitor  how late the cycles were
"""

import mmap
import os
import struct
from pathlib import Path

import msgspec
import numpy as np

from agent_runtime.io.run_files import STOP_FILE, STOP_HELD, STOP_RELEASED, make_run
from companion.skills.loop_messages import Cancel, LookAgain, Mode, Motion, Refusal, Release, Report
from companion.telemetry import PageFaults
from velma.errors import SlotError
from velma.names import Array
from velma.sim.backend import State

MAGIC = b"VELMALP2"
_HEAD = struct.Struct("<QQ")  # sequence number, length
_COUNT = struct.Struct("<Q")

# Capacities in bytes. A motion of two minutes has 12000 knots of 120 bytes.
SIZES = {
    "command": 4 << 20,
    "beat": 8,
    "state": 16 << 10,
    "told": 16 << 10,
    "truth": 16 << 10,
    "timing": 16 << 10,
}
# a write takes microseconds; after this many failed reads the writer must have died in the middle
READ_TRIES = 50


class Slot:
    """One slot of a mapped file."""

    def __init__(self, view: memoryview) -> None:
        self._view, self.capacity = view, len(view) - _HEAD.size

    @property
    def number(self) -> int:
        """The sequence number: grows by 2 with each record; 0 before the first, odd during a
        write.
        """
        return int(_HEAD.unpack_from(self._view)[0])

    def write(self, record: bytes | bytearray | memoryview) -> int:
        """Replace the record (only one writer per slot); return its number. Raises SlotError if it
        does not fit.
        """
        if len(record) > self.capacity:
            raise SlotError("", f"a record of {len(record)} bytes", f"at most {self.capacity}")
        number = self.number | 1  # correct also after a writer that died in the middle
        _COUNT.pack_into(self._view, 0, number)
        self._view[_HEAD.size : _HEAD.size + len(record)] = record
        _HEAD.pack_into(self._view, 0, number, len(record))
        _COUNT.pack_into(self._view, 0, number + 1)
        return number + 1

    def read(self) -> tuple[int, bytes] | None:
        """Return the record and its number; None before the first one, or if it cannot be read
        whole.
        """
        for _ in range(READ_TRIES):
            number, length = _HEAD.unpack_from(self._view)
            if number == 0:
                return None
            if number % 2 == 0 and length <= self.capacity:
                record = bytes(self._view[_HEAD.size : _HEAD.size + length])
                if self.number == number:
                    return number, record
        return None


def begun(path: Path, size: int) -> tuple[int, Path]:
    """Return a new file that will be mapped, open, and its name until it takes the place of `path`;
    its owner's alone.

    All of its `size` [bytes] is on the disk: a write to a mapped page for which there is no room
    ends the process with SIGBUS. Raise OSError where there is none.
    """
    fresh = path.with_name(f".{path.name}.{os.getpid()}")
    file = os.open(fresh, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o600)
    try:
        os.posix_fallocate(file, 0, size)
    except OSError:
        os.close(file)
        fresh.unlink()
        raise
    return file, fresh


class LoopFile:
    """A mapped slot file, `slots` by name."""

    def __init__(self, path: Path, file: int) -> None:
        self.path, self._identity = path, os.fstat(file).st_ino
        try:
            self._map = mmap.mmap(file, _layout()[1])
        finally:
            os.close(file)
        self._view = memoryview(self._map)
        self.slots = {
            name: Slot(self._view[start:end]) for name, (start, end) in _layout()[0].items()
        }

    @classmethod
    def create(cls, path: Path) -> "LoopFile":
        """Return a new, empty file in place of any old one; only its owner can read it."""
        make_run(path.parent)
        file, fresh = begun(path, _layout()[1])
        os.pwrite(file, MAGIC, 0)
        os.replace(fresh, path)
        return cls(path, file)

    @classmethod
    def open(cls, path: Path) -> "LoopFile":
        """Return the file of a running loop. Raises SlotError."""
        try:
            file = os.open(path, os.O_RDWR)
        except FileNotFoundError:
            raise SlotError(
                str(path), "no such file", "the file of a running loop; start the loop first"
            ) from None
        size, magic = os.fstat(file).st_size, os.pread(file, len(MAGIC), 0)
        if size != _layout()[1] or magic != MAGIC:
            os.close(file)
            expected = f"{_layout()[1]} bytes beginning {MAGIC!r}"
            raise SlotError(str(path), f"{size} bytes beginning {magic!r}", expected)
        return cls(path, file)

    @property
    def replaced(self) -> bool:
        """Whether another loop has replaced the file since; then open it again."""
        try:
            return self.path.stat().st_ino != self._identity
        except FileNotFoundError:
            return True

    def close(self) -> None:
        """Close the mapping."""
        for slot in self.slots.values():
            slot._view.release()
        self._view.release()
        self._map.close()


def _layout() -> tuple[dict[str, tuple[int, int]], int]:
    """Return start and end of each slot, and the size of the file. Slots start on cache lines."""
    places, at = {}, 64
    for name, size in SIZES.items():
        end = at + _HEAD.size + size
        places[name] = (at, end)
        at = -(-end // 64) * 64
    return places, at


class Counter:
    """A counter that only grows, 8 bytes in a slot."""

    def __init__(self, slot: Slot) -> None:
        self._slot = slot

    def read(self) -> int:
        """Return the count."""
        found = self._slot.read()
        return int(_COUNT.unpack(found[1])[0]) if found else 0

    def add(self) -> None:
        """Add one (only one writer per slot)."""
        self._slot.write(_COUNT.pack(self.read() + 1))


def packed(struct_: msgspec.Struct) -> bytes:
    """Return the bytes of a record."""
    return _ENCODE(struct_)


_ENCODE = msgspec.msgpack.Encoder().encode

# --- Both ends of the slot file -------------------------------------------------------------------


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
