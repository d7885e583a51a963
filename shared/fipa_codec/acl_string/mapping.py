"""Communicate <-> ACL message, exact both ways.

The parameters of SC00061G say what another platform understands; what they cannot hold stands in user-defined ones:
  X-id, X-sent        id and sent time (unix seconds); no FIPA parameter has these
  X-reply-by          unix seconds, where reply-by's milliseconds or its four digits of years are too few
  X-act, X-protocol   where the standard's word would come back as another of ours
Such a parameter only refines: one that does not agree with its standard parameter (another platform copied it into a
changed message) does not count. Names of protocols map one to one (query <-> fipa-query, cfp <-> fipa-contract-net).
inform-ref and inform-if are macro acts, not to be performed (SC00037J), so they go out as inform, and an inform of
fipa-query comes in as the inform-ref with which the paper answers a query.
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

# Of protocols that are not registered, or have no alias that begins with fipa-: ours -> FIPA's (SC00026H to SC00036H).
_STANDARD = {
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
_OURS = {standard: ours for ours, standard in _STANDARD.items()}
_MACRO_ACTS = (Performative.INFORM_REF, Performative.INFORM_IF)
_NOBODY: Mapping[str, Aid] = {}


def to_acl(communicate: Communicate, *, names: Mapping[str, Aid] = _NOBODY, form: Form = Form.READABLE) -> AclMessage:
    """The ACL message that says the same. `names`: identifiers (with addresses) of agents, by our names of them.

    LocalProtocolError where the communicate could not be encoded either.
    """
    encode_strictly(communicate)
    message = AclMessage(
        performative=_act_out(communicate.performative),
        sender=_aid(communicate.sender, names) if communicate.sender else None,
        receiver=(_aid(communicate.receiver, names),) if communicate.receiver else (),
        language=communicate.language or None,
        ontology=communicate.ontology or None,
        protocol=_protocol_out(communicate.protocol) or None,
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
    """The communicate that says the same. `received`: unix seconds, from which a relative reply-by counts.

    `receiver`: whose copy this is (our name), where the message has several. User-defined parameters not of this module
    are dropped. MalformedError for what a communicate cannot hold: a name or label that is none of ours, several
    receivers, a reply-to other than the sender.
    """
    ours = {aid.name: name for name, aid in names.items()}
    sender = _name(message.sender, ours) if message.sender else ""
    if any(_name(aid, ours) != sender for aid in message.reply_to):
        raise MalformedError("reply-to", f"is not the sender {sender!r}; answers go to the sender only")
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
        raise MalformedError("message", "holds half a surrogate pair, which UTF-8 has not") from error
    return decode_strictly(data)


def _user(communicate: Communicate) -> dict[str, str]:
    """What the standard parameters would not bring back."""
    act, protocol = communicate.performative, communicate.protocol
    sent, reply_by = float(communicate.sent), communicate.reply_by
    return {
        name: text
        for name, text, needed in (
            (ID, communicate.id, bool(communicate.id)),
            (SENT, repr(sent), repr(sent) != "0.0"),
            (REPLY_BY, repr(reply_by), reply_by is not None and repr(_at(reply_by).unix_ms / 1000) != repr(reply_by)),
            (PROTOCOL, protocol, _ours(_protocol_out(protocol)) != protocol),
            (ACT, str(act), _answers(_act_out(act), protocol) != act),
        )
        if needed
    }


# --- acts and protocols -----------------------------------------------------------------------------------------------


def _act_out(act: Performative) -> Performative:
    return Performative.INFORM if act in _MACRO_ACTS else act


def _answers(act: Performative, protocol: str) -> Performative:
    """The act that comes in: the answer to a query is inform-ref."""
    return Performative.INFORM_REF if act is Performative.INFORM and _ours(protocol) == QUERY.name else act


def _act_in(message: AclMessage, user: Mapping[str, str]) -> Performative:
    exact = next((act for act in Performative if act == user.get(ACT.lower(), "").lower()), None)
    if exact and _act_out(exact) is message.performative:
        return exact
    return _answers(message.performative, message.protocol or "")


def _protocol_out(name: str) -> str:
    """FIPA's name of a protocol, where it has one."""
    try:
        protocol = named(name)
    except LocalProtocolError:
        return _STANDARD.get(name, name)
    return next((known for known in (name, *protocol.aliases) if known.startswith("fipa-")), _STANDARD.get(name, name))


def _ours(name: str) -> str:
    """Our name of a protocol of FIPA; any other stays as it is."""
    lower = name.lower()
    if not lower.startswith("fipa-"):
        return name
    try:
        return named(lower).name
    except LocalProtocolError:
        return _OURS.get(lower, name)


def _protocol_in(message: AclMessage, user: Mapping[str, str]) -> str:
    written, exact = message.protocol or "", user.get(PROTOCOL.lower(), "")
    return exact if exact and _protocol_out(exact) == written else _ours(written)


# --- times ------------------------------------------------------------------------------------------------------------


def _at(seconds: float) -> At:
    """The millisecond a time is in, no later than the time; what has no date is the first or last there is."""
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
        raise MalformedError("receiver", f"{wanted!r} is none of {', '.join(receivers) or 'nobody'}")
    if not wanted and len(receivers) > 1:
        raise MalformedError("receiver", f"are {', '.join(receivers)}: say whose copy this is, each takes its own")
    return wanted or "".join(receivers)
