"""The content of a communicate (any MessagePack) in the text of an ACL message, both ways.

Of three forms the most readable one that decodes to the same bytes is used:
  text    a MessagePack string as it is, without an encoding; content of other platforms (fipa-sl, ...) is read so
  json    `:encoding json`: values that JSON can represent; tagged Structs of a content language as msgspec writes them
  base64  `:encoding msgpack-base64`: base64 of the MessagePack for other values (bytes, NaN, keys that are not
          strings), with `:X-JADE-Encoding Base64`, so that JADE decodes it for its agents

Independent of content languages.
"""

import base64
import binascii
import re
from contextlib import suppress
from enum import StrEnum

import msgspec

from fipa_codec.communicate import MAX_BYTES, explain
from fipa_codec.errors import MalformedError

JSON = "json"
MSGPACK_BASE64 = "msgpack-base64"
JADE_ENCODING = "X-JADE-Encoding"
JADE_BASE64 = "Base64"

# JADE strips content, a trailing backslash cannot be quoted, and control characters are not readable.
_PLAIN_TEXT = re.compile(r"[^\s\x00-\x1f\x7f](?:[^\x00-\x08\x0b-\x1f\x7f]*[^\s\x00-\x1f\x7f\\])?(?<!\\)")


class Form(StrEnum):
    """The form of content: readable if possible, or always base64."""

    READABLE = "readable"
    BINARY = "binary"


def write(content: msgspec.Raw, form: Form) -> tuple[str, str | None]:
    """Return text and encoding of well-formed MessagePack, such that `read` returns the same bytes."""
    return (_readable(content) if form is Form.READABLE else None) or (
        base64.b64encode(content).decode(),
        MSGPACK_BASE64,
    )


def read(content: str | bytes, encoding: str | None, jade_encoding: str | None) -> msgspec.Raw:
    """Return content as MessagePack; with an encoding of other platforms it is a string.

    Raise MalformedError if the content does not have its encoding; one that JADE's parameter names wrongly is ignored.
    """
    named = (encoding or "").lower()
    try:
        if named == MSGPACK_BASE64:
            return msgspec.Raw(_from_base64(content))
        if named == JSON:
            return _packed(msgspec.json.decode(content))
        if (jade_encoding or "").lower() == JADE_BASE64.lower():
            with suppress(ValueError):
                return _packed(_from_base64(content))
        return _packed(content)
    except Exception as error:
        _, reason = explain(error, "content")
        raise MalformedError("content", f"is not {encoding or 'text'}: {reason}") from error


def _readable(content: msgspec.Raw) -> tuple[str, str | None] | None:
    try:
        value = msgspec.msgpack.decode(content)
        if isinstance(value, str) and _PLAIN_TEXT.fullmatch(value):
            written: tuple[str, str | None] = (value, None)
        else:
            written = (msgspec.json.encode(value).decode(), JSON)
        same = len(written[0].encode()) <= MAX_BYTES and read(*written, None) == content
    except Exception:
        # MessagePack that cannot be decoded here or represented in JSON (invalid text, unhashable keys, extensions,
        # deep nesting) is sent as bytes.
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
