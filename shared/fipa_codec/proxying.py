"""How a brokered message travels: the conversations inside `brokering` and `recruiting` (FIPA SC00033H, SC00034H).

A proxy carries a descriptor of the agents wanted (targets), an embedded message M and a condition (SC00037J). M is the
opening of a protocol of its own, and has a conversation-id of its own wherever it goes:

    brokering    i --proxy(M)--> b --M', sender b, new id--> targets; they answer b, b relays each answer to i as inform
    recruiting   i --proxy(M)--> b --propagate(M), id of M--> targets; they answer the sender of M

The sender of M in recruiting is whoever wants the answers: the initiator, or the receiver it designated. A message
cannot say `reply-to` here, so the recruiter passes M on by propagate, which SC00037J defines as: take M as sent to you
by its own sender. All functions are pure.
"""

from typing import NamedTuple

import msgspec
from msgspec.structs import replace

from fipa_codec.acts import Content, speak
from fipa_codec.communicate import Communicate
from fipa_codec.conversation import Conversation
from fipa_codec.errors import ContentError, LocalProtocolError, RemoteProtocolError
from fipa_codec.expressions import Descriptor, Embedded, Proposition
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.protocols import named
from fipa_codec.tables import Role

ANSWERED = "answered"
"""Predicate of what a broker relays: (answered target message)."""


class Errand(NamedTuple):
    """What a proxy or propagate asks for."""

    targets: Descriptor
    message: Communicate
    condition: Proposition


def proxied(performative: Performative, targets: Descriptor, message: Communicate, condition: Proposition) -> Content:
    """Content of a proxy or propagate. LocalProtocolError where the message opens no protocol."""
    content = speak(performative, targets, Embedded(message), condition)
    try:
        errand(content)
    except ContentError as error:
        raise LocalProtocolError(error.field, error.reason) from error
    return content


def errand(content: Content) -> Errand:
    """What the content of a proxy or propagate asks for; it fits the act already (`check_content`).

    ContentError where the embedded message opens no protocol that is known here.
    """
    match content.expressions:
        case (Descriptor() as targets, Embedded(message), Proposition() as condition):
            _require_opening(message)
            return Errand(targets, message, condition)
    raise ContentError("content", "is no descriptor, embedded message and proposition, as proxy and propagate carry")


def _require_opening(message: Communicate) -> None:
    try:
        openings = named(message.protocol).openings
    except LocalProtocolError as error:
        raise ContentError("content", f"the embedded message's protocol {error.reason}") from error
    if message.performative not in openings:
        wanted = ", ".join(sorted(openings))
        reason = f"the embedded {message.performative} opens no {message.protocol}; {wanted} does"
        raise ContentError("content", reason)


# --- brokering --------------------------------------------------------------------------------------------------------


def ask_target(
    message: Communicate, *, broker: str, target: str, conversation: str, id: str, now: float
) -> tuple[Conversation, Communicate]:
    """The broker's own conversation with a target, under an id of its own, and M in the broker's name."""
    talk = Conversation.open(message.protocol, Role.INITIATOR, id=conversation, me=broker, peer=target)
    return _said(talk, message, id=id, now=now)


def relayed(answer: Communicate, *, last: bool = False) -> Content:
    """Content of the inform by which a broker relays a target's answer; `last`: no other will follow."""
    return speak(Performative.INFORM, Proposition(ANSWERED, (answer.sender, Embedded(answer))), last=last)


def relayed_answer(content: Content) -> Communicate | None:
    """The target's answer in what a broker says; None in any other inform (that the message was passed on)."""
    match content.expressions:
        case (Proposition(predicate=predicate, terms=(str(), Embedded(message))),) if predicate == ANSWERED:
            return message
    return None


# --- recruiting -------------------------------------------------------------------------------------------------------


def wanted(
    protocol: str,
    performative: Performative,
    *,
    receiver: str,
    conversation: str,
    id: str,
    now: float,
    content: msgspec.Raw | None = None,
    language: str = "",
    ontology: str = "",
    reply_by: float | None = None,
) -> Communicate:
    """M, to be embedded in a proxy: `receiver` is who gets the answers of a recruiting, the target is not known yet.

    The rest is as for `Conversation.send`, with its errors.
    """
    talk = Conversation.open(protocol, Role.INITIATOR, id=conversation, me=receiver, peer="")
    said = talk.send(
        performative, id=id, now=now, content=content, language=language, ontology=ontology, reply_by=reply_by
    )
    return said[1]


def handed_over(message: Communicate, target: str) -> Communicate:
    """M as the recruiter propagates it to a target."""
    return replace(message, receiver=target)


def taken_up(message: Communicate, me: str, kind: Kind = Kind.PLAIN) -> Conversation:
    """The target's side of a propagated M: a conversation with the sender of M, as if it had come from there.

    RemoteProtocolError where M is not for `me`, lacks sender, protocol or id, or opens nothing.
    """
    if message.receiver != me:
        raise RemoteProtocolError("receiver", f"of the embedded message is {message.receiver!r}, not {me!r}")
    return Conversation.answering(message, me).receive(message, kind)


def awaited(message: Communicate, target: str) -> Conversation:
    """The receiver's side, as if it had sent M to `target` itself: the same for the initiator and a designated one."""
    talk = Conversation.open(message.protocol, Role.INITIATOR, id=message.conversation, me=message.sender, peer=target)
    return _said(talk, message, id=message.reply_with, now=message.sent)[0]


def _said(talk: Conversation, message: Communicate, *, id: str, now: float) -> tuple[Conversation, Communicate]:
    return talk.send(
        message.performative,
        id=id,
        now=now,
        content=None if message.content is msgspec.UNSET else message.content,
        language=message.language,
        ontology=message.ontology,
        reply_by=message.reply_by,
    )
