"""The communicate M = <V, Z, L, O, I, t_b, m_w, m_t, m_c> (paper, section 3.3) with sender,
receiver, id and sent time.

On the wire it is a MessagePack map with the paper's letters as keys; fields with default values are
left out. The content stays undecoded (`msgspec.Raw`): only the language named in L can decode it.
Independent of protocols, transport and clocks.

`encode` and `decode` check the form: each accepts what the other produces, times are finite, and
content is exactly one MessagePack value. The characters of words and labels are checked by
`is_word`, `is_label` and `check_text`, where text enters a program: own names where they are
declared (languages, wirings), ids and labels in `Conversation`, and every field in programs that
print or translate messages of others (`decode_strictly`, `encode_strictly`).
"""

import re
from functools import lru_cache
from typing import Annotated

import msgspec
from msgspec import UNSET

from fipa_codec.errors import LocalProtocolError, MalformedError
from fipa_codec.performatives import Performative

MAX_BYTES = 4 * 1024 * 1024
"""Size limit of a communicate, both ways [bytes].

The paper's largest has 852 kB (section 5.7); the factor is an estimate.
"""
MAX_CONTENT_BYTES = MAX_BYTES - 1024
"""Size limit of outgoing content [bytes].

The other fields (five words, four labels, times) fit in the remaining 1024.
"""
LONGEST_LABEL = 128
"""Length limit of a label [characters]; labels are only compared. Estimate; keeps logs and journals
small.
"""
MOST_DIGITS = 18
"""Digits of a number in an id or a key: the largest fits into 63 bits."""
MAX_CHECKED = 4096
"""Size limit of the caches of checked words. Estimate: a system uses some hundred combinations;
bounds the memory that foreign messages can take.
"""
_FINITE = 1.7976931348623157e308

Seconds = Annotated[float, msgspec.Meta(ge=-_FINITE, le=_FINITE)]
WORD = r"[A-Za-z][A-Za-z0-9_.@-]{0,63}"
"""FIPA's Word (SC00070I), restricted: words are used in addresses and file names, so without blanks
and separators.
"""
LABEL = rf"[!-~]{{1,{LONGEST_LABEL}}}"

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
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    omit_defaults=True,
    forbid_unknown_fields=True,
    gc=False,
    rename=_LETTERS,
):
    """One message. An empty string means: absent. Times are in unix seconds.

    `reply_by` is None without a time limit; `content` is UNSET without content.
    """

    performative: Performative
    content: msgspec.Raw | msgspec.UnsetType = msgspec.UNSET
    language: str = ""
    ontology: str = ""
    protocol: str = ""
    reply_by: Seconds | None = None
    reply_with: str = ""
    in_reply_to: str = ""
    conversation: str = ""
    sender: str = ""
    receiver: str = ""
    id: str = ""
    sent: Seconds = 0.0


_encode = msgspec.msgpack.Encoder().encode
_decode = msgspec.msgpack.Decoder(Communicate).decode
_validate = msgspec.msgpack.Decoder(msgspec.Raw).decode
_word, _label = re.compile(WORD).fullmatch, re.compile(LABEL).fullmatch
_WORDS = ("language", "ontology", "protocol", "sender", "receiver")
_LABELS = ("reply_with", "in_reply_to", "conversation", "id")
_checked: set[tuple[str, str, str, str, str]] = set()


def encode(communicate: Communicate) -> bytes:
    """The bytes of a communicate. Raise LocalProtocolError if the receiver could not decode
    them.
    """
    try:
        data = _encode(communicate)
        times = communicate.sent + (communicate.reply_by or 0.0)
        if times - times == 0.0 and len(data) <= MAX_BYTES:  # neither infinite nor NaN
            content = communicate.content
            if content is UNSET or _validate(content):
                return data
        decode(data)  # raises the precise error
    except MalformedError as error:
        raise LocalProtocolError(error.field, error.reason) from error
    except Exception as error:
        raise LocalProtocolError("communicate", f"cannot be encoded: {error}") from error
    return data


