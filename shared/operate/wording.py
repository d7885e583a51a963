"""A content of any language in a few words, for people; text that others wrote, as a terminal may
have it.
"""

import re
from collections.abc import Callable

import msgspec

from operate.live_lines import Step, Task

LENGTH = 80
REASONS = ("reason", "why", "text")
"""Fields of a content that hold words for people."""
OBEYED = re.compile(
    "(?!\r\n)[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u206f\ud800-\udfff]"
)
"""What terminals obey in place of showing it (C0 and C1 controls but tab, newline, and CSV's line
end), what turns the direction of text around, line ends of Unicode, and halves of characters, which
cannot be written.
"""
_HUMP = re.compile(r"(?<=[a-z])(?=[A-Z])")


def about(content: object) -> str:
    """Return the class of a content, spaced, and its short values but no reason: `offer ox 12.5`;
    "" for none.
    """
    if content is None:
        return ""
    fields = content.__struct_fields__ if isinstance(content, msgspec.Struct) else ()
    values = [getattr(content, name) for name in fields if name not in REASONS]
    short = [one for one in values if isinstance(one, str | int | float)]
    told = [f"{one:g}" if isinstance(one, float) else str(one) for one in short]
    return " ".join((_HUMP.sub(" ", type(content).__name__).lower(), *filter(None, told)))


def why(content: object) -> str:
    """Return the words for people in a content; "" for none."""
    found = (getattr(content, name, "") for name in REASONS)
    return next((one for one in found if one and isinstance(one, str)), "")


def step(one: Step) -> str:
    """Return a step of a plan by its names, with what is done for it."""
    words = " ".join(filter(None, (one.does, *one.things, one.side)))
    act = _HUMP.sub(" ", one.act).lower()
    return f"{words} ({act})" if words and act else words or act


def task(one: Task, plain: Callable[[str], str] = str) -> str:
    """Return what a plan is for; `plain`: an id as people say it."""
    return " ".join((one.name.replace("_", " "), *map(plain, filter(None, one.arguments))))


def happened(name: str, of: tuple[str, ...]) -> str:
    """Return an event by its names."""
    return " ".join((name.replace("-", " "), *of))


def short(text: str) -> str:
    """Return a text of at most LENGTH letters."""
    return text if len(text) <= LENGTH else text[: LENGTH - 1] + "…"


def escaped(text: str) -> str:
    """Return a text in which nothing is left that a terminal obeys: \\u001b in place of an escape
    character.

    The form is that of JSON, so that a line of JSON stays one, and means the same.
    """
    return OBEYED.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


def one_line(text: str) -> str:
    """Return a text without line ends: who writes a name must not write a line of its own below
    it.
    """
    return text.replace("\n", "\\u000a")


def bytes_in_words(value: float) -> str:
    """Return bytes, kilobytes or more, with three digits."""
    for unit, factor in (("B", 1.0), ("kB", 1e3), ("MB", 1e6)):
        if value < 999.5 * factor:
            return f"{value / factor:.{3 if factor > 1 else 0}{'g' if factor > 1 else 'f'}} {unit}"
    return f"{value / 1e9:.3g} GB"
