"""Verdicts of topdown's judge as lines of verdicts.jsonl, all of a run in a sentence, and dead
letters.

Must not know: files, the network.
"""

from collections.abc import Mapping
from enum import StrEnum

import msgspec

from fipa_codec.communicate import Communicate
from fipa_codec.errors import FipaError
from operate.structs import alike
from operate.system import System
from operate.wording import one_line
from topdown.judge import follow
from topdown.judge.verdicts import Judgement, Verdict
from topdown.model.design import Design

LEVELS = {
    Verdict.LEGAL: "INFO",
    Verdict.SLOW: "WARN",
    Verdict.COPY: "DEBUG",
    Verdict.NOT_JUDGED: "DEBUG",
}
"""Of a line of the log; verdicts that are not named here are against the design: ERROR."""


class Judged(msgspec.Struct, frozen=True, omit_defaults=True):
    """One line of verdicts.jsonl, written by the monitor: a communicate as it was judged
    (topdown.judge.verdicts).

    `t`: when it was heard [unix s]; a line may come later than others that were heard later.
    `initiator` and `participant`: their states after it. `text`: its content in a few words. `key`:
    only where it is not the design's. `violation`: the verdict is against the design.
    """

    t: float
    verdict: str
    bytes: int
    channel: str = ""
    sender: str = ""
    receiver: str = ""
    protocol: str = ""
    performative: str = ""
    conversation: str = ""
    id: str = ""
    language: str = ""
    text: str = ""
    initiator: str = ""
    participant: str = ""
    why: str = ""
    key: str = ""
    violation: bool = False


class Dead(StrEnum):
    """Reasons why nobody took a communicate."""

    NO_RECEIVER = "no such receiver"
    NO_RIGHT = "not in the design"
    """Its sender may not say this to that receiver."""
    NO_COMMUNICATE = "no communicate"
    TOO_LARGE = "too large"
    TURNED_AWAY = "turned away"
    """Its receiver does not know the sender or the number, or had too much waiting."""
    NOT_UNDERSTOOD = "not understood"
    OVER = "conversation over"
    """Its receiver has no such conversation, or that has ended."""
    NOT_HEARD = "not heard"
    """A volatile one, sent, that never reached its receiver."""
    NOT_RECEIPTED = "not receipted"
    """A durable one that its sender still keeps: it was not taken up to now, or up to the end of
    the run.
    """


class DeadLetter(msgspec.Struct, frozen=True, omit_defaults=True):
    """A communicate that nobody took. `t`: when it was sent, or turned away [unix s]; `why`: in
    words.

    `bytes` 0: not known. `text`: its content in a few words.
    """

    t: float
    reason: Dead
    why: str
    sender: str = ""
    receiver: str = ""
    protocol: str = ""
    performative: str = ""
    conversation: str = ""
    id: str = ""
    bytes: int = 0
    text: str = ""
    key: str = ""


OF_KEYS = (Verdict.WRONG_CHANNEL, Verdict.NOT_ENTITLED)
"""Verdicts about what a communicate was put on, beside MALFORMED."""


def line(judgement: Judgement, system: System | None) -> Judged:
    """A verdict as a line; with the `system` the content in a few words."""
    heard, one = judgement.heard, judgement.heard.communicate
    why = one_line(judgement.why)
    if one is None:
        return alike(Judged, judgement, t=heard.at, bytes=heard.size, why=why, key=heard.key)
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
        text=_text(one, system),
        initiator=judgement.states[0],
        participant=judgement.states[1],
        why=why,
        key=heard.key if judgement.verdict in OF_KEYS else "",
        violation=judgement.violation,
    )


def sides(design: Design, protocol: str, one: str, other: str) -> tuple[str, str]:
    """Return initiator and participant of a conversation of two agents by the design, else `one`
    (who began) first.
    """
    uses = {
        (use.initiator, use.participant) for use in design.file.protocol if use.follows == protocol
    }
    return (other, one) if (other, one) in uses and (one, other) not in uses else (one, other)


def ended(design: Design, protocol: str, states: tuple[str, str]) -> bool:
    """Whether both sides are at an end of their protocol."""
    return protocol in design.tables and follow.ended(design.tables[protocol], states)


def outcome(verdicts: Mapping[str, int]) -> str:
    """Return in words how communicates stand to the design: counts by verdict, none of them a
    violation.
    """
    # it has one besides
    total = sum(count for verdict, count in verdicts.items() if verdict != Verdict.NOT_TAKEN)
    words = {
        Verdict.SLOW: "slow",
        Verdict.NOT_JUDGED: "could not be judged",
        Verdict.NOT_TAKEN: "taken by nobody",
    }
    found = [(verdicts[one], word) for one, word in words.items() if verdicts.get(one)]
    if not found:
        return f"all {total} communicates as designed"
    apart = (f"{count} of {total} communicates {word}" for count, word in found)
    return "; ".join(("nothing against the design", *apart))


def _text(one: Communicate, system: System | None) -> str:
    if system is None or not system.languages:
        return ""
    try:
        return one_line(system.words(system.languages.read(one)[0]))
    except FipaError:
        return ""
