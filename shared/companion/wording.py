"""Ids, names and contents in the operator's words: on a terminal, in a report. No agent decides by them."""

import math
import re

from companion import sentences
from companion.languages import cmd, hfsm, sw
from companion.languages.evidence import Evidence
from companion.sentences import claimed, operator
from fipa_codec.languages import Reason

_TELLING = ("name", "object", "relation", "subject", "source", "destination", "side", "state")
_ID = re.compile(r"\b([a-z]+)_(\d+)\b")
_HUMP = re.compile(r"(?<=[a-z])(?=[A-Z])")


def plain(text: str) -> str:
    """A text with its ids as people say them: jar_1 is the jar, table_2 is table 2."""
    return _ID.sub(lambda found: found[1] if found[2] == "1" else f"{found[1]} {found[2]}", text)


def spaced(name: str) -> str:
    """A name of a class in words: SeenObject is a seen object."""
    return _HUMP.sub(" ", name).lower()


def about(content: object) -> str:
    """A content in a few words: what it is and what it is about; of a report only the latter."""
    if content is None or isinstance(content, Reason):
        return ""
    if isinstance(content, cmd.TaskReport | sw.Report):
        return " ".join(filter(None, (content.state, at(content.at))))
    told = [one for one in (getattr(content, name, "") for name in _TELLING) if one and isinstance(one, str)]
    return plain(" ".join((spaced(type(content).__name__), *told)))


def at(place: hfsm.Place | None) -> str:
    """Where a plan is; "" for nowhere."""
    return "" if place is None else sentences.place(place, sentences.Reader.OPERATOR)


def does(state: hfsm.State) -> str:
    """What a state of a plan does; of its end the outcome."""
    if (step := hfsm.step_of(state)) is not None:
        return sentences.step(step, sentences.Reader.OPERATOR)
    match state:
        case hfsm.ActState(command=command):
            return at(hfsm.Place((), act=type(command).__name__))
        case hfsm.EndState(outcome=outcome):
            return outcome
    return plain(state.name)


def why(content: object) -> str:
    """The reason that a content gives; "" for none."""
    return content.text if isinstance(content, Reason) else operator(getattr(content, "why", ()))


def evidence(one: Evidence) -> str:
    """What is true, and which senses told; or that it was not checked."""
    words = claimed(one.claim, one.of)
    if not one.by:
        return f"not checked: whether {words}"
    near = f", to {math.ceil(one.within * 1000)} mm" if one.within else ""
    return f"{words}, by {' and '.join(one.by)}{near}"
