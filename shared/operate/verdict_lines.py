"""A verdict of topdown's judge as a line for files and people, for whoever listens: the monitor, the console.

Must not know: files, the network.
"""

from fipa_codec.communicate import Communicate
from fipa_codec.errors import FipaError
from fipa_codec.languages import Languages
from operate.run_folder import Judged
from operate.wording import words
from topdown.judge.verdicts import Judgement, Verdict

OF_KEYS = (Verdict.WRONG_CHANNEL, Verdict.NOT_ENTITLED)
"""Verdicts about what a communicate was put on, beside MALFORMED."""


def line(judgement: Judgement, languages: Languages | None) -> Judged:
    """A verdict as a line; with `languages` the content in a few words."""
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
