"""Spoils a sound design: `barrow.toml` with some of its words replaced."""

from pathlib import Path

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
