"""AclSyntaxError: where a text stops being an ACL message, what stands there, what would have been right."""

import re

from fipa_codec.errors import MalformedError

_SHOWN = 24
"""Characters of a wrong token in an error message. Estimate."""
_AROUND = 60
"""Characters of the excerpt on each side of the error. Estimate: fits a terminal."""
_WIDEST = 4
"""Bytes of the longest UTF-8 character."""
_TOKEN = re.compile(rb"[^\x00-\x20()]{1,200}")


class AclSyntaxError(MalformedError):
    """Text that is not an ACL message.

    `offset`: position of the error [bytes]; `line`, `column`: the same from 1 [characters]. `found`, `expected`: in
    words. `excerpt`: the line around the error; `caret`: index of the error in the excerpt.
    """

    def __init__(self, field: str, data: bytes, offset: int, found: str, expected: str) -> None:
        self.offset = offset
        self.found = found
        self.expected = expected
        start = data.rfind(b"\n", 0, offset) + 1
        end = data.find(b"\n", offset)
        self.line = data.count(b"\n", 0, offset) + 1
        self.column = len(_text(data[start:offset])) + 1
        before = _text(data[max(start, offset - _AROUND * _WIDEST) : offset])[-_AROUND:]
        after = _text(data[offset : len(data) if end < 0 else end][: _AROUND * _WIDEST])[:_AROUND]
        self.excerpt = before + after
        self.caret = len(before)
        super().__init__(field, f"line {self.line}, column {self.column}: found {found}, expected {expected}")


def shown(data: bytes) -> str:
    """Return the first token of `data`, shortened for an error message."""
    if not data:
        return "the end of the text"
    match = _TOKEN.match(data)
    token = _text(match[0] if match else data[:1])
    return repr(token if len(token) <= _SHOWN else token[:_SHOWN] + "...")


def _text(data: bytes) -> str:
    return data.decode(errors="replace")
