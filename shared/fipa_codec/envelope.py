"""What platforms post to each other: an envelope in XML (SC00085) and an ACL message as text, in a
multipart body (SC00084).

    pack(envelope, text) -> content type, body     strict, as JADE 4.6.5 reads it
    unpack(content type, body) -> envelope, text   liberal; of bytes that nobody vouches for

Of an envelope it knows what decides where a message goes (SC00067, 2.3): all else is skipped, and
not written. A document type, which could define entities, is refused. No I/O, no clock.
"""

import hashlib
import re
from collections.abc import Iterator
from datetime import UTC
from html import escape
from typing import Any
from xml.parsers import expat

import msgspec

from fipa_codec.acl_string.message import DATE, MAX_DEPTH, Aid, At, print_date, read_date
from fipa_codec.errors import LocalProtocolError, MalformedError

REPRESENTATION = "fipa.acl.rep.string.std"
"""The text of SC00070I."""
MAX_ENVELOPE_BYTES = 65_536
"""Size limit of an envelope. Estimate: those of JADE have 1 kB."""
_ENCODINGS = {"utf-8": "utf-8", "us-ascii": "ascii", "ascii": "ascii", "iso-8859-1": "latin-1"}
"""Payload-encodings that are read. JADE names UTF-8 or none."""


class Envelope(msgspec.Struct, frozen=True, kw_only=True):
    """Where a message goes, and from whom. `intended`: the receivers whose copy this is; where
    there are none, those in `to`. JADE loses a message without `intended`.
    """

    to: tuple[Aid, ...]
    sender: Aid
    intended: tuple[Aid, ...] = ()
    date: At | None = None

    @property
    def receivers(self) -> tuple[Aid, ...]:
        """Whose copy this is."""
        return self.intended or self.to


# --- out ------------------------------------------------------------------------------------------

_WORD = re.compile(r"[^\x00-\x20\x7f-\x9f\ud800-\udfff\ufffe\uffff]+")
"""Names and addresses: no white space (SC00070I), and characters that XML 1.0 has."""


def pack(envelope: Envelope, text: bytes) -> tuple[str, bytes]:
    """Content type and body. `text`: an ACL message in UTF-8.

    Raise LocalProtocolError for a name or address that XML cannot hold.
    """
    xml = _xml(envelope, len(text)).encode()
    # not in the text: it would have to hold its own digest
    boundary = hashlib.sha256(xml + text).hexdigest()[:40]
    line = f"--{boundary}".encode()
    body = b"\r\n".join(
        [
            line, b"Content-Type: application/xml", b"", xml,
            line, b"Content-Type: application/text", b"", text,
            line + b"--", b"",
        ]
    )  # fmt: skip
    return f'multipart/mixed; boundary="{boundary}"', body


def _xml(envelope: Envelope, length: int) -> str:
    date = "" if envelope.date is None else print_date(envelope.date).removesuffix("Z")
    parts = (
        *(f"<to>{_aid_xml(aid)}</to>" for aid in envelope.to),
        f"<from>{_aid_xml(envelope.sender)}</from>",
        f"<acl-representation>{REPRESENTATION}</acl-representation>",
        f"<payload-length>{length}</payload-length>",
        # without it JADE reads what is not ASCII as U+FFFD
        "<payload-encoding>UTF-8</payload-encoding>",
        f"<date>{date}</date>" if date else "",
        *(f"<intended-receiver>{_aid_xml(aid)}</intended-receiver>" for aid in envelope.intended),
    )
    return (
        f'<?xml version="1.0"?>\n<envelope><params index="1">{"".join(parts)}</params></envelope>'
    )


def _aid_xml(aid: Aid, depth: int = 0) -> str:
    if depth >= MAX_DEPTH // 2:  # two elements for each
        raise LocalProtocolError("resolvers", f"are nested more than {MAX_DEPTH // 2} deep")
    urls = "".join(f"<url>{_word(url)}</url>" for url in aid.addresses)
    resolvers = "".join(_aid_xml(one, depth + 1) for one in aid.resolvers)
    return (
        f"<agent-identifier><name>{_word(aid.name)}</name>"
        + (f"<addresses>{urls}</addresses>" if urls else "")
        + (f"<resolvers>{resolvers}</resolvers>" if resolvers else "")
        + "</agent-identifier>"
    )


def _word(text: str) -> str:
    if not _WORD.fullmatch(text):
        raise LocalProtocolError("envelope", f"{text!r} has white space or no character of XML")
    return escape(text)


# --- in -------------------------------------------------------------------------------------------

_BOUNDARY = re.compile(
    r'^multipart/mixed *;.*\bboundary *= *(?:"([^"]{1,200})"|([^\s;"]{1,200}))', re.IGNORECASE
)
"""No other multipart: browsers send that of forms for whatever page has one."""
_HEADERS_END = re.compile(rb"\r?\n\r?\n")
_BLANK = " \t\r\n"


