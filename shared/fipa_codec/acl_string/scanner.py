r"""Tokens of the string representation (SC00070I), from bytes, since byte-length strings count bytes.

Word: a sequence without bytes 00-20 and parentheses. String: `"..."` where only `\"` is an escape and any other
backslash is literal, or `#n"` and n bytes. Rock prints no white space, so a name may be joined to its value
(`:protocolrequest`) and a word to the next parameter (`request:content#2"hi`); they are separated here if that is
unambiguous.
"""

import re

from fipa_codec.acl_string.dates import DATE
from fipa_codec.acl_string.errors import AclSyntaxError, shown
from fipa_codec.acl_string.message import MAX_DEPTH, MAX_ITEMS

_BLANK = re.compile(rb"[\x00-\x20]*")
_RUN = re.compile(rb"[^\x00-\x20()]+")
# A user-defined name may have : and # inside (SC00070I: a word), but for Rock's length of the value after it.
_NAME = re.compile(rb'[xX]-(?:[^\x00-\x20()"#]++|#(?!\d+"))+|[^\x00-\x20()":#]*')
# Possessive: a quote after a backslash never ends the string, even if no other quote follows.
_STRING = re.compile(rb'"((?:[^"\\]++|\\"?+)*+)"')
_COUNT = re.compile(rb'#(?=\d)0*+([1-9]\d{0,8}+)?"')
_END = re.compile(rb"[\x00-\x20():]|\Z")
# JADE does not quote what Java parses as a double, including the suffixes d and f.
_NUMBER = re.compile(rb"[+-]?(?:\d++(?:\.\d*+)?|\.\d++)(?:[eE][+-]?\d++)?[dDfF]?")

_PARAMETER = (
    rb":(?:(?:sender|receiver|reply-to|addresses|resolvers)\("
    rb'|(?:content|language|encoding|ontology|conversation-id|reply-with|in-reply-to)(?:"|#\d+")'
    rb"|reply-by[+-]?\d{8}T\d{9}"
    rb'|x-[^\x00-\x20()":#]+#\d+")'
)
# One search that stops at the first end: to look for the end of the sequence first, and then for parameters in it,
# reads a text without white space again for each of its words.
_RUN_END = re.compile(rb"[\x00-\x20()]|\Z|" + _PARAMETER, re.IGNORECASE)
RUN_ON = re.compile(_PARAMETER, re.IGNORECASE)
"""Start of a parameter within a sequence of word characters."""


