"""Communicate <-> ACL message, without loss in both directions.

Other platforms understand the parameters of SC00061G; values that these cannot represent are in
user-defined parameters:
  X-id, X-sent        id and sent time (unix seconds); no parameter of FIPA has these
  X-reply-by          unix seconds, if reply-by with its milliseconds and four-digit years is not
                      exact
  X-act, X-protocol   if the standard's name would be mapped back to another one
A user-defined parameter only refines its standard parameter; if the two disagree (another platform
copied it into a changed message), or it says nothing here (another platform means something else by
the name), it is ignored. inform-ref and inform-if are macro acts, which are not sent (SC00037J):
they are mapped to inform. FIPA's token of a protocol means that of the profile: by `Profile.FIPA`
fipa-query is `fipa-query`, by `Profile.PAPER` it is `query`, and an inform in it is inform-ref,
with which the paper answers a query. What is not a word or label of ours (a blank in a
conversation-id, a nested ontology) is escaped (`escapes`).
"""

import base64
import binascii
import math
import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from enum import StrEnum
from typing import NamedTuple
from urllib.parse import quote, unquote_to_bytes

import msgspec

from fipa_codec.acl_string.message import MAX_MS, MIN_MS, AclMessage, After, Aid, At
from fipa_codec.communicate import (
    MAX_BYTES,
    Communicate,
    decode_strictly,
    encode_strictly,
    explain,
    is_label,
    is_word,
)
from fipa_codec.errors import LocalProtocolError, MalformedError
from fipa_codec.performatives import Performative
from fipa_codec.protocols import QUERY, REQUEST, SUBSCRIBE, Profile, named

# --- Any text of another platform as a word or label of ours, and back, one to one ----------------
# A text that is a word or label already stays what it is. Any other text becomes `acl:` (label) or
# `acl-` (word) and the text with its other characters as two hexadecimal digits per byte of UTF-8:
# the label `a b` is `acl:a%20b`, the word `ams@host:1099/JADE` is `acl-ams@host_3A1099_2FJADE`. A
# text that looks like such an escape is escaped, too.


class Escape(NamedTuple):
    """Escaping of one kind of text; `mark`: the characters before two hexadecimal digits."""

    fits: Callable[[str], bool]
    prefix: str
    mark: str
    safe: str

    def enter(self, text: str) -> str:
        """Our text for one of another platform; it can be too long to be a word or label.

        Raise UnicodeEncodeError for half a surrogate pair.
        """
        return text if self._stays(text) else self._escaped(text)

    def leave(self, text: str) -> str:
        """The text of another platform for one of ours."""
        meant = self._meant_by(text)
        return text if meant is None else meant

    def _escaped(self, text: str) -> str:
        quoted = quote(text, safe=self.safe)
        if self.mark != "%":  # a character outside of `safe` that quote leaves as it is
            quoted = re.sub("[~_]", lambda found: f"%{ord(found[0]):02X}", quoted).replace(
                "%", self.mark
            )
        return self.prefix + quoted

    def _meant_by(self, text: str) -> str | None:
        """What a text of ours stands for, None unless it is what `enter` makes of it."""
        if not text.startswith(self.prefix):
            return None
        try:
            meant = unquote_to_bytes(
                text.removeprefix(self.prefix).replace(self.mark, "%")
            ).decode()
        except UnicodeDecodeError:
            return None
        return None if self._stays(meant) or self._escaped(meant) != text else meant

    def _stays(self, text: str) -> bool:
        return not text or (self.fits(text) and self._meant_by(text) is None)


LABEL = Escape(is_label, "acl:", "%", "!\"#$&'()*+,-./:;<=>?@[\\]^_`{|}~")
WORD = Escape(is_word, "acl-", "_", "@-.")


# --- The content of a communicate (any MessagePack) in the text of an ACL message, both ways ------
# Of three forms the most readable one that decodes to the same bytes is used:
# text    a MessagePack string as it is, without an encoding; content of other platforms (fipa-sl,
# ...) is read so
# json    `:encoding json`: values that JSON can represent; tagged Structs of a content language as
# msgspec writes
#           them
# base64  `:encoding msgpack-base64`: base64 of the MessagePack for other values (bytes, NaN, keys
# that are not
#           strings), with `:X-JADE-Encoding Base64`, so that JADE decodes it for its agents
#
# Independent of content languages.


JSON = "json"
MSGPACK_BASE64 = "msgpack-base64"
JADE_ENCODING = "X-JADE-Encoding"
JADE_BASE64 = "Base64"

# JADE strips content, a trailing backslash cannot be quoted, and control characters are not
# readable.
_PLAIN_TEXT = re.compile(
    r"[^\s\x00-\x1f\x7f](?:[^\x00-\x08\x0b-\x1f\x7f]*[^\s\x00-\x1f\x7f\\])?(?<!\\)"
)


class Form(StrEnum):
    """The form of content: readable if possible, or always base64."""

    READABLE = "readable"
    BINARY = "binary"


