"""A content of any language in a few words, for people."""

import re

import msgspec

LENGTH = 80
_HUMP = re.compile(r"(?<=[a-z])(?=[A-Z])")


def words(content: object) -> str:
    """Return the class of a content, spaced, and its short values: `Offer ox 12.5`; "" for no content."""
    if content is None:
        return ""
    fields = content.__struct_fields__ if isinstance(content, msgspec.Struct) else ()
    values = [getattr(content, name) for name in fields]
    told = [f"{one:g}" if isinstance(one, float) else str(one) for one in values if isinstance(one, str | int | float)]
    text = " ".join((_HUMP.sub(" ", type(content).__name__).lower(), *filter(None, told)))
    return text if len(text) <= LENGTH else text[: LENGTH - 1] + "…"
