"""Verdicts of topdown's judge in words: a line for files and people, all of a run in a sentence.

Must not know: files, the network.
"""

from collections.abc import Mapping

from fipa_codec.communicate import Communicate
from fipa_codec.errors import FipaError
from operate.run_folder import Judged, alike
from operate.system import System
from operate.wording import one_line
from topdown.judge import follow
from topdown.judge.verdicts import Judgement, Verdict
from topdown.model.design import Design

OF_KEYS = (Verdict.WRONG_CHANNEL, Verdict.NOT_ENTITLED)
"""Verdicts about what a communicate was put on, beside MALFORMED."""


def line(judgement: Judgement, system: System | None) -> Judged:
    """A verdict as a line; with the `system` the content in a few words."""
    heard, one = judgement.heard, judgement.heard.communicate
    why = one_line(judgement.why)
    if one is None:
        return alike(Judged, judgement, t=heard.at, bytes=heard.size, why=why, key=heard.key)
    return alike(
        Judged,
        one,
        t=heard.at,
        verdict=judgement.verdict,
        bytes=heard.size,
        channel=judgement.channel,
        performative=str(one.performative),
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
    apart = [
        f"{verdicts[one]} of {total} communicates {word}"
        for one, word in words.items()
        if verdicts.get(one)
    ]
    return (
        "; ".join(("nothing against the design", *apart))
        if apart
        else f"all {total} communicates as designed"
    )


def _text(one: Communicate, system: System | None) -> str:
    try:
        return (
            one_line(system.words(system.languages.read(one)[0]))
            if system is not None and system.languages
            else ""
        )
    except FipaError:
        return ""
