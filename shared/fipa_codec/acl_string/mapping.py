"""Communicate <-> ACL message, without loss in both directions.

Other platforms understand the parameters of SC00061G; values that these cannot represent are in user-defined
parameters:
  X-id, X-sent        id and sent time (unix seconds); no parameter of FIPA has these
  X-reply-by          unix seconds, if reply-by with its milliseconds and four-digit years is not exact
  X-act, X-protocol   if the standard's name would be mapped back to another one
A user-defined parameter only refines its standard parameter; if the two disagree (another platform copied it into a
changed message), it is ignored. Names of protocols map one to one (query <-> fipa-query, cfp <-> fipa-contract-net).
inform-ref and inform-if are macro acts, which are not sent (SC00037J): they are mapped to inform, and an inform of
fipa-query is mapped to inform-ref, with which the paper answers a query.
"""

from collections.abc import Mapping

import msgspec

from fipa_codec.acl_string import content as contents
from fipa_codec.acl_string.content import Form
from fipa_codec.acl_string.message import MAX_MS, MIN_MS, AclMessage, After, Aid, At
from fipa_codec.communicate import Communicate, decode_strictly, encode_strictly
from fipa_codec.errors import LocalProtocolError, MalformedError
from fipa_codec.performatives import Performative
from fipa_codec.protocols import QUERY, named

ID, SENT, REPLY_BY, ACT, PROTOCOL = "X-id", "X-sent", "X-reply-by", "X-act", "X-protocol"

# Name -> FIPA's token (SC00026H to SC00036H), for protocols that are not registered or have no such alias.
_TOKENS = {
    "request": "fipa-request",
    "query": "fipa-query",
    "request-when": "fipa-request-when",
    "cfp": "fipa-contract-net",
    "icfp": "fipa-iterated-contract-net",
    "brokering": "fipa-brokering",
    "recruiting": "fipa-recruiting",
    "subscribe": "fipa-subscribe",
    "propose": "fipa-propose",
}
_NAMES = {token: name for name, token in _TOKENS.items()}
_MACRO_ACTS = (Performative.INFORM_REF, Performative.INFORM_IF)
_NOBODY: Mapping[str, Aid] = {}


def to_acl(communicate: Communicate, *, names: Mapping[str, Aid] = _NOBODY, form: Form = Form.READABLE) -> AclMessage:
    """Return the ACL message of a communicate. `names`: identifiers (with addresses) by names of agents.

    Raise LocalProtocolError if the communicate is not valid (`encode_strictly`).
    """
    encode_strictly(communicate)
    message = AclMessage(
        performative=_act_out(communicate.performative),
        sender=_aid(communicate.sender, names) if communicate.sender else None,
        receiver=(_aid(communicate.receiver, names),) if communicate.receiver else (),
        language=communicate.language or None,
        ontology=communicate.ontology or None,
        protocol=_token_of(communicate.protocol) or None,
        conversation_id=communicate.conversation or None,
        reply_with=communicate.reply_with or None,
        in_reply_to=communicate.in_reply_to or None,
        reply_by=None if communicate.reply_by is None else _at(communicate.reply_by),
        user=_user(communicate),
    )
    if communicate.content is msgspec.UNSET:
        return message
    text, encoding = contents.write(communicate.content, form)
    jade = {contents.JADE_ENCODING: contents.JADE_BASE64} if encoding == contents.MSGPACK_BASE64 else {}
    return msgspec.structs.replace(message, content=text, encoding=encoding, user=message.user | jade)


def from_acl(
    message: AclMessage, received: float, *, names: Mapping[str, Aid] = _NOBODY, receiver: str = ""
) -> Communicate:
    """Return the communicate of an ACL message. `received` [unix s]: the reference of a relative reply-by.

    `names` as in `to_acl`. `receiver`: name of the agent whose copy this is, if the message has several receivers.
    User-defined parameters of others are dropped. Raise MalformedError for values that a communicate cannot represent:
    invalid words or labels, several receivers without `receiver`, a reply-to other than the sender.
    """
    ours = {aid.name: name for name, aid in names.items()}
    sender = _name(message.sender, ours) if message.sender else ""
    if any(_name(aid, ours) != sender for aid in message.reply_to):
        raise MalformedError("reply-to", f"is not the sender {sender!r}; answers are sent to the sender only")
    user = {name.lower(): value for name, value in message.user.items()}
    jade_encoding = user.get(contents.JADE_ENCODING.lower())
    communicate = Communicate(
        performative=_act_in(message, user),
        content=msgspec.UNSET
        if message.content is None
        else contents.read(message.content, message.encoding, jade_encoding),
        language=message.language or "",
        ontology=message.ontology or "",
        protocol=_protocol_in(message, user),
        reply_by=_reply_by(message, received, user),
        reply_with=message.reply_with or "",
        in_reply_to=message.in_reply_to or "",
        conversation=message.conversation_id or "",
        sender=sender,
        receiver=_receiver([_name(aid, ours) for aid in message.receiver], receiver),
        id=user.get(ID.lower(), ""),
        sent=_seconds(SENT, user[SENT.lower()]) if SENT.lower() in user else 0.0,
    )
    try:
        data = msgspec.msgpack.encode(communicate)
    except UnicodeEncodeError as error:
        raise MalformedError("message", "contains half a surrogate pair, which UTF-8 cannot encode") from error
    return decode_strictly(data)