def decode(data: bytes) -> Communicate:
    """The communicate in `data`, which need not be trusted.

    Raise MalformedError with the field and the reason.
    """
    try:
        if len(data) > MAX_BYTES:
            raise MalformedError(
                "communicate", f"has {len(data)} bytes, at most {MAX_BYTES} are accepted"
            )
        return _decode(data)
    except MalformedError:
        raise
    except Exception as error:
        field, reason = explain(error, "communicate", _LETTERS)
        if "float` >=" in reason or "float` <=" in reason:
            reason = "is not finite, must be unix seconds"
        raise MalformedError(field, reason) from error


def encode_strictly(communicate: Communicate) -> bytes:
    """What `encode` returns. Raise LocalProtocolError also for text that is not a valid word or
    label.
    """
    try:
        check_text(communicate)
    except MalformedError as error:
        raise LocalProtocolError(error.field, error.reason) from error
    return encode(communicate)


def decode_strictly(data: bytes) -> Communicate:
    """What `decode` returns, safe to print and translate.

    Raise MalformedError also for text that is not a valid word or label.
    """
    communicate = decode(data)
    check_text(communicate)
    return communicate


def check_text(communicate: Communicate) -> None:
    """Raise MalformedError with the first field whose text is not a valid word or label.

    A regular expression costs more than decoding. So combinations of words that were valid before
    are cached, and the labels are checked together: their concatenation is valid only if each is.
    """
    one = communicate
    words = (one.language, one.ontology, one.protocol, one.sender, one.receiver)
    if words in _checked and is_label(one.reply_with + one.in_reply_to + one.conversation + one.id):
        return
    for names, matches, pattern in ((_WORDS, _word, WORD), (_LABELS, _label, LABEL)):
        for name in names:
            text = getattr(one, name)
            if text and not matches(text):
                shown = repr(text[:LONGEST_LABEL])
                if len(text) > LONGEST_LABEL:
                    shown += f"... ({len(text)} characters)"
                raise MalformedError(
                    f"{name} ({_LETTERS[name]})", f"is {shown}, must match {pattern}"
                )
    if len(_checked) >= MAX_CHECKED:
        _checked.clear()
    _checked.add(words)


@lru_cache(MAX_CHECKED)
def is_word(text: str) -> bool:
    """Whether the text is a valid name of an agent, protocol, language or ontology."""
    return _word(text) is not None


def is_label(text: str) -> bool:
    """Whether the text is a valid id, label or conversation id: printable ASCII without blanks."""
    return (
        0 < len(text) <= LONGEST_LABEL and text.isascii() and text.isprintable() and " " not in text
    )


def number_of(text: str) -> int | None:
    """The number that is written in ASCII digits. None for any other text, and for more digits
    than a counter ever has.

    int() takes other digits too, and raises ValueError beyond 4300.
    """
    return int(text) if text.isascii() and text.isdigit() and len(text) <= MOST_DIGITS else None


UNREADABLE = (msgspec.MsgspecError, RecursionError, UnicodeDecodeError, MemoryError)
"""Errors that msgspec raises on foreign bytes: malformed, nested too deeply, not UTF-8, wrong
lengths.
"""


def explain(error: Exception, whole: str, letters: dict[str, str] | None = None) -> tuple[str, str]:
    """Field and reason of an exception that msgspec raised on foreign bytes.

    `letters` maps attribute names to wire names. Besides its own errors msgspec passes on
    RecursionError (nesting), UnicodeDecodeError and MemoryError (wrong lengths); all are the
    sender's fault.
    """
    if isinstance(error, RecursionError):
        return whole, "is nested too deeply"
    if isinstance(error, UnicodeDecodeError):
        return whole, f"contains text that is not UTF-8: {error.reason}"
    if isinstance(error, MemoryError):
        return whole, "declares a length that does not fit into memory"
    text, _, path = str(error).partition(" - at `")
    # Missing and unknown fields have no path: msgspec names them in the text.
    named = text.partition("required field `")[2] or text.partition("unknown field `")[2]
    field = (
        path.removesuffix("`").removeprefix("$").removeprefix(".")
        or named.removesuffix("`")
        or whole
    )
    names = {wire: name for name, wire in (letters or {}).items()}
    return (f"{names[field]} ({field})" if field in names else field), text
