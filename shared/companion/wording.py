"""Ids, names and contents in words for people: on a terminal, in a report. No agent decides by them."""

import math
import re

from companion.languages import cmd, sw
from companion.languages.evidence import Claim, Evidence

TEXT_LENGTH = 80
_TELLING = ("name", "object", "relation", "subject", "source", "destination", "side", "state", "at", "reason", "text")
_ID = re.compile(r"\b([a-z]+)_(\d+)\b")
_HUMP = re.compile(r"(?<=[a-z])(?=[A-Z])")


def plain(text: str) -> str:
    """A text with its ids as people say them: jar_1 is the jar, table_2 is table 2."""
    return _ID.sub(lambda found: found[1] if found[2] == "1" else f"{found[1]} {found[2]}", text)


def spaced(name: str) -> str:
    """A name of a class in words: SeenObject is a seen object."""
    return _HUMP.sub(" ", name).lower()


def words(content: object) -> str:
    """A content in a few words: what it is and what it is about; a report is its own words."""
    if content is None:
        return ""
    about = [one for one in (getattr(content, name, "") for name in _TELLING) if one and isinstance(one, str)]
    kind = () if isinstance(content, cmd.TaskReport | sw.Report) else (spaced(type(content).__name__),)
    text = plain(" ".join((*kind, *about)))
    return text if len(text) <= TEXT_LENGTH else text[: TEXT_LENGTH - 1] + "…"


CLAIMS = {
    Claim.THERE: "the arm is where it should be",
    Claim.HELD: "{} is in the hand",
    Claim.STANDS: "{} stands where it was put",
    Claim.OPEN: "{} is open",
    Claim.LOOKED: "something was seen",
    Claim.LEFT: "content left {}",
    Claim.ARRIVED: "content is in {}",
}


def evidence(one: Evidence) -> str:
    """What is true, and which senses told; or that it was not checked."""
    words = CLAIMS[one.claim].format(one.of)
    if not one.by:
        return f"not checked: whether {words}"
    near = f", to {math.ceil(one.within * 1000)} mm" if one.within else ""
    return f"{words}, by {' and '.join(one.by)}{near}"
