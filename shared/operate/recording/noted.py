"""Reading of an agent's step log: messages it received, with the times of its own clock, and its starts.

Must not know: the recording.
"""

from collections.abc import Iterator
from pathlib import Path

import msgspec

from agent_runtime.core.effects import Receipt
from agent_runtime.core.errors import StepLogError
from agent_runtime.core.events import Arrived, Garbled, Receipted
from agent_runtime.io import steplog
from agent_runtime.io.steplog import BOOT
from fipa_codec.communicate import UNREADABLE, Communicate, encode
from fipa_codec.errors import FipaError
from operate.judging.judged import SYSTEM
from operate.recording.hearing import RECEIPT
from operate.recording.records import Garbage, House, Origin, Record, Token, spoken
from operate.system import System

TRAVEL_S = 60.0
"""Longest time from sending to taking for which `sent` is believed; estimate: outages of a minute are tried."""


def noted(path: Path, system: System) -> Iterator[Record]:
    """Yield what reached an agent, as it did, and its own lives; the step log may end anywhere."""
    try:
        for step in steplog.read(path):
            record = _record(step, path.stem, system)
            if record is not None:
                yield record
    except (*UNREADABLE, StepLogError, OSError):
        return


def said_at(sent: float, at: float) -> float:
    """Return when something was said that reached an agent at `at`: `sent` where that can be, else `at`."""
    return sent if at - TRAVEL_S < sent <= at else at


def _record(step: steplog.Step, agent: str, system: System) -> Record | None:
    match step.kind:
        case Arrived.__name__:
            return _arrived(msgspec.msgpack.decode(step.input, type=Arrived).communicate, step.at, agent, system)
        case Receipted.__name__:
            return _receipted(msgspec.msgpack.decode(step.input, type=Receipted), step.at, agent)
        case Garbled.__name__:
            told = msgspec.msgpack.decode(step.input, type=Garbled)
            return Garbage(told.key, 0, told.reason, step.at, b"", log=agent) if "/" in told.key else None
        case kind if kind == BOOT:
            return Token(agent, step.incarnation, True, step.at, steplog.journal_of(step.input))
    return None


def _arrived(one: Communicate, at: float, agent: str, system: System) -> Record | None:
    """The record of a communicate that reached an agent at `at`; one that the design has not, when it was sent."""
    try:
        wire = encode(one)
        return spoken(one, wire, at, system, Origin.STEPS)
    except LookupError as error:
        return Garbage(_key(one, system), len(wire), str(error), said_at(one.sent, at), wire, log=agent)
    except FipaError:
        return None


def _receipted(one: Receipted, at: float, agent: str) -> House:
    """The record of a receipt for what an agent said."""
    parts = {name: getattr(one, name) for name in Receipt.__struct_fields__ if name != "peer"}
    receipt = Receipt(agent, **parts)
    return House(RECEIPT, one.peer, agent, at, msgspec.msgpack.encode(receipt))


def _key(one: Communicate, system: System) -> str:
    """The key of a communicate that the design does not have, on no channel of it."""
    told = {name: str(getattr(one, name)) for name in ("sender", "receiver", "protocol", "performative")}
    return system.design.file.system.key.format(system=SYSTEM, channel="unknown", **told)
