"""The communicate M = <V, Z, L, O, I, t_b, m_w, m_t, m_c> (paper, section 3.3) with sender, receiver, id and sent time.

The wire form is a MessagePack map with the paper's letters as keys; what has its default is left out. The content stays
undecoded (`msgspec.Raw`): only the language named in L may read it. Must not know: protocols, transport, clocks.

Checking characters by patterns costs six times what the decoding itself does. So both ways first try a cheap proof
(words seen to be right before, labels printable ASCII); what it does not prove is examined with the patterns, which
decide and have the words for the error.
"""

import math
from typing import Annotated, Any, get_type_hints

import msgspec

from fipa_codec.errors import LocalProtocolError, MalformedError
from fipa_codec.performatives import Performative

MAX_BYTES = 4 * 1024 * 1024
"""Longest communicate taken or made. The paper's largest has 852 kB (section 5.7); four times that, estimate."""
LONGEST_LABEL = 128
"""Characters of an id. Ids are chosen by agents and only compared; an estimate that keeps logs and journals small."""
KNOWN_BOUND = 4096
"""Combinations of words kept as right; estimate: a system has some hundred, and strangers may not fill the memory."""
_FINITE = 1.7976931348623157e308

# What msgspec checks in passing; the patterns below decide about the characters.
Word = Annotated[str, msgspec.Meta(min_length=1, max_length=64)]
Label = Annotated[str, msgspec.Meta(min_length=1, max_length=LONGEST_LABEL)]
Seconds = Annotated[float, msgspec.Meta(ge=-_FINITE, le=_FINITE)]

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
    msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True, forbid_unknown_fields=True, gc=False, rename=_LETTERS
):
    """One message. "" means: absent. Times in unix seconds; `reply_by` None: no limit; `content` UNSET: no content."""

    performative: Performative
    content: msgspec.Raw | msgspec.UnsetType = msgspec.UNSET
    language: Word = ""
    ontology: Word = ""
    protocol: Word = ""
    reply_by: Seconds | None = None
    reply_with: Label = ""
    in_reply_to: Label = ""
    conversation: Label = ""
    sender: Word = ""
    receiver: Word = ""
    id: Label = ""
    sent: Seconds = 0.0


_PATTERNS: dict[Any, Any] = {
    # Words go into addresses and file names of others: no blanks, no separators (FIPA's Word, SC00070I, made stricter).
    Word: Annotated[str, msgspec.Meta(pattern=r"\A[A-Za-z][A-Za-z0-9_.@-]*\Z", max_length=64)],
    Label: Annotated[str, msgspec.Meta(pattern=r"\A[!-~]+\Z", max_length=LONGEST_LABEL)],
    Seconds: float,
    Seconds | None: float | None,
}


def _exact() -> Any:
    """A Struct of the same fields, whose words and labels msgspec checks by their patterns."""
    hints = get_type_hints(Communicate, include_extras=True)
    defaults = {field.name: field.default for field in msgspec.structs.fields(Communicate)}
    fields = [(name, _PATTERNS.get(hint, hint), defaults[name]) for name, hint in hints.items()]
    return msgspec.defstruct("Exact", fields, kw_only=True, forbid_unknown_fields=True, rename=_LETTERS)


_encode = msgspec.msgpack.Encoder().encode
_decode = msgspec.msgpack.Decoder(Communicate).decode
_decode_exactly = msgspec.msgpack.Decoder(_exact()).decode
_walk_through = msgspec.msgpack.Decoder(msgspec.Raw).decode
_known: set[tuple[str, str, str, str, str]] = set()


def encode(communicate: Communicate) -> bytes:
    """Bytes of a communicate. LocalProtocolError where the other side could not decode them."""
    try:
        data = _encode(communicate)
        if not (_familiar(communicate) and _sound(communicate) and len(data) <= MAX_BYTES):
            _examined(data)
    except MalformedError as error:
        raise LocalProtocolError(error.field, error.reason) from error
    except Exception as error:
        raise LocalProtocolError("communicate", f"cannot be encoded: {error}") from error
    return data


def decode(data: bytes) -> Communicate:
    """The communicate in `data`, which may come from anywhere. MalformedError names the field and the reason."""
    if len(data) <= MAX_BYTES:
        try:
            communicate = _decode(data)
            if _familiar(communicate):
                return communicate
        except Exception:  # the examination finds it too, and has the words for it
            pass
    return _examined(data)


def envelope_size(communicate: Communicate) -> int:
    """Bytes of everything but the content."""
    return len(_encode(msgspec.structs.replace(communicate, content=msgspec.UNSET)))


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


def _familiar(one: Communicate) -> bool:
    """Whether the words are known to be right, and the labels are printable ASCII without blanks, as they must be.

    Labels that are longer together than one may be are left to the examination.
    """
    labels = one.reply_with + one.in_reply_to + one.conversation + one.id
    return (
        (one.language, one.ontology, one.protocol, one.sender, one.receiver) in _known
        and labels.isascii()
        and labels.isprintable()
        and " " not in labels
        and len(labels) <= LONGEST_LABEL
    )


def _sound(one: Communicate) -> bool:
    """Whether the rest of an own communicate would decode; the content is walked through, not decoded."""
    sent, end = one.sent, one.reply_by
    return (
        one.performative.__class__ is Performative
        and (sent.__class__ is float and sent - sent == 0.0)  # neither infinite nor NaN
        and (end is None or (end.__class__ is float and end - end == 0.0))
        and (one.content is msgspec.UNSET or _walk_through(one.content) is not None)
    )


def _examined(data: bytes) -> Communicate:
    """Decode with everything checked. MalformedError; right words are known from then on."""
    if len(data) > MAX_BYTES:
        raise MalformedError("communicate", f"has {len(data)} bytes, at most {MAX_BYTES} are taken")
    try:
        exact = _decode_exactly(data)
        _require_finite(exact)
        communicate = _decode(data)
    except MalformedError:
        raise
    except Exception as error:
        raise MalformedError(*explain(error, "communicate", _LETTERS)) from error
    if len(_known) >= KNOWN_BOUND:
        _known.clear()
    _known.add((exact.language, exact.ontology, exact.protocol, exact.sender, exact.receiver))
    return communicate


def _require_finite(communicate: Any) -> None:
    """A time that is no number would make every comparison with a clock false."""
    for name in ("reply_by", "sent"):
        value = getattr(communicate, name)
        if value is not None and not math.isfinite(value):
            raise MalformedError(f"{name} ({_LETTERS[name]})", f"is {value}, must be finite unix seconds")
