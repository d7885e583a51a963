"""Verdicts of topdown's judge on a run: records in, one line for each communicate out.

The same for the traffic as it goes by and for a recording afterwards. Must not know: files, the
network.
"""

from collections.abc import Iterable, Iterator

import msgspec

from fipa_codec.communicate import Communicate, check_text
from fipa_codec.errors import FipaError
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from operate.live_lines import Again, AgentIn, LiveLine, Sent
from operate.recording.records import (
    SETTING,
    Garbage,
    House,
    Origin,
    Record,
    Spoken,
    Token,
    Unpaired,
    key_of,
)
from operate.structs import alike
from operate.system import System
from operate.verdict_lines import Judged, line
from topdown.judge.judge import Judge
from topdown.judge.verdicts import Judgement, Read, Verdict
from topdown.model.design import Design

HISTORY_S = 0.5
"""A token heard sooner after the recorder began may be of an agent that lived before; estimate:
they come in ms.
"""


class Judging:
    """Judges records as they come."""

    def __init__(self, system: System, *, words: bool = True) -> None:
        """`words`: the verdicts have contents in a few words."""
        self._words = words
        self._judge = Judge(system.design, system.languages)
        self._key, self._system = system.design.file.system.key, system
        self._began: float | None = None
        self._last = 0.0

    def lines(self, record: Record) -> Iterator[Judged]:
        """The verdicts that a record brings: its own, and those of earlier ones that it explains or
        time decides.
        """
        self._last = max(self._last, record.received)
        if isinstance(record, Unpaired):
            yield self._unpaired(record)
        for judgement in self._heard(record):
            yield self._line(judgement)
        if isinstance(record, Spoken) and record.origin is Origin.SENDER:
            yield from self._not_taken(record)

    def pass_time(self, now: float) -> Iterator[Judged]:
        """It is `now` [unix s]: what waited in vain."""
        for judgement in self._judge.pass_time(now):
            yield self._line(judgement)

    def finish(self, now: float | None = None) -> Iterator[Judged]:
        """Nothing more will be heard; `now` None: since the last record."""
        for judgement in self._judge.finish(self._last if now is None else now):
            yield self._line(judgement)

    def _line(self, judgement: Judgement) -> Judged:
        return line(judgement, self._system if self._words else None)

    def _heard(self, record: Record) -> tuple[Judgement, ...]:
        at = record.received
        match record:
            case Spoken(lost=True):
                return self._judge.hear(
                    key_of(record, self._key), record.communicate, at, record.size, (None, None)
                )
            case Spoken():
                key, size = key_of(record, self._key), len(record.wire)
                return self._judge.hear(key, _decoded(record), at, size, _read(record))
            case Garbage(data=b"", log=log) if log:
                return self._judge.noted(record.key, record.reason, at)
            case Garbage():
                return self._judge.hear(record.key, record.data, at, record.size)
            case Token(alive=True):
                fresh = record.noted or (self._began is not None and at > self._began + HISTORY_S)
                return self._judge.lived(
                    record.agent, record.incarnation, at, fresh=fresh, journal=record.journal
                )
            case House(kind=kind) if kind == SETTING:
                self._began = at
        return self._judge.pass_time(at)

    def _not_taken(self, one: Spoken) -> Iterator[Judged]:
        """Whoever is of another design keeps no log, and may have taken it."""
        if one.receiver in self._system.design.agents:
            why = f"{one.receiver} did not take it: it was down, frozen or out of reach"
            told = {"t": one.received, "bytes": one.size, "text": "", "why": why}
            yield alike(Judged, one, verdict=Verdict.NOT_TAKEN, **told)

    def _unpaired(self, one: Unpaired) -> Judged:
        rule = self._system.design.rules.get(
            (one.sender, one.receiver, one.protocol, Performative(one.performative))
        )
        verdict = Verdict.ALTERED if one.altered else Verdict.NOT_SAID
        channel = "" if rule is None else rule.channel
        return alike(
            Judged, one, t=one.received, verdict=verdict, bytes=0, channel=channel, violation=True
        )


def _decoded(one: Spoken) -> Communicate | bytes:
    """The communicate, which may be decoded already; its bytes, if it is none."""
    try:
        check_text(one.communicate)
    except FipaError:
        return one.wire
    return one.communicate


def _read(one: Spoken) -> Read | None:
    """What its content is, if it was read already."""
    content, kind = one.known
    return None if content is None else (f"{one.language}.{type(content).__name__}", kind)


def of_records(
    records: Iterable[Record], system: System, *, words: bool = True
) -> tuple[Judged, ...]:
    """All verdicts about a recording, in the order of time; with contents in a few `words`."""
    judging, last, found = Judging(system, words=words), 0.0, list[Judged]()
    for record in records:
        last = max(last, record.received)
        # a signal tells only that time passes, as the next communicate does
        if not isinstance(record, House) or record.kind == SETTING:
            found += judging.lines(record)
    return tuple(sorted((*found, *judging.finish(last)), key=lambda one: one.t))


def of_live(lines: Iterable[LiveLine], design: Design) -> tuple[Judged, ...]:
    """All verdicts about the lines of live.jsonl, which name contents, and do not have them.

    What was no communicate of the design is not among those lines.
    """
    judge, said, at = Judge(design), {}, 0.0
    found: list[Judgement] = []
    mute: list[Judged] = []
    for one in lines:
        at = max(at, one.t)
        match one:
            case Sent(id=""):
                # neither ids nor labels: it cannot be followed
                why = "its line is of a version that says too little"
                mute.append(alike(Judged, one, verdict=Verdict.NOT_JUDGED, text="", why=why))
            case Sent():
                key, read = key_of(one, design.file.system.key), (one.content, Kind(one.use))
                act = Performative(one.performative)
                communicate = alike(Communicate, one, performative=act, content=msgspec.UNSET)
                said[one.sender, one.receiver, one.id] = (key, communicate, one.bytes, read)
                found += judge.hear(key, communicate, one.t, one.bytes, read)
            case Again() if (one.sender, one.receiver, one.id) in said:
                key, communicate, size, read = said[one.sender, one.receiver, one.id]
                found += judge.hear(key, communicate, one.t, size, read)
            case AgentIn(agent=agent, incarnation=incarnation) if incarnation and one.alive:
                found += judge.lived(agent, incarnation, one.t)
    found += judge.finish(at)
    return tuple(sorted((*mute, *(line(one, None) for one in found)), key=lambda one: one.t))


def encoded(one: Judged) -> bytes:
    """A line of verdicts.jsonl."""
    return msgspec.json.encode(one) + b"\n"
