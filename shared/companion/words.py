"""How ids and names of the languages are said to people: on a terminal, in a report. No agent decides by them."""

import re

_ID = re.compile(r"\b([a-z]+)_(\d+)\b")
_HUMP = re.compile(r"(?<=[a-z])(?=[A-Z])")


def plain(text: str) -> str:
    """A text with its ids as people say them: jar_1 is the jar, table_2 is table 2."""
    return _ID.sub(lambda found: found[1] if found[2] == "1" else f"{found[1]} {found[2]}", text)


def spaced(name: str) -> str:
    """A name of a class in words: SeenObject is a seen object."""
    return _HUMP.sub(" ", name).lower()