def unpack(content_type: str, body: bytes) -> tuple[Envelope, bytes]:
    """The envelope, and the ACL message in UTF-8, unread.

    Raise MalformedError, and no other exception, for what is none, or is in another representation.
    """
    found = _BOUNDARY.match(content_type)
    if found is None:
        raise MalformedError(
            "Content-Type", f"is {content_type[:80]!r}, must be multipart/mixed with a boundary"
        )
    boundary = (found[1] or found[2]).encode("latin-1", "replace")
    parts = re.split(rb"\r?\n--" + re.escape(boundary), b"\n" + body)
    if len(parts) < 4 or not parts[3].startswith(b"--"):
        raise MalformedError("body", "is not two parts, envelope and message, between boundaries")
    xml, text = map(_content, parts[1:3])
    if len(xml) > MAX_ENVELOPE_BYTES:
        raise MalformedError("envelope", f"has more than {MAX_ENVELOPE_BYTES} bytes")
    envelope, encoding = _read(xml)
    return envelope, text if encoding == "utf-8" else text.decode(encoding, "replace").encode()


def _content(part: bytes) -> bytes:
    """A part without its headers: which part it is, the order tells (SC00084)."""
    part = part.lstrip(b" \t")
    end = _HEADERS_END.search(part)
    if re.match(rb"\r?\n\r?\n", part):
        return re.sub(rb"^\r?\n\r?\n", b"", part)
    return part[end.end() :] if end else b""


class _Element:
    def __init__(self, name: str, attributes: dict[str, str]) -> None:
        self.name, self.attributes, self.text = name, attributes, ""
        self.inner: list[_Element] = []

    def all(self, *path: str) -> "Iterator[_Element]":
        """Every element below it by these names."""
        for one in self.inner:
            if one.name == path[0]:
                yield from one.all(*path[1:]) if path[1:] else (one,)

    def word(self, attribute: str) -> str:
        """Its text; SC00071E has an attribute in its place."""
        return self.text.strip(_BLANK) or self.attributes.get(attribute, "")


def _tree(xml: bytes) -> _Element:
    """The elements of a document. Raise MalformedError."""
    top = _Element("", {})
    path = [top]

    def begins(name: str, attributes: dict[str, str]) -> None:
        if len(path) > MAX_DEPTH * 2:
            raise MalformedError("envelope", f"has more than {MAX_DEPTH * 2} levels")
        element = _Element(name.rpartition(":")[2].lower(), attributes)
        path[-1].inner.append(element)
        path.append(element)

    def ends(_: str) -> None:
        path.pop()

    def says(text: str) -> None:
        path[-1].text += text

    def refuses(*_: Any) -> None:
        raise MalformedError("envelope", "has a document type; an envelope has none")

    # one encoding: Python would take any of its codecs for what a document names
    parser = expat.ParserCreate("UTF-8")
    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = begins, ends
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = says, refuses
    try:
        parser.Parse(xml.strip(_BLANK.encode()), True)
    except expat.ExpatError as error:
        raise MalformedError("envelope", f"is no XML: {error}") from error
    return top


def _read(xml: bytes) -> tuple[Envelope, str]:
    """An envelope and the payload's encoding. Of several `params` the last one that has a field
    counts (SC00067, 2.3.2): each transport may add one.
    """
    stamps = list(_tree(xml).all("envelope", "params"))
    stamps.sort(key=_index)

    def last(field: str) -> list[_Element]:
        found = (list(stamp.all(field)) for stamp in reversed(stamps))
        return next(filter(None, found), [])

    def word(field: str) -> str:
        return "".join(one.word("value") for one in last(field)[:1])

    def aids(field: str) -> tuple[Aid, ...]:
        return tuple(_aid(one) for part in last(field) for one in part.all("agent-identifier"))

    representation, encoding = word("acl-representation"), word("payload-encoding").lower()
    if representation.lower() != REPRESENTATION:
        raise MalformedError(
            "acl-representation", f"is {representation[:80]!r}, must be {REPRESENTATION}"
        )
    if encoding and encoding not in _ENCODINGS:
        raise MalformedError(
            "payload-encoding", f"is {encoding[:80]!r}, must be one of {', '.join(_ENCODINGS)}"
        )
    senders, to = aids("from"), aids("to")
    if len(senders) != 1 or not to:
        raise MalformedError("envelope", "must have one agent in `from`, and one or more in `to`")
    envelope = Envelope(
        to=to, sender=senders[0], intended=aids("intended-receiver"), date=_date(word("date"))
    )
    return envelope, _ENCODINGS.get(encoding, "utf-8")


def _index(stamp: _Element) -> int:
    text = stamp.attributes.get("index", "")[:9]
    return int(text) if text.isdecimal() else 0


def _aid(element: _Element) -> Aid:
    name = "".join(one.word("id") for one in list(element.all("name"))[:1])
    urls = (one.word("href") for one in element.all("addresses", "url"))
    addresses = tuple(filter(None, urls))
    if not all(_WORD.fullmatch(word) for word in (name, *addresses)):
        raise MalformedError("envelope", "has an agent-identifier whose name or address is no word")
    resolvers = element.all("resolvers", "agent-identifier")
    return Aid(name, addresses, tuple(map(_aid, resolvers)))


def _date(text: str) -> At | None:
    """The time, where it is one that can be read: nothing depends on it. JADE has a Z for the T."""
    data = text.encode()
    match = DATE.fullmatch(data[:8] + b"T" + data[9:] if data[8:9] in b"Zz" else data)
    try:
        found = None if match is None else read_date(match, UTC)
    except ValueError:
        return None
    return found if isinstance(found, At) else None
