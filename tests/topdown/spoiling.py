"""The barrow: a sound design, spoilt by replacing some of its words, and runs of it."""

from pathlib import Path

from fipa_codec.performatives import Performative as P
from topdown.check.recorded import Observation, Observed
from topdown.model import loading
from topdown.model.design import Design

SOUND = Path(__file__).with_name("barrow.toml").read_text()
Change = tuple[str, str]


def text_of(*changes: Change) -> str:
    """The design's text; each change replaces the first place where its words stand."""
    text = SOUND
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def design(*changes: Change) -> Design:
    """The design, read."""
    text = text_of(*changes)
    return Design(loading.read(text), "barrow.toml", text)


# --- Runs of the barrow, said by hand: a person orders once, nav asks and drives ------------------


def said(
    at: float, way: str, protocol: str, act: P, size: int, talk: str, content: str = ""
) -> Observation:
    """A communicate of a run; `way`: "sender>receiver"."""
    sender, _, receiver = way.partition(">")
    return Observation(at, sender, receiver, protocol, act, size, talk, content)


def run(*more: Observation, slow: float = 0.0) -> Observed:
    """A sound run, and what is said besides; `slow`: how much later everything of the drive is
    answered.
    """
    return Observed(
        communicates=(
            said(0.0, "desk>nav", "request", P.REQUEST, 100, "o1", "WAY.Order"),
            said(0.1, "nav>desk", "request", P.AGREE, 50, "o1"),
            said(0.2, "nav>atlas", "query", P.QUERY_REF, 100, "q1", "PLACE.Where"),
            said(0.25, "atlas>nav", "query", P.INFORM, 500, "q1", "PLACE.There"),
            said(0.3, "nav>base", "request", P.REQUEST, 200, "d1", "WAY.Drive"),
            said(0.4, "base>nav", "request", P.AGREE, 50, "d1"),
            said(8.3 + slow, "base>nav", "request", P.INFORM, 100, "d1", "WAY.Driven"),
            said(8.4 + slow, "nav>desk", "request", P.INFORM, 100, "o1", "WAY.Arrived"),
            *more,
        ),
        events=("order taken", "order done"),
    )
