"""Communicate <-> ACL message, without loss in both directions.

Other platforms understand the parameters of SC00061G; values that these cannot represent are in user-defined
parameters:
  X-id, X-sent        id and sent time (unix seconds); no parameter of FIPA has these
  X-reply-by          unix seconds, if reply-by with its milliseconds and four-digit years is not exact
  X-act, X-protocol   if the standard's name would be mapped back to another one
A user-defined parameter only refines its standard parameter; if the two disagree (another platform copied it into a
changed message), or it says nothing here (another platform means something else by the name), it is ignored.
inform-ref and inform-if are macro acts, which are not sent (SC00037J): they are mapped
to inform. FIPA's token of a protocol means that of the profile: by `Profile.FIPA` fipa-query is `fipa-query`, by
`Profile.PAPER` it is `query`, and an inform in it is inform-ref, with which the paper answers a query. What is not a
word or label of ours (a blank in a conversation-id, a nested ontology) is escaped (`escapes`).
"""

import math
from collections.abc import Mapping

import msgspec

from fipa_codec.acl_string import content as contents
from fipa_codec.acl_string.content import Form
from fipa_codec.acl_string.escapes import LABEL, WORD, Escape
from fipa_codec.acl_string.message import MAX_MS, MIN_MS, AclMessage, After, Aid, At
from fipa_codec.communicate import Communicate, decode_strictly, encode_strictly, is_label, is_word
from fipa_codec.errors import LocalProtocolError, MalformedError
from fipa_codec.performatives import Performative
from fipa_codec.protocols import QUERY, REQUEST, SUBSCRIBE, Profile, named

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
    """Return the ACL message of a communicate; `from_acl` of the same profile returns the same communicate.

    `names`: identifiers (with addresses) by names of agents. Raise LocalProtocolError if the communicate is not valid
    (`encode_strictly`).
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
    text, encoding = contents.write(communicate.content, form)
    jade = {contents.JADE_ENCODING: contents.JADE_BASE64} if encoding == contents.MSGPACK_BASE64 else {}
    return msgspec.structs.replace(message, content=text, encoding=encoding, user=message.user | jade)


def from_acl(
    message: AclMessage,
    received: float,
    *,
    names: Mapping[str, Aid] = _NOBODY,
    receiver: str = "",
    profile: Profile = Profile.FIPA,
) -> Communicate:
    """Return the communicate of an ACL message. `received` [unix s]: the reference of a relative reply-by.

    `names` as in `to_acl`. `receiver`: name of the agent whose copy this is, if the message has several receivers.
    `profile`: whose protocols FIPA's tokens mean. User-defined parameters of others are dropped, and so are ours with a
    value that says nothing here. A communicate has no reply-to: `reply_names` says how it is followed. Raise
    MalformedError for values that a communicate cannot represent: words or labels that are too long, content that does
    not have its `encoding`, several receivers without `receiver`.
    """
    ours = {aid.name: name for name, aid in names.items()}
    user = {name.lower(): value for name, value in message.user.items()}
    jade_encoding = user.get(contents.JADE_ENCODING.lower())
    try:
        communicate = Communicate(
            performative=_act_in(message, user, profile),
            content=msgspec.UNSET
            if message.content is None
            else contents.read(message.content, message.encoding, jade_encoding),
            language=_entered(WORD, message.language),
            ontology=_entered(WORD, message.ontology),
            protocol=_protocol_in(message, user, profile),
            reply_by=_reply_by(message, received, user),
            reply_with=_entered(LABEL, message.reply_with),
            in_reply_to=_entered(LABEL, message.in_reply_to),
            conversation=_entered(LABEL, message.conversation_id),
            sender=_name(message.sender, ours) if message.sender else "",
            receiver=_receiver([_name(aid, ours) for aid in message.receiver], receiver),
            id=_id(user),
            sent=_seconds(user, SENT, 0.0),
        )
        data = msgspec.msgpack.encode(communicate)
    except UnicodeEncodeError as error:
        raise MalformedError("message", "contains half a surrogate pair, which UTF-8 cannot encode") from error
    return decode_strictly(data)


def reply_names(message: AclMessage, names: Mapping[str, Aid] = _NOBODY) -> dict[str, Aid]:
    """Return `names` for the answers to a message, so that `to_acl` addresses them to its reply-to (SC00061G).

    Without one they go to the sender, with the addresses it gives, unless `names` has it. Raise MalformedError if there
    are several: the answers of a conversation go to one agent.
    """
    if message.sender is None:
        return dict(names)
    if len(message.reply_to) > 1:
        raise MalformedError("reply-to", f"has {len(message.reply_to)} agents, must name one (SC00061G)")
    peer = _name(message.sender, {aid.name: name for name, aid in names.items()})
    if message.reply_to:
        return {**names, peer: message.reply_to[0]}
    return {peer: message.sender, **names}


def _user(communicate: Communicate, profile: Profile) -> dict[str, str]:
    """Return the user-defined parameters for values that the standard parameters do not represent."""
    act, protocol = communicate.performative, communicate.protocol
    sent, reply_by = float(communicate.sent), communicate.reply_by
    return {
        name: text
        for name, text, needed in (
            (ID, communicate.id, bool(communicate.id)),
            (SENT, repr(sent), repr(sent) != "0.0"),
            (REPLY_BY, repr(reply_by), reply_by is not None and repr(_at(reply_by).unix_ms / 1000) != repr(reply_by)),
            (PROTOCOL, protocol, _name_of(_token_of(protocol), profile) != protocol),
            (ACT, str(act), _answers(_act_out(act), protocol, profile) != act),
        )
        if needed
    }


# --- acts and protocols -----------------------------------------------------------------------------------------------


def _act_out(act: Performative) -> Performative:
    return Performative.INFORM if act in _MACRO_ACTS else act


def _answers(act: Performative, name: str, profile: Profile) -> Performative:
    """Return the received act; by the paper the answer to a query is inform-ref."""
    papers = profile is Profile.PAPER and act is Performative.INFORM and name == QUERY.name
    return Performative.INFORM_REF if papers else act


def _act_in(message: AclMessage, user: Mapping[str, str], profile: Profile) -> Performative:
    exact = next((act for act in Performative if act == user.get(ACT.lower(), "").lower()), None)
    if exact and _act_out(exact) is message.performative:
        return exact
    return _answers(message.performative, _protocol_in(message, user, profile), profile)


def _token_of(name: str) -> str:
    """Return FIPA's token of a protocol, or its name if there is none."""
    name = WORD.leave(name)
    try:
        protocol = named(name)
    except LocalProtocolError:
        return name
    return next((known for known in protocol.aliases if known.startswith("fipa-")), _TOKENS.get(name, name))


