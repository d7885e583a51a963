"""The communicate M = <V, Z, L, O, I, t_b, m_w, m_t, m_c> (paper, section 3.3) with sender, receiver, id and sent time.

The wire form is a MessagePack map with the paper's letters as keys; what has its default is left out. The content stays
undecoded (`msgspec.Raw`): only the language named in L may read it. Must not know: protocols, transport, clocks.
"""

import math
from typing import Annotated

import msgspec

from fipa_codec.errors import LocalProtocolError, MalformedError
from fipa_codec.performatives import Performative

MAX_BYTES = 4 * 1024 * 1024
"""Longest communicate taken or made. The paper's largest has 852 kB (section 5.7); four times that, estimate."""

# Words go into addresses and file names of others: no blanks, no separators (FIPA's Word, SC00070I, made stricter).
Word = Annotated[str, msgspec.Meta(pattern=r"\A[A-Za-z][A-Za-z0-9_.@-]*\Z", max_length=64)]
# Ids are chosen by agents and only compared; the length is an estimate that keeps logs and journals small.
Label = Annotated[str, msgspec.Meta(pattern=r"\A[!-~]+\Z", max_length=128)]

_LETTERS = {
    "performative": "V",
    "content": "Z",
    "language": "L",
    "ontology": "O",
    "protocol": "I",
    "reply_by": "t_b",
    "reply_with": "m_w",
    "in_reply_to": "m_t",
    "conversation": "m_c",
    "sender": "s",
    "receiver": "r",
    "id": "id",
    "sent": "t",
}


class Communicate(
    msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True, forbid_unknown_fields=True, rename=_LETTERS
):
    """One message. "" means: absent. Times in unix seconds; `reply_by` None: no limit; `content` UNSET: no content."""

    performative: Performative
    content: msgspec.Raw | msgspec.UnsetType = msgspec.UNSET
    language: Word = ""
    ontology: Word = ""
    protocol: Word = ""
    reply_by: float | None = None
    reply_with: Label = ""
    in_reply_to: Label = ""
    conversation: Label = ""
    sender: Word = ""
    receiver: Word = ""
    id: Label = ""
    sent: float = 0.0


_encoder = msgspec.msgpack.Encoder()
_decoder = msgspec.msgpack.Decoder(Communicate)


def encode(communicate: Communicate) -> bytes:
    """Bytes of a communicate. LocalProtocolError where the other side could not decode them."""
    try:
        data = _encoder.encode(communicate)
        decode(data)
    except MalformedError as error:
        raise LocalProtocolError(error.field, error.reason) from error
    except (TypeError, ValueError, OverflowError, msgspec.MsgspecError) as error:
        raise LocalProtocolError("communicate", f"cannot be encoded: {error}") from error
    return data


def decode(data: bytes) -> Communicate:
    """The communicate in `data`, which may come from anywhere. MalformedError names the field and the reason."""
    if len(data) > MAX_BYTES:
        raise MalformedError("communicate", f"has {len(data)} bytes, at most {MAX_BYTES} are taken")
    try:
        communicate = _decoder.decode(data)
    except Exception as error:
        raise MalformedError(*explain(error, "communicate", _LETTERS)) from error
    _require_finite(communicate)
    return communicate


def envelope_size(communicate: Communicate) -> int:
    """Bytes of everything but the content."""
    return len(_encoder.encode(msgspec.structs.replace(communicate, content=msgspec.UNSET)))


def explain(error: Exception, whole: str, letters: dict[str, str] | None = None) -> tuple[str, str]:
    """Field and reason of what msgspec raised on foreign bytes; `letters`: python name -> wire name of the fields.

    Besides its own errors msgspec lets RecursionError (nesting), UnicodeDecodeError and MemoryError (lengths that lie)
    through; all of them are the sender's fault.
    """
    if isinstance(error, RecursionError):
        return whole, "is nested too deeply"
    if isinstance(error, UnicodeDecodeError):
        return whole, f"holds text that is no UTF-8: {error.reason}"
    if isinstance(error, MemoryError):
        return whole, "announces more than fits into memory"
    text, _, path = str(error).partition(" - at `")
    field = path.removesuffix("`").removeprefix("$").removeprefix(".") or _missing(text) or whole
    names = {wire: name for name, wire in (letters or {}).items()}
    return (f"{names[field]} ({field})" if field in names else field), text


def _missing(text: str) -> str:
    """The field that msgspec names inside the sentence: missing or unknown ones have no path of their own."""
    _, _, rest = text.partition("required field `")
    if not rest:
        _, _, rest = text.partition("unknown field `")
    return rest.removesuffix("`")


def _require_finite(communicate: Communicate) -> None:
    """A time that is no number would make every comparison with a clock false."""
    for name in ("reply_by", "sent"):
        value = getattr(communicate, name)
        if value is not None and not math.isfinite(value):
            raise MalformedError(f"{name} ({_LETTERS[name]})", f"is {value}, must be finite unix seconds")