def write(content: msgspec.Raw, form: Form) -> tuple[str, str | None]:
    """Text and encoding of well-formed MessagePack, such that `read` returns the same bytes."""
    return (_readable(content) if form is Form.READABLE else None) or (
        base64.b64encode(content).decode(),
        MSGPACK_BASE64,
    )


def read(content: str | bytes, encoding: str | None, jade_encoding: str | None) -> msgspec.Raw:
    """Content as MessagePack; with an encoding of other platforms it is a string.

    Raise MalformedError if the content does not have its encoding; one that JADE's parameter names
    wrongly is ignored.
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
        # MessagePack that cannot be decoded here or represented in JSON (invalid text, unhashable
        # keys, extensions, deep nesting) is sent as bytes.
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


# --- Communicate <-> ACL message, without loss in both directions ---------------------------------


ID, SENT, REPLY_BY, ACT, PROTOCOL = "X-id", "X-sent", "X-reply-by", "X-act", "X-protocol"

_PAPERS = {f"fipa-{protocol.name}": protocol.name for protocol in (REQUEST, QUERY, SUBSCRIBE)}
_TOKENS = {name: token for token, name in _PAPERS.items()}
_MACRO_ACTS = (Performative.INFORM_REF, Performative.INFORM_IF)
_NOBODY: Mapping[str, Aid] = {}


def to_acl(
    communicate: Communicate,
    *,
    names: Mapping[str, Aid] = _NOBODY,
    form: Form = Form.READABLE,
    profile: Profile = Profile.FIPA,
) -> AclMessage:
    """The ACL message of a communicate; `from_acl` of the same profile returns the same
    communicate.

    `names`: identifiers (with addresses) by names of agents. Raise LocalProtocolError if the
    communicate is not valid (`encode_strictly`).
    """
    encode_strictly(communicate)
    message = AclMessage(
        performative=_act_out(communicate.performative),
        sender=_aid(communicate.sender, names) if communicate.sender else None,
        receiver=(_aid(communicate.receiver, names),) if communicate.receiver else (),
        language=WORD.leave(communicate.language) or None,
        ontology=WORD.leave(communicate.ontology) or None,
        protocol=_token_of(communicate.protocol) or None,
        conversation_id=LABEL.leave(communicate.conversation) or None,
        reply_with=LABEL.leave(communicate.reply_with) or None,
        in_reply_to=LABEL.leave(communicate.in_reply_to) or None,
        reply_by=None if communicate.reply_by is None else _at(communicate.reply_by),
        user=_user(communicate, profile),
    )
    if communicate.content is msgspec.UNSET:
        return message
    text, encoding = write(communicate.content, form)
    jade = {JADE_ENCODING: JADE_BASE64} if encoding == MSGPACK_BASE64 else {}
    user = message.user | jade
    return msgspec.structs.replace(message, content=text, encoding=encoding, user=user)


def from_acl(
    message: AclMessage,
    received: float,
    *,
    names: Mapping[str, Aid] = _NOBODY,
    receiver: str = "",
    profile: Profile = Profile.FIPA,
) -> Communicate:
    """The communicate of an ACL message. `received` [unix s]: the reference of a relative reply-by.

    `names` as in `to_acl`. `receiver`: name of the agent whose copy this is, if the message has
    several receivers. `profile`: whose protocols FIPA's tokens mean. User-defined parameters of
    others are dropped, and so are ours with a value that says nothing here. A communicate has no
    reply-to: `reply_names` says how it is followed. Raise MalformedError for values that a
    communicate cannot represent: words or labels that are too long, content that does not have its
    `encoding`, several receivers without `receiver`.
    """
    ours = {aid.name: name for name, aid in names.items()}
    user = {name.lower(): value for name, value in message.user.items()}
    jade_encoding = user.get(JADE_ENCODING.lower())
    try:
        communicate = Communicate(
            performative=_act_in(message, user, profile),
            content=(
                msgspec.UNSET
                if message.content is None
                else read(message.content, message.encoding, jade_encoding)
            ),
            language=_entered(WORD, message.language),
            ontology=_entered(WORD, message.ontology),
            protocol=_protocol_in(message, user, profile),
            reply_by=_reply_by(message, received, user),
            reply_with=_entered(LABEL, message.reply_with),
            in_reply_to=_entered(LABEL, message.in_reply_to),
            conversation=_entered(LABEL, message.conversation_id),
            sender=_name(message.sender, ours) if message.sender else "",
            receiver=_receiver([_name(aid, ours) for aid in message.receiver], receiver),
            id=own if is_label(own := user.get(ID.lower(), "")) else "",
            sent=_seconds(user, SENT, 0.0),
        )
        data = msgspec.msgpack.encode(communicate)
    except UnicodeEncodeError as error:
        raise MalformedError(
            "message", "contains half a surrogate pair, which UTF-8 cannot encode"
        ) from error
    return decode_strictly(data)


def reply_names(message: AclMessage, names: Mapping[str, Aid] = _NOBODY) -> dict[str, Aid]:
    """Return `names` for the answers to a message, so that `to_acl` addresses them to its reply-to
    (SC00061G).

    Without one they go to the sender, with the addresses it gives, unless `names` has it. Raise
    MalformedError if there are several: the answers of a conversation go to one agent.
    """
    if message.sender is None:
        return dict(names)
    if len(message.reply_to) > 1:
        raise MalformedError(
            "reply-to", f"has {len(message.reply_to)} agents, must name one (SC00061G)"
        )
    peer = _name(message.sender, {aid.name: name for name, aid in names.items()})
    if message.reply_to:
        return {**names, peer: message.reply_to[0]}
    return {peer: message.sender, **names}


def _user(communicate: Communicate, profile: Profile) -> dict[str, str]:
    """The user-defined parameters for values that the standard parameters do not represent."""
    act, protocol = communicate.performative, communicate.protocol
    sent, reply_by = float(communicate.sent), communicate.reply_by
    return {
        name: text
        for name, text, needed in (
            (ID, communicate.id, bool(communicate.id)),
            (SENT, repr(sent), repr(sent) != "0.0"),
            (
                REPLY_BY,
                repr(reply_by),
                reply_by is not None and repr(_at(reply_by).unix_ms / 1000) != repr(reply_by),
            ),
            (PROTOCOL, protocol, _name_of(_token_of(protocol), profile) != protocol),
            (ACT, str(act), _answers(_act_out(act), protocol, profile) != act),
        )
        if needed
    }


# --- acts and protocols ---------------------------------------------------------------------------


def _act_out(act: Performative) -> Performative:
    return Performative.INFORM if act in _MACRO_ACTS else act


def _answers(act: Performative, name: str, profile: Profile) -> Performative:
    """The received act; by the paper the answer to a query is inform-ref."""
    papers = profile is Profile.PAPER and act is Performative.INFORM and name == QUERY.name
    return Performative.INFORM_REF if papers else act


def _act_in(message: AclMessage, user: Mapping[str, str], profile: Profile) -> Performative:
    exact = next((act for act in Performative if act == user.get(ACT.lower(), "").lower()), None)
    if exact and _act_out(exact) is message.performative:
        return exact
    return _answers(message.performative, _protocol_in(message, user, profile), profile)


def _token_of(name: str) -> str:
    """FIPA's token of a protocol, or its name if there is none."""
    name = WORD.leave(name)
    try:
        protocol = named(name)
    except LocalProtocolError:
        return name
    return next(
        (known for known in protocol.aliases if known.startswith("fipa-")), _TOKENS.get(name, name)
    )


