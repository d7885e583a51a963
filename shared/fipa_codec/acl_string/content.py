"""How the content of a communicate, MessagePack of any kind, stands in the text of an ACL message, and back.

The most readable of three forms that gives the same bytes again:
  text    a MessagePack string, as it is; no encoding named. Content of other platforms (fipa-sl, ...) comes in so
  json    `:encoding json`: what JSON can say; the tagged Structs of a content language look as msgspec writes them
  base64  `:encoding msgpack-base64`: base64 of the MessagePack, for all else (bytes, NaN, keys that are no text), with
          `:X-JADE-Encoding Base64`, by which JADE hands the bytes to its agent

Must not know: content languages.
"""

import base64
import binascii
import re
from enum import StrEnum

import msgspec

from fipa_codec.communicate import MAX_BYTES, explain
from fipa_codec.errors import MalformedError

JSON = "json"
MSGPACK_BASE64 = "msgpack-base64"
JADE_ENCODING = "X-JADE-Encoding"
JADE_BASE64 = "Base64"

# JADE trims content, a trailing backslash cannot be quoted, and control characters are for no one to read.
_PLAIN_TEXT = re.compile(r"[^\s\x00-\x1f\x7f](?:[^\x00-\x08\x0b-\x1f\x7f]*[^\s\x00-\x1f\x7f\\])?(?<!\\)")


class Form(StrEnum):
    """How content is written: for people where it can be, or always as base64 of the bytes."""

    READABLE = "readable"
    BINARY = "binary"


def write(content: msgspec.Raw, form: Form) -> tuple[str, str | None]:
    """Text and encoding of well-formed MessagePack, such that `read` gives the same bytes."""
    return (_readable(content) if form is Form.READABLE else None) or (
        base64.b64encode(content).decode(),
        MSGPACK_BASE64,
    )


def read(content: str | bytes, encoding: str | None, jade_encoding: str | None) -> msgspec.Raw:
    """MessagePack of content; text of an encoding that is not ours is a string. MalformedError where it is not what
    its encoding says."""
    named = (encoding or "").lower()
    try:
        if named == MSGPACK_BASE64:
            return msgspec.Raw(_from_base64(content))
        if named == JSON:
            return _packed(msgspec.json.decode(content))
        if (jade_encoding or "").lower() == JADE_BASE64.lower():
            return _packed(_from_base64(content))
        return _packed(content)
    except Exception as error:
        _, reason = explain(error, "content")
        raise MalformedError("content", f"is not {encoding or jade_encoding or 'text'}: {reason}") from error


def _readable(content: msgspec.Raw) -> tuple[str, str | None] | None:
    try:
        value = msgspec.msgpack.decode(content)
        if isinstance(value, str) and _PLAIN_TEXT.fullmatch(value):
            written: tuple[str, str | None] = (value, None)
        else:
            written = (msgspec.json.encode(value).decode(), JSON)
        same = len(written[0].encode()) <= MAX_BYTES and read(*written, None) == content
    except Exception:
        # Whatever cannot be read here or said in JSON (invalid text, keys that do not hash, extensions, nesting) is
        # none of our business: it travels as bytes.
        return None
    return written if same else None


def _packed(value: object) -> msgspec.Raw:
    return msgspec.Raw(msgspec.msgpack.encode(value))


def _from_base64(content: str | bytes) -> bytes:
    raw = content.encode() if isinstance(content, str) else content
    try:
        return base64.b64decode(b"".join(raw.split()), validate=True)
    except binascii.Error as error:
        raise ValueError(str(error)) from error
