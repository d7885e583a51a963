"""Dead letters of a run: communicates that nobody took, each with the reason.

From the step logs: what the design does not have, what was no communicate, questions that never
reached their receiver. From the agents' logs: what a receiver turned away. From their journals:
durable words that were never taken. All of it outlives restarts. Must not know: who looks at them.
"""

import time
from collections.abc import Iterator, Mapping
from pathlib import Path

import msgspec

from agent_runtime.core.state import Outgoing
from agent_runtime.io import journal
from fipa_codec.communicate import Communicate, decode_strictly, encode
from fipa_codec.errors import FipaError
from operate.recording.records import Garbage, Origin, Spoken
from operate.recording.run import Run
from operate.structs import alike
from operate.system import System
from operate.verdict_lines import Dead, DeadLetter

JOURNAL, LOGS = "journal", "logs"
ON_ITS_WAY_S = 5.0
"""Younger ones may still be taken: what is durable is sent again after 2 s at the latest
(core.streams).
"""
TURNED_AWAY = {
    "not for us": Dead.TURNED_AWAY,
    "no stream number": Dead.TURNED_AWAY,
    "inbox full": Dead.TURNED_AWAY,
    "not understood": Dead.NOT_UNDERSTOOD,
    "stray": Dead.OVER,
}
"""Events of an agent's log that tell of a communicate it did not take (agent_runtime.core.reception
and verdict).
"""
TOO_LONG = "TooLongError: "
"""Before the reason, in the last line of the traceback of an agent that was to send more than is
put.
"""


class _Line(msgspec.Struct):
    """The fields of a line of an agent's log that are read."""

    t: float
    event: str
    agent: str
    why: str = ""
    sender: str = ""
    performative: str = ""
    conversation: str = ""
    id: str = ""


class _Kept(msgspec.Struct):
    """The part of an agent's journal record that is read."""

    outbox: dict[str, tuple[Outgoing, ...]] = {}
    taken: dict[str, int] = {}


_line, _kept = msgspec.json.Decoder(_Line), msgspec.msgpack.Decoder(_Kept)


def letters(run: Run, now: float | None = None) -> list[DeadLetter]:
    """Return the dead letters of a run folder, in the order of time; at `now` [unix s], else at
    present.
    """
    now = time.time() if now is None else now
    said = {one.identity: one for one in run.records if isinstance(one, Spoken)}
    found = [
        *_unfit(run),
        *_not_heard(run, now),
        *_turned_away(run.place, said),
        *_not_receipted(run.place, run.system, now),
    ]
    return sorted(found, key=lambda one: one.t)


def _unfit(run: Run) -> Iterator[DeadLetter]:
    """Yield communicates that the design does not have, and samples that are not communicates."""
    for record in run.records:
        if not isinstance(record, Garbage):
            continue
        try:
            one = decode_strictly(record.data)
        except FipaError:
            reason = Dead.TOO_LARGE if "are accepted" in record.reason else Dead.NO_COMMUNICATE
            yield DeadLetter(
                record.received, reason, record.reason, bytes=record.size, key=record.key
            )
            continue
        reason = Dead.NO_RIGHT if one.receiver in run.system.design.agents else Dead.NO_RECEIVER
        yield _letter(one, record.received, reason, record.reason, record.size)


def _not_heard(run: Run, now: float) -> Iterator[DeadLetter]:
    """Volatile ones that only their sender's log has. Of observations the newest counts."""
    design = run.system.design
    for one in run.records:
        if (
            not isinstance(one, Spoken)
            or one.origin is not Origin.SENDER
            or one.receiver not in design.agents
        ):
            continue
        rule = design.rule(one.communicate)
        if not rule.durable and "@" not in one.id and now - one.received >= ON_ITS_WAY_S:
            why = f"it did not reach {one.receiver}, which was down or out of reach"
            yield _letter(one.communicate, one.received, Dead.NOT_HEARD, why, one.size, one.text)


def _turned_away(run: Path, said: Mapping[tuple[str, str, str], Spoken]) -> Iterator[DeadLetter]:
    """Yield the communicates that agents, by their logs, did not take or could not send."""
    for path in sorted((run / LOGS).glob("*.jsonl")):
        for line in _lines(path):
            if line.event in TURNED_AWAY:
                yield _dead_letter(
                    line, TURNED_AWAY[line.event], said.get((line.sender, line.agent, line.id))
                )
            elif TOO_LONG in line.why:
                why = line.why.rpartition(TOO_LONG)[2].strip()
                yield DeadLetter(line.t, Dead.TOO_LARGE, why, sender=line.agent)


def _lines(path: Path) -> Iterator[_Line]:
    """The lines of a log that warn; one that is not whole is left out."""
    with path.open("rb") as file:
        for raw in file:
            if b'"level":"info"' in raw or b'"level":"debug"' in raw:
                continue
            try:
                yield _line.decode(raw)
            except msgspec.MsgspecError:
                continue


def _dead_letter(line: _Line, reason: Dead, said: Spoken | None) -> DeadLetter:
    return alike(
        DeadLetter,
        line,
        reason=reason,
        why=line.why if reason is not Dead.TURNED_AWAY else f"{line.event}: {line.why}",
        receiver=line.agent,
        protocol=said.protocol if said else "",
        bytes=said.size if said else 0,
        text=said.text if said else "",
    )


def _not_receipted(run: Path, system: System, now: float) -> Iterator[DeadLetter]:
    """Durable words that their senders keep and their receivers have not taken.

    A receipt alone makes no journal record, so a sender's last one may still have what was
    receipted.
    """
    kept = {path.stem: _last(path) for path in sorted((run / JOURNAL).glob(f"*.{JOURNAL}"))}
    for agent, own in kept.items():
        for peer, waiting in own.outbox.items():
            taken = kept[peer].taken.get(agent, 0) if peer in kept else 0
            for one in (each.communicate for each in waiting if each.number > taken):
                if now - one.sent >= ON_ITS_WAY_S:
                    why = f"{agent} keeps it, and sends it when {peer} is there"
                    yield _letter(
                        one, one.sent, Dead.NOT_RECEIPTED, why, len(encode(one)), _text(one, system)
                    )


def _last(path: Path) -> _Kept:
    """The last record of a journal; an empty one where there is none that can be read."""
    try:
        last = journal.last_record(path.read_bytes())
        return _Kept() if last is None else _kept.decode(last)
    except (OSError, msgspec.MsgspecError):
        return _Kept()


def _text(one: Communicate, system: System) -> str:
    try:
        return system.words(system.languages.read(one)[0]) if system.languages else ""
    except FipaError:
        return ""


def _letter(
    one: Communicate, at: float, reason: Dead, why: str, size: int, text: str = ""
) -> DeadLetter:
    act = str(one.performative)
    return alike(
        DeadLetter, one, t=at, reason=reason, why=why, performative=act, bytes=size, text=text
    )
