"""An agent run again from its step log, offline: whether each step puts out the bytes that it put out then.

A process of the agent does this instead of serving (`--replay LOG`): it runs the code that the fleet runs, without a
router, devices or a clock. What devices said is in the log.
"""

import hashlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec

from agent_runtime.core.agent import Agent
from agent_runtime.core.effects import Deed, Effects, Receipt
from agent_runtime.core.step import Core
from agent_runtime.core.wiring import Wiring
from agent_runtime.io.steplog import BOOT, Step, booted, fingerprint, read, replay
from fipa_codec.communicate import Communicate, encode

DIGEST_BYTES = 16
_encoder = msgspec.msgpack.Encoder(enc_hook=repr)


class Put(msgspec.Struct, frozen=True):
    """Output of a step run now. `sends`: as on the wire; `tells`: the words to the devices, as they are hashed."""

    record: bytes | None
    receipts: tuple[Receipt, ...]
    sends: tuple[bytes, ...]
    tells: bytes
    deed: Deed | None


class Parted(msgspec.Struct, frozen=True):
    """The first step that puts out something else than what the log says.

    `output`: the hash in the log; `deed`: what was done then. `before`: the journal record that was written last before
    it. `now` None: the step could not be run, and `error` says why.
    """

    incarnation: int
    step: int
    at: float
    kind: str
    output: bytes
    deed: Deed | None
    before: bytes
    now: Put | None
    error: str = ""


class Word(msgspec.Struct, frozen=True):
    """A communicate that a step put out: which step, to whom, its id, and what tells its bytes from any other."""

    incarnation: int
    step: int
    at: float
    kind: str
    receiver: str
    id: str
    digest: bytes


class Again(msgspec.Struct, frozen=True):
    """An agent's lives, run again up to the first difference (`parted`; None: there is none). `said`: copies too."""

    agent: str
    lives: int
    steps: int
    said: tuple[Word, ...]
    parted: Parted | None


class _Gap(Exception):
    """The log lacks steps."""


class _Reader:
    """Steps on their way from the log; `at`: the newest; `lives`: begun so far; `before`: the last journal record."""

    def __init__(self, core: Core[Any], path: Path) -> None:
        self._core, self._path = core, path
        self.at: Step | None = None
        self.lives, self.before = 0, b""

    def steps(self) -> Iterator[Step]:
        """All of them. Raises _Gap where one does not follow the one before."""
        for step in read(self._path):
            was, self.at = self.at, step
            if step.kind == BOOT:
                self.lives += 1
                self.before = self._core.record(booted(self._core, step.input))
            elif was is None or (step.incarnation, step.step) != (was.incarnation, was.step + 1):
                raise _Gap(f"the log goes on with step {step.step} of life {step.incarnation}; steps are missing")
            yield step


def digest(wire: bytes) -> bytes:
    """Return what tells a communicate on the wire from any other."""
    return hashlib.blake2b(wire, digest_size=DIGEST_BYTES).digest()


def again(core: Core[Any], path: Path) -> Again:
    """Run all lives in a log up to the first step that differs."""
    reader, count, parted = _Reader(core, path), 0, None
    said: list[Word] = []
    try:
        for step, effects in replay(core, reader.steps()):
            if fingerprint(effects) != step.output:
                parted = _parted(step, reader.before, _put(effects))
                break
            count += 1
            said += [_word(step, one) for one in effects.sends]
            reader.before = reader.before if effects.record is None else effects.record
    except Exception as error:  # any mistake of the agent's own code is the difference that is looked for
        step = reader.at or Step(0, 0, 0.0, BOOT, b"")
        parted = _parted(step, reader.before, None, str(error) or type(error).__name__)
    return Again(core.agent.name, reader.lives, count, tuple(said), parted)


def _word(step: Step, one: Communicate) -> Word:
    return Word(step.incarnation, step.step, step.at, step.kind, one.receiver, one.id, digest(encode(one)))


def _put(effects: Effects) -> Put:
    sends = tuple(encode(one) for one in effects.sends)
    return Put(effects.record, effects.receipts, sends, _encoder.encode(effects.tells), effects.deed)


def _parted(step: Step, before: bytes, now: Put | None, error: str = "") -> Parted:
    return Parted(step.incarnation, step.step, step.at, step.kind, step.output, step.deed, before, now, error)


def tell(agent: Agent[Any], wiring: Wiring, path: Path) -> int:
    """Print an `Again` in MessagePack; return the exit status."""
    sys.stdout.buffer.write(msgspec.msgpack.encode(again(Core(agent, wiring), path)))
    sys.stdout.flush()
    return 0
