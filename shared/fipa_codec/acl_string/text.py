"""Parser of ACL messages: the grammar of SC00070I, liberal, with a table of parameters.

Accepted beyond the grammar, as JADE 4.6.5 and Rock's fipa_acl print it: any case, quoted names,
numbers of Java (`12d`), words that begin with @, a bare word as content, empty sets, repeated
parameters (the last one counts), no white space. Rejected although JADE accepts it: text after the
message, month 13. Rejected as by JADE: unknown acts and parameters, a receiver without `set`,
content in parentheses, a word that begins with a digit.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, timezone
from typing import Any

from fipa_codec.acl_string.message import (
    DATE,
    MAX_ACL_BYTES,
    MAX_DEPTH,
    MAX_ITEMS,
    WRITTEN,
    AclMessage,
    AclSyntaxError,
    After,
    Aid,
    At,
    print_date,
    read_date,
    shown,
)
from fipa_codec.errors import LocalProtocolError, MalformedError
from fipa_codec.performatives import Performative

# --- Tokens of the string representation (SC00070I), from bytes, since byte-length strings count
# bytes
# Word: a sequence without bytes 00-20 and parentheses. String: `"..."` where only `\"` is an escape
# and any other backslash is literal, or `#n"` and n bytes. Rock prints no white space, so a name
# may be joined to its value (`:protocolrequest`) and a word to the next parameter
# (`request:content#2"hi`); they are separated here if that is unambiguous.


_BLANK = re.compile(rb"[\x00-\x20]*")
_RUN = re.compile(rb"[^\x00-\x20()]+")
# A user-defined name may have : and # inside (SC00070I: a word), but for Rock's length of the value
# after it.
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
# One search that stops at the first end: to look for the end of the sequence first, and then for
# parameters in it, reads a text without white space again for each of its words.
_RUN_END = re.compile(rb"[\x00-\x20()]|\Z|" + _PARAMETER, re.IGNORECASE)
RUN_ON = re.compile(_PARAMETER, re.IGNORECASE)
"""Start of a parameter within a sequence of word characters."""


class Scanner:
    """A position `at` in `data`. Methods that take a token move it behind the token. `field`: field
    of errors.
    """

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.at = 0
        self.field = "message"
        self.items = 0

    def wrong(self, expected: str, at: int | None = None, found: str = "") -> AclSyntaxError:
        """The error for position `at`, by default the current one."""
        offset = self.at if at is None else at
        return AclSyntaxError(
            self.field,
            self.data,
            offset,
            found or shown(self.data[offset : offset + 200]),
            expected,
        )

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
        """The end of the word here: at white space, a parenthesis or a parameter joined to it."""
        match = _RUN_END.search(self.data, self.at)
        return match.start() if match else len(self.data)

    def word(self) -> str:
        """Take a word, or a quoted name (JADE)."""
        if self.next() in (b'"', b"#"):
            return self.string()
        start, self.at = self.at, self.run_end()
        raw = self.data[start : self.at]
        if not raw or raw[:1] in b"-:" or raw[:1].isdigit():
            raise self.wrong(
                'a word: no blank or parenthesis in it, and no # - : " or digit first', start
            )
        return self.text(raw, start)

    def expression(self) -> str:
        """Take a word, string, number, time or nested expression; return it as written, a string
        without its quotes.
        """
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
            why = (
                '; the last one is escaped: write content that ends in \\ as #<bytes>"'
                if escaped
                else ""
            )
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
            found = f"a string of {length} bytes"
            raise self.wrong(f"at most {left} bytes, the rest of the text", found=found)
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
        """Count a parameter, or a member of a set, sequence or expression. Raise AclSyntaxError
        beyond the limit.
        """
        self.items += 1
        if self.items > MAX_ITEMS:
            found = f"number {self.items}"
            raise self.wrong(f"at most {MAX_ITEMS} parameters and members", found=found)

    def deeper(self, depth: int) -> None:
        """Raise AclSyntaxError at the depth limit."""
        if depth >= MAX_DEPTH:
            found = f"level {depth + 1}"
            raise self.wrong(f"at most {MAX_DEPTH} levels of parentheses", found=found)

    def ends_here(self, at: int) -> bool:
        """Whether white space, a parenthesis, a parameter or the end of the text is at `at`."""
        return _END.match(self.data, at) is not None

    def text(self, raw: bytes, offset: int) -> str:
        """Decode bytes that begin at `offset`. Raise AclSyntaxError if they are not UTF-8."""
        try:
            return raw.decode()
        except UnicodeDecodeError as error:
            raise self.wrong(
                "text in UTF-8", offset + error.start, f"byte {raw[error.start]:02x}"
            ) from error


# --- Parser of ACL messages -----------------------------------------------------------------------


Reader = Callable[["_Reader"], Any]


def parse(data: str | bytes, *, zone: timezone = UTC) -> AclMessage:
    """The message in `data`, which need not be trusted; `zone` is that of times without Z.

    Raise AclSyntaxError, and no other exception, with the position, what was found there and what
    was expected.
    """
    if isinstance(data, str):
        data = _utf8(data)
    if len(data) > MAX_ACL_BYTES:
        found = f"{len(data)} bytes"
        expected = f"at most {MAX_ACL_BYTES} bytes"
        raise AclSyntaxError("message", data, MAX_ACL_BYTES, found, expected)
    return _Reader(data, zone).message()


def _utf8(text: str) -> bytes:
    try:
        return text.encode()
    except UnicodeEncodeError as error:
        data, offset = text.encode(errors="replace"), len(text[: error.start].encode())
        expected = "text that UTF-8 can encode"
        raise AclSyntaxError("message", data, offset, "half a surrogate pair", expected) from error


class _Reader(Scanner):
    def __init__(self, data: bytes, zone: timezone) -> None:
        super().__init__(data)
        self.zone = zone
        self.depth = 0

    def message(self) -> AclMessage:
        self.take(b"(", "( and the act")
        self.next()
        act = self.act()
        self.field = "message"
        fields, user = self.parameters(PARAMETERS)
        self.field = "message"
        if self.next():
            raise self.wrong("the end of the text: only one message")
        return AclMessage(performative=act, user=user, **fields)

    def act(self) -> Performative:
        self.field = "performative"
        start, word = self.at, self.name()
        try:
            return Performative(word.lower())
        except ValueError as error:
            raise self.wrong(f"an act of SC00037J: {', '.join(Performative)}", start) from error

    def parameters(
        self, known: Mapping[str, tuple[str, Reader]]
    ) -> tuple[dict[str, Any], dict[str, str]]:
        """Parse the parameters and the closing parenthesis; return the known and the user-defined
        ones.
        """
        whole = self.field
        fields: dict[str, Any] = {}
        user: dict[str, str] = {}
        spelt: dict[str, str] = {}
        while True:
            self.field = whole
            if self.next() == b")":
                self.at += 1
                return fields, user
            self.item()
            start = self.at
            self.take(b":", "a parameter, which begins with :, or ) at the end")
            name = self.parameter(known, start)
            self.field = name.lower()
            if name.lower() in known:
                field, read = known[name.lower()]
                fields[field] = read(self)
            else:
                user.pop(spelt.get(name.lower(), name), None)
                user[name] = self.expression()
                spelt[name.lower()] = name

    def parameter(self, known: Mapping[str, Any], start: int) -> str:
        """Parse the name of a parameter, also if its value follows without white space."""
        begin, name = self.at, self.name()
        if name.lower() in known or (name[:2].lower() == "x-" and len(name) > 2):
            return name
        for own in RUNS_INTO:
            if own in known and name.lower().startswith(own):
                self.at = begin + len(own)
                end = self.run_end()
                if self.data[end : end + 1] in (b":", b")") and end > self.at:
                    return own
        raise self.wrong(
            f"one of {' '.join(':' + word for word in known)}, or :X- and a name", start
        )

    def aid(self) -> Aid:
        self.deeper(self.depth)
        self.depth += 1
        self.take(b"(", "(agent-identifier :name ...)")
        self.keyword("agent-identifier")
        field, start = self.field, self.at
        slots, user = self.parameters(SLOTS)
        self.field = field
        self.depth -= 1
        if "name" not in slots:
            raise self.wrong(":name, which every agent-identifier has", start)
        return Aid(user=user, **slots)

    def aids(self, keyword: str) -> tuple[Aid, ...]:
        return self.several(keyword, _Reader.aid)

    def several(self, keyword: str, read: Reader) -> tuple[Any, ...]:
        self.take(b"(", f"({keyword} ...)")
        self.keyword(keyword)
        field, items = self.field, []
        while self.next() != b")":
            self.item()
            items.append(read(self))
            self.field = field
        self.at += 1
        return tuple(items)

    def agent_name(self) -> str:
        self.next()
        start, name = self.at, self.word()
        if not name:
            raise self.wrong("a name that is not empty", start)
        return name

    def content(self) -> str | bytes:
        if self.next() == b"(":
            raise self.wrong('a string: put it in quotes, each " in it as \\"')
        if self.data[self.at : self.at + 1] not in (b'"', b"#"):
            return self.expression()
        return self.octets()[0]

    def time(self) -> At | After:
        self.next()
        match = DATE.match(self.data, self.at)
        if not match or not self.ends_here(match.end()):
            raise self.wrong(WRITTEN)
        try:
            time = read_date(match, self.zone)
        except ValueError as error:
            raise self.wrong(str(error)) from error
        self.at = match.end()
        return time


# Parameter -> field of AclMessage and parser of its value (SC00061G, SC00070I).
PARAMETERS: dict[str, tuple[str, Reader]] = {
    "sender": ("sender", _Reader.aid),
    "receiver": ("receiver", lambda reader: reader.aids("set")),
    "reply-to": ("reply_to", lambda reader: reader.aids("set")),
    "content": ("content", _Reader.content),
    "language": ("language", _Reader.expression),
    "encoding": ("encoding", _Reader.expression),
    "ontology": ("ontology", _Reader.expression),
    "protocol": ("protocol", _Reader.word),
    "conversation-id": ("conversation_id", _Reader.expression),
    "reply-with": ("reply_with", _Reader.expression),
    "in-reply-to": ("in_reply_to", _Reader.expression),
    "reply-by": ("reply_by", _Reader.time),
}

# Slot of an agent-identifier -> field of Aid and parser of its value.
SLOTS: dict[str, tuple[str, Reader]] = {
    "name": ("name", _Reader.agent_name),
    "addresses": ("addresses", lambda reader: reader.several("sequence", _Reader.word)),
    "resolvers": ("resolvers", lambda reader: reader.aids("sequence")),
}

RUNS_INTO = ("protocol", "reply-by", "name")
"""Parameters whose value Rock prints without quotes and white space directly after the name."""


# --- Printer of ACL messages: strict, in the subset that both JADE and Rock parse -----------------
# Plain words are bare, other text is quoted, absolute times are in UTC with Z, a blank is before
# each : and ). A string that ends in a backslash cannot be quoted and is printed with its length in
# bytes. So are ASCII values of X- parameters that are not plain words: Rock does not parse quoted
# ones, and JADE counts characters, so only ASCII is safe.


_PLAIN_EXPRESSION = re.compile(r"[A-Za-z][A-Za-z0-9_.@-]*")
# Names of agents and URLs are words in the grammar, with more characters: df@host:1099/JADE
_PLAIN_WORD = re.compile(r"[A-Za-z][A-Za-z0-9_.@:/?&=%~+-]*")
_USER_NAME = re.compile(r'[Xx]-[^\x00-\x20()"]+')


def render(message: AclMessage) -> bytes:
    """The text, in UTF-8 except for binary content.

    Raise LocalProtocolError if it would not parse to `message`.
    """
    try:
        data = b" ".join([b"(" + message.performative.encode(), *_parameters(message), b")"])
        same = parse(data) == message
    except UnicodeEncodeError as error:
        raise LocalProtocolError(
            "message", "contains half a surrogate pair, which UTF-8 cannot encode"
        ) from error
    except (AttributeError, TypeError) as error:
        raise LocalProtocolError("message", f"has a field of the wrong type: {error}") from error
    except MalformedError as error:
        raise LocalProtocolError(error.field, f"cannot be parsed again: {error.reason}") from error
    if not same:
        raise LocalProtocolError(
            "message", "does not parse to the same message: a field has the wrong type"
        )
    return data


def render_aid(aid: Aid) -> str:
    """An identifier as it stands in messages, and in contents of agent management (SC00023K).

    Raise LocalProtocolError if its resolvers are nested too deep.
    """
    return _aid(aid).decode()


def _parameters(message: AclMessage) -> Iterator[bytes]:
    if message.sender:
        yield b":sender " + _aid(message.sender)
    for name, aids in ((b":receiver ", message.receiver), (b":reply-to ", message.reply_to)):
        if aids:
            yield name + _several(b"set", [_aid(aid) for aid in aids])
    if message.content is not None:
        content = message.content
        yield b":content " + (
            _counted_text(content) if isinstance(content, bytes) else _quoted(content)
        )
    for field in (
        "language",
        "encoding",
        "ontology",
        "protocol",
        "conversation_id",
        "reply_with",
        "in_reply_to",
    ):
        value = getattr(message, field)
        if value is not None:
            begin = f":{field.replace('_', '-')} ".encode()
            plain = _PLAIN_EXPRESSION.fullmatch(value)
            yield begin + (
                _word(value) if field == "protocol" else value.encode() if plain else _quoted(value)
            )
    if message.reply_by is not None:
        yield b":reply-by " + print_date(message.reply_by).encode()
    yield from _user(message.user)


def _aid(aid: Aid, depth: int = 0) -> bytes:
    if depth >= MAX_DEPTH:
        raise LocalProtocolError("resolvers", f"are nested more than {MAX_DEPTH} deep")
    parts = [b"(agent-identifier :name", _word(aid.name)]
    if aid.addresses:
        parts += [
            b":addresses",
            _several(b"sequence", [_word(address) for address in aid.addresses]),
        ]
    if aid.resolvers:
        parts += [
            b":resolvers",
            _several(b"sequence", [_aid(resolver, depth + 1) for resolver in aid.resolvers]),
        ]
    return b" ".join([*parts, *_user(aid.user), b")"])


def _several(keyword: bytes, items: list[bytes]) -> bytes:
    return b" ".join([b"(" + keyword, *items, b")"])


def _user(parameters: dict[str, str]) -> Iterator[bytes]:
    for name, value in parameters.items():
        if not _USER_NAME.fullmatch(name):
            raise LocalProtocolError(
                name,
                "is not the name of a user-defined parameter: X- and characters other than blank"
                ' ( ) "',
            )
        if _PLAIN_EXPRESSION.fullmatch(value):
            text = value.encode()
        else:
            text = _counted_text(value.encode()) if value.isascii() and value else _quoted(value)
        yield f":{name} ".encode() + text


def _word(text: str) -> bytes:
    plain = _PLAIN_WORD.fullmatch(text) and not RUN_ON.search(text.encode())
    return text.encode() if plain else _quoted(text)


def _quoted(text: str) -> bytes:
    data = text.encode()
    return _counted_text(data) if data.endswith(b"\\") else b'"' + data.replace(b'"', b'\\"') + b'"'


def _counted_text(data: bytes) -> bytes:
    return b'#%d"%s' % (len(data), data)
