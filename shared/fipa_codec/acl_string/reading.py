"""Parser of ACL messages: the grammar of SC00070I, liberal, with a table of parameters.

Accepted beyond the grammar, as JADE 4.6.5 and Rock's fipa_acl print it: any case, quoted names, numbers of Java
(`12d`), words that begin with @, a bare word as content, empty sets, repeated parameters (the last one counts), no
white space. Rejected although JADE accepts it: text after the message, month 13. Rejected as by JADE: unknown acts and
parameters, a receiver without `set`, content in parentheses, a word that begins with a digit.
"""

from collections.abc import Callable, Mapping
from datetime import UTC, timezone
from typing import Any

from fipa_codec.acl_string.dates import DATE, WRITTEN, read_date
from fipa_codec.acl_string.errors import AclSyntaxError
from fipa_codec.acl_string.message import MAX_ACL_BYTES, AclMessage, After, Aid, At
from fipa_codec.acl_string.scanner import Scanner
from fipa_codec.performatives import Performative

Reader = Callable[["_Reader"], Any]


def parse(data: str | bytes, *, zone: timezone = UTC) -> AclMessage:
    """Return the message in `data`, which need not be trusted; `zone` is that of times without Z.

    Raise AclSyntaxError, and no other exception, with the position, what was found there and what was expected.
    """
    if isinstance(data, str):
        data = _utf8(data)
    if len(data) > MAX_ACL_BYTES:
        found = f"{len(data)} bytes"
        raise AclSyntaxError("message", data, MAX_ACL_BYTES, found, f"at most {MAX_ACL_BYTES} bytes")
    return _Reader(data, zone).message()


def _utf8(text: str) -> bytes:
    try:
        return text.encode()
    except UnicodeEncodeError as error:
        data, offset = text.encode(errors="replace"), len(text[: error.start].encode())
        raise AclSyntaxError("message", data, offset, "half a surrogate pair", "text that UTF-8 can encode") from error


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

    def parameters(self, known: Mapping[str, tuple[str, Reader]]) -> tuple[dict[str, Any], dict[str, str]]:
        """Parse the parameters and the closing parenthesis; return the known and the user-defined ones."""
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
        raise self.wrong(f"one of {' '.join(':' + word for word in known)}, or :X- and a name", start)

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
