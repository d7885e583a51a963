"""A content in a few words, for people. Must not know: who asks."""

from companion.languages import cmd, sw
from companion.words import plain, spaced

TEXT_LENGTH = 80
_TELLING = ("name", "object", "relation", "subject", "source", "destination", "side", "state", "at", "reason", "text")


def words(content: object) -> str:
    """A content in a few words: what it is and what it is about; a report is its own words."""
    if content is None:
        return ""
    about = [one for one in (getattr(content, name, "") for name in _TELLING) if one and isinstance(one, str)]
    kind = () if isinstance(content, cmd.TaskReport | sw.Report) else (spaced(type(content).__name__),)
    text = plain(" ".join((*kind, *about)))
    return text if len(text) <= TEXT_LENGTH else text[: TEXT_LENGTH - 1] + "…"