def _name_of(token: str, profile: Profile) -> str:
    """The name of a protocol of FIPA by its token; any other name is unchanged."""
    lower = token.lower()
    if profile is Profile.PAPER and lower in _PAPERS:
        return _PAPERS[lower]
    try:
        return named(lower).name if lower.startswith("fipa-") else WORD.enter(token)
    except LocalProtocolError:
        return WORD.enter(token)


def _protocol_in(message: AclMessage, user: Mapping[str, str], profile: Profile) -> str:
    written, exact = message.protocol or "", user.get(PROTOCOL.lower(), "")
    return exact if is_word(exact) and _token_of(exact) == written else _name_of(written, profile)


# --- times ----------------------------------------------------------------------------------------


def _at(seconds: float) -> At:
    """The last millisecond not after a time, limited to the years 1 to 9999."""
    ms = seconds * 1000
    if not MIN_MS < ms < MAX_MS:
        return At(MIN_MS if ms < 0 else MAX_MS)
    # Rounding first: 1.001 * 1000 is a little less than 1001.
    return At(round(ms) if round(ms) / 1000 == seconds else int(ms // 1))


def _reply_by(message: AclMessage, received: float, user: Mapping[str, str]) -> float | None:
    if message.reply_by is None:
        return None
    if isinstance(message.reply_by, After):
        return received + message.reply_by.ms / 1000
    rounded = message.reply_by.unix_ms / 1000
    exact = _seconds(user, REPLY_BY, rounded)
    return exact if _at(exact) == message.reply_by else rounded


def _seconds(user: Mapping[str, str], name: str, otherwise: float) -> float:
    """The unix seconds in a user-defined parameter, `otherwise` if it is absent or says something
    else.
    """
    try:
        seconds = float(user.get(name.lower(), "nan"))
    except ValueError:
        return otherwise
    return seconds if math.isfinite(seconds) else otherwise


# --- words, labels, names -------------------------------------------------------------------------


def _entered(escape: Escape, text: str | None) -> str:
    return escape.enter(text or "")


def _aid(name: str, names: Mapping[str, Aid]) -> Aid:
    return names.get(name) or Aid(WORD.leave(name))


def _name(aid: Aid, ours: Mapping[str, str]) -> str:
    return ours[aid.name] if aid.name in ours else _entered(WORD, aid.name)


def _receiver(receivers: list[str], wanted: str) -> str:
    if wanted and wanted not in receivers:
        raise MalformedError(
            "receiver", f"{wanted!r} is not one of {', '.join(receivers) or 'nobody'}"
        )
    if not wanted and len(receivers) > 1:
        raise MalformedError(
            "receiver", f"are {', '.join(receivers)}: pass receiver=, the agent whose copy this is"
        )
    return wanted or "".join(receivers)
