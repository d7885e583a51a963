"""The memory of the loop between two cycles, and of the simulated world: a new loop goes on where a
killed one was.

Saved after every cycle, by turns in two slots of a file beside those of the agent: one of them is
whole whenever the loop is killed. The motion is saved once, when it begins. The file is that of one
world: its fingerprint (scene, simulator) and its epoch, a name that a world has from its beginning
to its end.

A real robot has no such memory: its world does not end with the process.
"""

import mmap
import os
import struct
import uuid
from collections.abc import Callable
from operator import attrgetter
from pathlib import Path
from typing import Any, Protocol, Self, runtime_checkable

import msgspec
import numpy as np

from companion.skills.loop_messages import Close, Mode, Motion, Report, Until
from services.executor.loop.act import RunningMotion
from services.executor.loop.core import LoopCore
from services.executor.loop.hands import Activity
from services.executor.loop.link import Slot, begun
from velma.control.grip import Pull, Watch

MEMORY = "loop.memory"
"""Name of the file, beside the slots."""
MAGIC = b"VELMAWM7"
_HEAD = struct.Struct("<8s32s16s")  # magic, fingerprint of the world, its epoch
_PLACES = {
    "motion": (64, 4 << 20),
    "even": ((4 << 20) + 64, 5 << 20),
    "odd": ((5 << 20) + 64, 6 << 20),
}
"""Start and end of the slots [bytes]. A world of 60 grains, the most, has 20 kB where they spin."""
_TOUCHED = 1 << 20
"""First bytes of the file, a motion of 80 s, that are in memory from the start: else they are read
as one begins.
"""


@runtime_checkable
class Restorable(Protocol):
    """A back-end whose world ends with the process, and can be saved and restored exactly."""

    @property
    def fingerprint(self) -> bytes:
        """32 bytes that are the same for the same scene and simulator only."""
        ...

    def save(self) -> bytes:
        """Return the whole state between two steps."""
        ...

    def restore(self, saved: bytes) -> None:
        """Take up a saved state; the next step has the same result as it would have had then."""
        ...


class _Saved(msgspec.Struct, frozen=True, array_like=True):
    """Attributes of an object of the loop, by their names with or without a leading underscore;
    arrays as bytes.
    """

    @classmethod
    def of(cls, one: object) -> Self:
        """Return the present values; arrays as they are, to be encoded before the next cycle."""
        read = _READERS.get(cls)
        if read is None:
            values = vars(one)
            read = _READERS[cls] = attrgetter(
                *[n if n in values else f"_{n}" for n in cls.__struct_fields__]
            )
        return cls(*read(one))

    def give(self, one: object) -> None:
        """Set them."""
        values = vars(one)
        for name in self.__struct_fields__:
            key = name if name in values else f"_{name}"
            values[key] = _alike(values[key], getattr(self, name))


_READERS: dict[type[_Saved], Callable[[object], tuple[Any, ...]]] = {}
"""Class -> function that reads its values from an object. Made once: `of` runs in each cycle."""


def _plain(value: Any) -> Any:
    """Return a value of numpy as msgspec knows it."""
    return value.tobytes() if isinstance(value, np.ndarray) else value.item()


def _alike(before: Any, value: Any) -> Any:
    if isinstance(before, np.ndarray):
        return np.frombuffer(value, dtype=before.dtype).reshape(before.shape).copy()
    return list(value) if isinstance(before, list) else value


class _Core(_Saved, frozen=True, array_like=True):
    setpoint: bytes
    head_target: bytes
    head_goal: bytes
    head_speed: float
    mode: Mode
    dwell: int
    release: bool
    fast: int
    stopped: bool
    cycles: int
    saturated: int
    faults: int
    last_fault: str
    report: Report


class _Fingers(_Saved, frozen=True, array_like=True):
    motor: bytes
    goal: bytes
    speed: bytes
    spread: bytes
    spread_goal: bytes
    locked: bytes
    touched: bytes
    pushing: bytes
    stalling: bytes
    activity: list[Activity]
    closing: list[Close | None]
    left_s: list[float]


class _Payloads(_Saved, frozen=True, array_like=True):
    mass: bytes
    lever: bytes
    goal: bytes


class _Grips(_Saved, frozen=True, array_like=True):
    sensed: bool
    felt: bytes
    error: bytes
    low: bytes
    high: bytes
    load: bytes
    down: list[bool]
    watch: list[Watch]
    wanted_n: list[float]
    wanted_s: list[float]
    pull: list[Pull]
    pull_n: list[float]
    beside: bytes


class _Impedance(_Saved, frozen=True, array_like=True):
    damping: bytes
    age: int


class _Act(_Saved, frozen=True, array_like=True):
    began_s: float
    cancelled: bool
    ended_by: Until | None
    settling_s: float | None
    late_s: float | None
    largest: list[float]
    below_at_start: float | None
    look_s: float