def _user(communicate: Communicate) -> dict[str, str]:
    """Return the user-defined parameters for values that the standard parameters do not represent."""
    act, protocol = communicate.performative, communicate.protocol
    sent, reply_by = float(communicate.sent), communicate.reply_by
    return {
        name: text
        for name, text, needed in (
            (ID, communicate.id, bool(communicate.id)),
            (SENT, repr(sent), repr(sent) != "0.0"),
            (REPLY_BY, repr(reply_by), reply_by is not None and repr(_at(reply_by).unix_ms / 1000) != repr(reply_by)),
            (PROTOCOL, protocol, _name_of(_token_of(protocol)) != protocol),
            (ACT, str(act), _answers(_act_out(act), protocol) != act),
        )
        if needed
    }


# --- acts and protocols -----------------------------------------------------------------------------------------------


def _act_out(act: Performative) -> Performative:
    return Performative.INFORM if act in _MACRO_ACTS else act


def _answers(act: Performative, protocol: str) -> Performative:
    """Return the received act; the answer to a query is inform-ref."""
    return Performative.INFORM_REF if act is Performative.INFORM and _name_of(protocol) == QUERY.name else act


def _act_in(message: AclMessage, user: Mapping[str, str]) -> Performative:
    exact = next((act for act in Performative if act == user.get(ACT.lower(), "").lower()), None)
    if exact and _act_out(exact) is message.performative:
        return exact
    return _answers(message.performative, message.protocol or "")


def _token_of(name: str) -> str:
    """Return FIPA's token of a protocol, or its name if there is none."""
    try:
        protocol = named(name)
    except LocalProtocolError:
        return _TOKENS.get(name, name)
    return next((known for known in (name, *protocol.aliases) if known.startswith("fipa-")), _TOKENS.get(name, name))


def _name_of(name: str) -> str:
    """Return the name of a protocol of FIPA by its token; any other name is unchanged."""
    lower = name.lower()
    if not lower.startswith("fipa-"):
        return name
    try:
        return named(lower).name
    except LocalProtocolError:
        return _NAMES.get(lower, name)


def _protocol_in(message: AclMessage, user: Mapping[str, str]) -> str:
    written, exact = message.protocol or "", user.get(PROTOCOL.lower(), "")
    return exact if exact and _token_of(exact) == written else _name_of(written)


# --- times ------------------------------------------------------------------------------------------------------------


def _at(seconds: float) -> At:
    """Return the last millisecond not after a time, limited to the years 1 to 9999."""
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
    try:
        exact = float(user.get(REPLY_BY.lower(), "nan"))
    except ValueError:
        exact = float("nan")
    return exact if exact == exact and _at(exact) == message.reply_by else message.reply_by.unix_ms / 1000


def _seconds(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise MalformedError(name, f"is {text!r}, must be unix seconds such as 1760000000.25") from error


# --- names ------------------------------------------------------------------------------------------------------------


def _aid(name: str, names: Mapping[str, Aid]) -> Aid:
    return names.get(name) or Aid(name)


def _name(aid: Aid, ours: Mapping[str, str]) -> str:
    return ours.get(aid.name, aid.name)


def _receiver(receivers: list[str], wanted: str) -> str:
    if wanted and wanted not in receivers:
        raise MalformedError("receiver", f"{wanted!r} is not one of {', '.join(receivers) or 'nobody'}")
    if not wanted and len(receivers) > 1:
        raise MalformedError("receiver", f"are {', '.join(receivers)}: pass receiver=, the agent whose copy this is")
    return wanted or "".join(receivers)
