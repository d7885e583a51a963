"""What the judge of topdown says of a run: records in, one line for each communicate out.

The same for the traffic as it goes by and for a recording afterwards. Must not know: files, the network.
"""

from collections.abc import Iterable, Iterator

import msgspec

from companion.design import DESIGN
from companion.languages import LANGUAGES
from companion.run_folder import Again, AgentIn, Judged, LiveLine, Sent
from fipa_codec.communicate import Communicate
from fipa_codec.errors import FipaError
from fipa_codec.languages import Kind, Languages
from fipa_codec.performatives import Performative
from services.monitor.records import SETTING, Garbage, House, Record, Resumed, Spoken, Token
from services.monitor.wording import words
from topdown.design import Design
from topdown.judging import Judge
from topdown.verdicts import Judgement, Verdict

HISTORY_S = 0.5
"""A token heard sooner after the recorder began may be of an agent that lived before; estimate: they come in ms."""
OF_KEYS = (Verdict.WRONG_CHANNEL, Verdict.NOT_ENTITLED)
"""Verdicts about what a communicate was put on, beside MALFORMED."""
SYSTEM = "recorded"
"""Stands in the keys of records, which do not keep the system's name."""


class Judging:
    """Judges records as they come."""

    def __init__(self, design: Design = DESIGN, languages: Languages | None = LANGUAGES) -> None:
        self._judge = Judge(design, languages)
        self._key, self._languages = design.file.system.key, languages
        self._began: float | None = None
        self._last = 0.0

    def lines(self, record: Record) -> Iterator[Judged]:
        """The verdicts that a record brings: its own, and those of earlier ones that it explains or time decides."""
        self._last = max(self._last, record.received)
        for judgement in self._heard(record):
            yield line(judgement, self._languages)

    def pass_time(self, now: float) -> Iterator[Judged]:
        """It is `now` [unix s]: what waited in vain."""
        for judgement in self._judge.pass_time(now):
            yield line(judgement, self._languages)

    def finish(self, now: float | None = None) -> Iterator[Judged]:
        """Nothing more will be heard; `now` None: since the last record."""
        for judgement in self._judge.finish(self._last if now is None else now):
            yield line(judgement, self._languages)

    def _heard(self, record: Record) -> tuple[Judgement, ...]:
        at = record.received
        match record:
            case Spoken():
                return self._judge.hear(self._key_of(record), record.wire, at)
            case Garbage():
                return self._judge.hear(record.key, record.data, at, record.size)
            case Token(alive=True):
                fresh = self._began is not None and at > self._began + HISTORY_S
                return self._judge.lived(record.agent, record.incarnation, at, fresh=fresh)
            case House(kind=kind) if kind == SETTING:
                self._began = at
            case Resumed():
                return self._judge.deaf(at)
        return self._judge.pass_time(at)

    def _key_of(self, one: Spoken) -> str:
        return self._key.format(
            system=SYSTEM,
            channel=one.channel,
            sender=one.sender,
            receiver=one.receiver,
            protocol=one.protocol,
            performative=one.performative,
        )


def of_records(
    records: Iterable[Record], design: Design = DESIGN, languages: Languages | None = LANGUAGES
) -> tuple[Judged, ...]:
    """All verdicts about a recording, in the order of time."""
    judging = Judging(design, languages)
    found = [one for record in records for one in judging.lines(record)]
    return tuple(sorted((*found, *judging.finish()), key=lambda one: one.t))


def of_live(lines: Iterable[LiveLine], design: Design = DESIGN) -> tuple[Judged, ...]:
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
                mute.append(_mute(one))
            case Sent():
                key, communicate, read = _of_sent(one, design)
                said[one.sender, one.receiver, one.id] = (key, communicate, one.bytes, read)
                found += judge.hear(key, communicate, one.t, one.bytes, read)
            case Again() if (one.sender, one.receiver, one.id) in said:
                key, communicate, size, read = said[one.sender, one.receiver, one.id]
                found += judge.hear(key, communicate, one.t, size, read)
            case AgentIn(agent=agent, incarnation=incarnation) if incarnation and one.alive:
                found += judge.lived(agent, incarnation, one.t)
    found += judge.finish(at)
    return tuple(sorted((*mute, *(line(one, None) for one in found)), key=lambda one: one.t))


def line(judgement: Judgement, languages: Languages | None) -> Judged:
    """A verdict for the file and for people."""
    heard, one = judgement.heard, judgement.heard.communicate
    if one is None:
        return Judged(
            t=heard.at,
            verdict=judgement.verdict,
            bytes=heard.size,
            channel=judgement.channel,
            why=judgement.why,
            key=heard.key,
            violation=judgement.violation,
        )
    return Judged(
        t=heard.at,
        verdict=judgement.verdict,
        bytes=heard.size,
        channel=judgement.channel,
        sender=one.sender,
        receiver=one.receiver,
        protocol=one.protocol,
        performative=str(one.performative),
        conversation=one.conversation,
        id=one.id,
        language=one.language,
        text=_text(one, languages),
        initiator=judgement.states[0],
        participant=judgement.states[1],
        why=judgement.why,
        key=heard.key if judgement.verdict in OF_KEYS else "",
        violation=judgement.violation,
    )


def _text(one: Communicate, languages: Languages | None) -> str:
    try:
        return words(languages.read(one)[0]) if languages is not None else ""
    except FipaError:
        return ""


def _mute(one: Sent) -> Judged:
    """A line of a version that says neither ids nor labels cannot be followed."""
    return Judged(
        t=one.t,
        verdict=Verdict.NOT_JUDGED,
        bytes=one.bytes,
        channel=one.channel,
        sender=one.sender,
        receiver=one.receiver,
        protocol=one.protocol,
        performative=one.performative,
        conversation=one.conversation,
        language=one.language,
        why="its line is of a version that says too little",
    )


def _of_sent(one: Sent, design: Design) -> tuple[str, Communicate, tuple[str, Kind]]:
    """Key, communicate without its content, and what its content was."""
    key = design.file.system.key.format(
        system=SYSTEM,
        channel=one.channel,
        sender=one.sender,
        receiver=one.receiver,
        protocol=one.protocol,
        performative=one.performative,
    )
    communicate = Communicate(
        performative=Performative(one.performative),
        language=one.language,
        ontology=one.ontology,
        protocol=one.protocol,
        reply_by=one.reply_by,
        reply_with=one.reply_with,
        in_reply_to=one.in_reply_to,
        conversation=one.conversation,
        sender=one.sender,
        receiver=one.receiver,
        id=one.id,
        sent=one.sent,
    )
    return key, communicate, (one.content, Kind(one.use))


def encoded(one: Judged) -> bytes:
    """A line of verdicts.jsonl."""
    return msgspec.json.encode(one) + b"\n"