class _Track(_Saved, frozen=True, array_like=True):
    offset: bytes
    time: float
    since: float
    rate: float
    wanted: float
    braked: bool
    q: bytes
    v: bytes


class LoopMemory(msgspec.Struct, frozen=True, array_like=True):
    """The memory of a core and its world between two cycles; `number` counts, `act` is None without
    a motion.
    """

    number: int
    world: bytes
    core: _Core
    fingers: _Fingers
    payloads: _Payloads
    grips: _Grips
    wrists: bytes
    impedance: _Impedance
    act: _Act | None
    track: _Track | None

    @classmethod
    def of(cls, number: int, core: LoopCore, world: bytes) -> Self:
        """Return the memory of a core now."""
        act = core.act
        return cls(
            number,
            world,
            _Core.of(core),
            _Fingers.of(core.fingers),
            _Payloads.of(core.payloads),
            _Grips.of(core.grips),
            core.grips.wrists.record.values,
            _Impedance.of(core.impedance),
            None if act is None else _Act.of(act),
            None if act is None or act.track is None else _Track.of(act.track),
        )

    def give(self, core: LoopCore, motion: Motion | None) -> None:
        """Let a new core go on from here; `motion` is the one that ran, if any."""
        self.core.give(core)
        self.fingers.give(core.fingers)
        self.payloads.give(core.payloads)
        self.grips.give(core.grips)
        core.grips.wrists.take(self.wrists)
        self.impedance.give(core.impedance)
        if self.act is None or motion is None:
            return
        core.act = act = RunningMotion(motion, motion.path()[0], self.act.began_s)
        self.act.give(act)
        if self.track is None or act.track is None:
            act.track = None
        else:
            self.track.give(act.track)


_encode = msgspec.msgpack.Encoder(enc_hook=_plain).encode
_decode = msgspec.msgpack.Decoder(LoopMemory).decode
_motion = msgspec.msgpack.Decoder(Motion).decode


class Keeper:
    """Saves the memory of a core after each cycle; `epoch` names its world, `restored` tells
    whether it was found.
    """

    def __init__(self, path: Path, core: LoopCore, backend: Restorable) -> None:
        """Restore the core from the file, or begin a new world where there is none of the same
        scene and simulator.
        """
        self._core, self._backend = core, backend
        found = _opened(path, backend.fingerprint)
        self._file, self.epoch = found or _begun(path, backend.fingerprint)
        for at in range(0, _TOUCHED, mmap.PAGESIZE):
            self._file[at] = self._file[at]
        view = memoryview(self._file)
        self._slots = {name: Slot(view[start:end]) for name, (start, end) in _PLACES.items()}
        self._running: RunningMotion | None = None
        self._number = 0
        self.restored = found is not None and self._recall()

    def save(self) -> None:
        """Save now: 24 us after a cycle (benchmarks/loop.py, 2026-11-23); 35, busy, before it 46
        (2026-11-27).
        """
        core = self._core
        if core.act is not self._running:
            self._running = core.act
            if core.act is not None:
                self._slots["motion"].write(_encode(core.act.motion))
        self._number += 1
        memory = _encode(LoopMemory.of(self._number, core, self._backend.save()))
        self._slots["odd" if self._number % 2 else "even"].write(memory)

    def _recall(self) -> bool:
        found = [slot.read() for slot in (self._slots["even"], self._slots["odd"])]
        memories = [_decode(record[1]) for record in found if record is not None]
        if not memories:
            return False
        newest = max(memories, key=lambda memory: memory.number)
        self._number = newest.number
        said = self._slots["motion"].read()
        self._backend.restore(newest.world)
        self._core.state = self._core.backend.observe()
        newest.give(self._core, None if said is None else _motion(said[1]))
        self._running = self._core.act
        return True


def _opened(path: Path, fingerprint: bytes) -> tuple[mmap.mmap, str] | None:
    """Return the file and the epoch of this world, if there is one."""
    try:
        file = os.open(path, os.O_RDWR)
    except FileNotFoundError:
        return None
    try:
        if os.fstat(file).st_size != _PLACES["odd"][1]:
            return None
        magic, print_, epoch = _HEAD.unpack(os.pread(file, _HEAD.size, 0))
        return (
            (mmap.mmap(file, 0), epoch.hex()) if (magic, print_) == (MAGIC, fingerprint) else None
        )
    finally:
        os.close(file)


def _begun(path: Path, fingerprint: bytes) -> tuple[mmap.mmap, str]:
    """Return a new file in place of any other, and a new epoch; only its owner can read it."""
    epoch, (file, fresh) = uuid.uuid4(), begun(path, _PLACES["odd"][1])
    try:
        os.pwrite(file, _HEAD.pack(MAGIC, fingerprint, epoch.bytes), 0)
        os.replace(fresh, path)
        return mmap.mmap(file, 0), epoch.hex
    finally:
        os.close(file)
