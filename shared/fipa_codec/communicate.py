"""The communicate M = <V, Z, L, O, I, t_b, m_w, m_t, m_c> (paper, section 3.3) with sender, receiver, id and sent time.

The wire form is a MessagePack map with the paper's letters as keys; what has its default is left out. The content stays
undecoded (`msgspec.Raw`): only the language named in L may read it. Must not know: protocols, transport, clocks.

`encode` and `decode` see to the form: what one gives the other takes, times are finite, content is one whole value.
Which characters a word or a label may have is another rule, of `is_word`, `is_label` and `examine`. It is applied where
text gets in: to own names where they are declared (languages, wirings), to ids and labels by `Conversation`, and to
everything by whoever prints or translates what others said (`decode_strictly`, `encode_strictly`).
"""

import re
from functools import lru_cache
from typing import Annotated

import msgspec
from msgspec import UNSET

from fipa_codec.errors import LocalProtocolError, MalformedError
from fipa_codec.performatives import Performative

MAX_BYTES = 4 * 1024 * 1024
"""Longest communicate taken or made. The paper's largest has 852 kB (section 5.7); four times that, estimate."""
MAX_CONTENT_BYTES = MAX_BYTES - 1024
"""Longest content said: all other fields together have less, five words of 64 characters and four labels at most."""
LONGEST_LABEL = 128
"""Characters of an id. Ids are chosen by agents and only compared; an estimate that keeps logs and journals small."""
KNOWN_BOUND = 4096
"""Combinations of words kept as right; estimate: a system has some hundred, and strangers may not fill the memory."""
_FINITE = 1.7976931348623157e308

Seconds = Annotated[float, msgspec.Meta(ge=-_FINITE, le=_FINITE)]
WORD = r"[A-Za-z][A-Za-z0-9_.@-]{0,63}"
"""FIPA's Word (SC00070I), made stricter: they go into addresses and file names, so no blanks and no separators."""
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
    msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True, forbid_unknown_fields=True, gc=False, rename=_LETTERS
):
    """One message; fields have the types declared. "" means: absent. Times in unix seconds.

    `reply_by` None: no limit; `content` UNSET: no content.
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
_walk_through = msgspec.msgpack.Decoder(msgspec.Raw).decode
_word, _label = re.compile(WORD).fullmatch, re.compile(LABEL).fullmatch
_WORDS = ("language", "ontology", "protocol", "sender", "receiver")
_LABELS = ("reply_with", "in_reply_to", "conversation", "id")
_known: set[tuple[str, str, str, str, str]] = set()


def encode(communicate: Communicate) -> bytes:
    """Bytes of a communicate. LocalProtocolError where the other side could not decode them."""
    try:
        data = _encode(communicate)
        times = communicate.sent + (communicate.reply_by or 0.0)
        if times - times == 0.0 and len(data) <= MAX_BYTES:  # neither infinite nor NaN
            content = communicate.content
            if content is UNSET or _walk_through(content):
                return data
        decode(data)  # has the last word, and the words for the error
    except MalformedError as error:
        raise LocalProtocolError(error.field, error.reason) from error
    except Exception as error:
        raise LocalProtocolError("communicate", f"cannot be encoded: {error}") from error
    return data


def decode(data: bytes) -> Communicate:
    """The communicate in `data`, which may come from anywhere. MalformedError names the field and the reason."""
    if len(data) > MAX_BYTES:
        raise MalformedError("communicate", f"has {len(data)} bytes, at most {MAX_BYTES} are taken")
    try:
        return _decode(data)
    except Exception as error:
        field, reason = explain(error, "communicate", _LETTERS)
        if "float` >=" in reason or "float` <=" in reason:
            reason = "is infinite or no number, must be finite unix seconds"
        raise MalformedError(field, reason) from error


def encode_strictly(communicate: Communicate) -> bytes:
    """As `encode`; LocalProtocolError also where a word or a label is none."""
    try:
        examine(communicate)
    except MalformedError as error:
        raise LocalProtocolError(error.field, error.reason) from error
    return encode(communicate)


def decode_strictly(data: bytes) -> Communicate:
    """As `decode`; MalformedError also where a word or a label is none. For all that is printed or translated."""
    communicate = decode(data)
    examine(communicate)
    return communicate


def examine(communicate: Communicate) -> None:
    """MalformedError names the first field whose text is no word or label, as the case may be.

    A pattern costs more than decoding does. So words that were right before are known, and labels that are right
    together are so one by one.
    """
    one = communicate
    words = (one.language, one.ontology, one.protocol, one.sender, one.receiver)
    if words in _known and is_label(one.reply_with + one.in_reply_to + one.conversation + one.id):
        return
    for names, fits, wanted in ((_WORDS, _word, WORD), (_LABELS, _label, LABEL)):
        for name in names:
            text = getattr(one, name)
            if text and not fits(text):
                told = (
                    f"{text[:LONGEST_LABEL]!r}... ({len(text)} characters)" if len(text) > LONGEST_LABEL else repr(text)
                )
                raise MalformedError(f"{name} ({_LETTERS[name]})", f"is {told}, must match {wanted}")
    if len(_known) >= KNOWN_BOUND:
        _known.clear()
    _known.add(words)


@lru_cache(KNOWN_BOUND)
def is_word(text: str) -> bool:
    """Whether this may be the name of an agent, protocol, language or ontology."""
    return _word(text) is not None


def is_label(text: str) -> bool:
    """Whether this may be an id, a label or the name of a conversation: printable ASCII without blanks."""
    return 0 < len(text) <= LONGEST_LABEL and text.isascii() and text.isprintable() and " " not in text


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