def _name_of(token: str, profile: Profile) -> str:
    """Return the name of a protocol of FIPA by its token; any other name is unchanged."""
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
    rounded = message.reply_by.unix_ms / 1000
    exact = _seconds(user, REPLY_BY, rounded)
    return exact if _at(exact) == message.reply_by else rounded


def _seconds(user: Mapping[str, str], name: str, otherwise: float) -> float:
    """Return the unix seconds in a user-defined parameter, `otherwise` if it is absent or says something else."""
    try:
        seconds = float(user.get(name.lower(), "nan"))
    except ValueError:
        return otherwise
    return seconds if math.isfinite(seconds) else otherwise


# --- words, labels, names ---------------------------------------------------------------------------------------------


def _id(user: Mapping[str, str]) -> str:
    found = user.get(ID.lower(), "")
    return found if is_label(found) else ""


def _entered(escape: Escape, text: str | None) -> str:
    return escape.enter(text or "")


def _aid(name: str, names: Mapping[str, Aid]) -> Aid:
    return names.get(name) or Aid(WORD.leave(name))


def _name(aid: Aid, ours: Mapping[str, str]) -> str:
    return ours[aid.name] if aid.name in ours else _entered(WORD, aid.name)


def _receiver(receivers: list[str], wanted: str) -> str:
    if wanted and wanted not in receivers:
        raise MalformedError("receiver", f"{wanted!r} is not one of {', '.join(receivers) or 'nobody'}")
    if not wanted and len(receivers) > 1:
        raise MalformedError("receiver", f"are {', '.join(receivers)}: pass receiver=, the agent whose copy this is")
    return wanted or "".join(receivers)