class Scanner:
    """A position `at` in `data`. Methods that take a token move it behind the token. `field`: field of errors."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.at = 0
        self.field = "message"
        self.items = 0

    def wrong(self, expected: str, at: int | None = None, found: str = "") -> AclSyntaxError:
        """Return the error for position `at`, by default the current one."""
        offset = self.at if at is None else at
        return AclSyntaxError(self.field, self.data, offset, found or shown(self.data[offset : offset + 200]), expected)

    def next(self) -> bytes:
        """Skip white space and return the next byte without taking it; b"" at the end."""
        match = _BLANK.match(self.data, self.at)
        self.at = match.end() if match else self.at
        return self.data[self.at : self.at + 1]

    def take(self, byte: bytes, expected: str) -> None:
        """Take this byte after white space."""
        if self.next() != byte:
            raise self.wrong(expected)
        self.at += 1

    def keyword(self, word: str) -> None:
        """Take this word in any case; the next token may follow without white space."""
        self.next()
        end = self.at + len(word)
        if self.data[self.at : end].lower() != word.encode():
            raise self.wrong(f"the word {word}")
        self.at = end

    def name(self) -> str:
        """Take an act or the name of a parameter, as written."""
        start = self.at
        match = _NAME.match(self.data, start)
        self.at = match.end() if match else start
        return self.text(self.data[start : self.at], start)

    def run_end(self) -> int:
        """Return the end of the word here: at white space, a parenthesis or a parameter joined to it."""
        match = _RUN_END.search(self.data, self.at)
        return match.start() if match else len(self.data)

    def word(self) -> str:
        """Take a word, or a quoted name (JADE)."""
        if self.next() in (b'"', b"#"):
            return self.string()
        start, self.at = self.at, self.run_end()
        raw = self.data[start : self.at]
        if not raw or raw[:1] in b"-:" or raw[:1].isdigit():
            raise self.wrong('a word: no blank or parenthesis in it, and no # - : " or digit first', start)
        return self.text(raw, start)

    def expression(self) -> str:
        """Take a word, string, number, time or nested expression; return it as written, a string without its quotes."""
        start, byte = self.at, self.next()
        if byte in (b'"', b"#"):
            return self.string()
        if byte == b"(":
            return self.nested()
        start = self.at
        raw = self.data[start : self.run_end()]
        if _NUMBER.fullmatch(raw) or DATE.fullmatch(raw):
            self.at += len(raw)
            return raw.decode()
        if raw[:1].isdigit() or raw[:1] == b"-":
            raise self.wrong("a word, which begins with a letter, or the same in quotes", start)
        return self.word()

    def string(self) -> str:
        """Take a string in UTF-8."""
        raw, begin = self.octets()
        self.text(self.data[begin : self.at], begin)
        return raw.decode()

    def octets(self) -> tuple[bytes, int]:
        """Take a string; return its bytes and their start."""
        if self.next() == b"#":
            return self._counted()
        match = _STRING.match(self.data, self.at)
        if not match:
            escaped = self.data.rfind(b'\\"') >= self.at
            why = '; the last one is escaped: write content that ends in \\ as #<bytes>"' if escaped else ""
            raise self.wrong(f"a quote that ends the string{why}", found="a string without end")
        self.at = match.end()
        return match[1].replace(b'\\"', b'"'), match.start(1)

    def _counted(self) -> tuple[bytes, int]:
        match = _COUNT.match(self.data, self.at)
        if not match:
            raise self.wrong('a byte-length string #<bytes>"..., at most 9 digits')
        begin, length = match.end(), int(match[1] or b"0")
        left = len(self.data) - begin
        if length > left:
            raise self.wrong(f"at most {left} bytes, the rest of the text", found=f"a string of {length} bytes")
        self.at = begin + length
        return self.data[begin : self.at], begin

    def nested(self) -> str:
        """Take an expression in parentheses; return it as written."""
        start, depth = self.at, 0
        while True:
            self.item()
            byte = self.next()
            if byte == b"(":
                self.deeper(depth)
                depth, self.at = depth + 1, self.at + 1
            elif byte == b")":
                depth, self.at = depth - 1, self.at + 1
                if not depth:
                    return self.text(self.data[start : self.at], start)
            elif byte in (b'"', b"#"):
                self.octets()
            elif run := _RUN.match(self.data, self.at):
                self.at = run.end()
            else:
                raise self.wrong(") that ends the expression")

    def item(self) -> None:
        """Count a parameter, or a member of a set, sequence or expression. Raise AclSyntaxError beyond the limit."""
        self.items += 1
        if self.items > MAX_ITEMS:
            raise self.wrong(f"at most {MAX_ITEMS} parameters and members", found=f"number {self.items}")

    def deeper(self, depth: int) -> None:
        """Raise AclSyntaxError at the depth limit."""
        if depth >= MAX_DEPTH:
            raise self.wrong(f"at most {MAX_DEPTH} levels of parentheses", found=f"level {depth + 1}")

    def ends_here(self, at: int) -> bool:
        """Whether white space, a parenthesis, a parameter or the end of the text is at `at`."""
        return _END.match(self.data, at) is not None

    def text(self, raw: bytes, offset: int) -> str:
        """Decode bytes that begin at `offset`. Raise AclSyntaxError if they are not UTF-8."""
        try:
            return raw.decode()
        except UnicodeDecodeError as error:
            raise self.wrong("text in UTF-8", offset + error.start, f"byte {raw[error.start]:02x}") from error
