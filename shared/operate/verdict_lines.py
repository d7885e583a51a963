"""Verdicts of topdown's judge in words: a line for files and people, all of a run in a sentence.

Must not know: files, the network.
"""

from collections.abc import Mapping

from fipa_codec.communicate import Communicate
from fipa_codec.errors import FipaError
from operate.run_folder import Judged, alike
from operate.system import System
from operate.wording import one_line
from topdown.judge.verdicts import Judgement, Verdict

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


def outcome(verdicts: Mapping[str, int]) -> str:
    """Return in words how communicates stand to the design: counts by verdict, none of them a violation."""
    total = sum(count for verdict, count in verdicts.items() if verdict != Verdict.NOT_TAKEN)  # it has one besides
    words = {
        Verdict.SLOW: "slow",
        Verdict.NOT_JUDGED: "could not be judged",
        Verdict.NOT_TAKEN: "taken by nobody",
    }
    apart = [f"{verdicts[one]} of {total} communicates {word}" for one, word in words.items() if verdicts.get(one)]
    return "; ".join(("nothing against the design", *apart)) if apart else f"all {total} communicates as designed"


def _text(one: Communicate, system: System | None) -> str:
    try:
        return one_line(system.words(system.languages.read(one)[0])) if system is not None and system.languages else ""
    except FipaError:
        return ""
