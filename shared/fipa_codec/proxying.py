"""Contents and conversations inside `brokering` and `recruiting` (FIPA SC00033H, SC00034H).

A proxy carries a descriptor of the target agents, an embedded message M and a condition (SC00037J).
M opens another protocol, in a conversation with another id:

    brokering    i --proxy(M)--> b --M', sender b, new id--> targets; they answer b, which relays
                 each answer to i as inform
    recruiting   i --proxy(M)--> b --propagate(M), id of M--> targets; they answer the sender of M

In recruiting the sender of M is the agent that gets the answers: the initiator, or a receiver that
it designates. Communicates have no `reply-to`; therefore the recruiter forwards M by propagate,
which SC00037J defines as: treat M as sent to you by its sender. All functions are pure.
"""

from typing import NamedTuple

import msgspec
from msgspec.structs import replace

from fipa_codec.acts import Content, Descriptor, Embedded, Proposition, content_of
from fipa_codec.communicate import Communicate
from fipa_codec.conversation import Conversation
from fipa_codec.errors import ContentError, LocalProtocolError, RemoteProtocolError
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.protocols import named
from fipa_codec.tables import Role

ANSWERED = "answered"
"""Predicate of a relayed answer: (answered target message)."""


class ProxyRequest(NamedTuple):
    """The content of a proxy or propagate."""

    targets: Descriptor
    message: Communicate
    condition: Proposition


def proxy_content(
    performative: Performative, targets: Descriptor, message: Communicate, condition: Proposition
) -> Content:
    """The content of a proxy or propagate. Raise LocalProtocolError if the message opens no known
    protocol.
    """
    content = content_of(performative, targets, Embedded(message), condition)
    try:
        proxy_request(content)
    except ContentError as error:
        raise LocalProtocolError(error.field, error.reason) from error
    return content


def proxy_request(content: Content) -> ProxyRequest:
    """The parts of the content of a received proxy or propagate.

    Raise ContentError if the embedded message opens no known protocol, or the content is of another
    act.
    """
    match content.expressions:
        case (Descriptor() as targets, Embedded(message), Proposition() as condition):
            _require_opening(message)
            return ProxyRequest(targets, message, condition)
    raise ContentError(
        "content", "is not the descriptor, message and proposition of proxy and propagate"
    )


def _require_opening(message: Communicate) -> None:
    try:
        openings = named(message.protocol).openings
    except LocalProtocolError as error:
        raise ContentError("content", f"the embedded message's protocol {error.reason}") from error
    if message.performative not in openings:
        wanted = ", ".join(sorted(openings))
        reason = (
            f"the embedded {message.performative} does not open {message.protocol}; {wanted} does"
        )
        raise ContentError("content", reason)


# --- brokering ------------------------------------------------------------------------------------


def relay_content(answer: Communicate, *, last: bool = False) -> Content:
    """The content of the inform that relays a target's answer; `last`: no other will follow."""
    return content_of(
        Performative.INFORM, Proposition(ANSWERED, (answer.sender, Embedded(answer))), last=last
    )


def relayed_answer(content: Content) -> Communicate | None:
    """The target's answer in an inform of a broker; None if there is none (the message was
    forwarded).
    """
    match content.expressions:
        case (Proposition(predicate=predicate, terms=(str(), Embedded(message))),) if (
            predicate == ANSWERED
        ):
            return message
    return None


# --- recruiting -----------------------------------------------------------------------------------


def embedded_message(
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
    """M, to be embedded in a proxy, from `receiver`, the agent that gets the answers of a
    recruiting.

    M is addressed to nobody, since the target is not known yet. Other arguments and errors as of
    `Conversation.send`.
    """
    talk = Conversation.open(protocol, Role.INITIATOR, id=conversation, me=receiver, peer="")
    _, message = talk.send(
        performative,
        id=id,
        now=now,
        content=content,
        language=language,
        ontology=ontology,
        reply_by=reply_by,
    )
    return message


def addressed(message: Communicate, target: str) -> Communicate:
    """M as the recruiter propagates it to a target."""
    return replace(message, receiver=target)


def target_conversation(message: Communicate, me: str, kind: Kind = Kind.PLAIN) -> Conversation:
    """The target's conversation with the sender of a propagated M, as if M had been sent directly.

    Raise RemoteProtocolError if M is not for `me`, lacks sender, protocol or id, or does not open
    its protocol.
    """
    if message.receiver != me:
        raise RemoteProtocolError(
            "receiver", f"of the embedded message is {message.receiver!r}, not {me!r}"
        )
    return Conversation.answering(message, me).receive(message, kind)


def receiver_conversation(message: Communicate, target: str) -> Conversation:
    """The conversation with `target` of the agent that gets the answers, as if it had sent M
    directly.
    """
    talk = Conversation.open(
        message.protocol, Role.INITIATOR, id=message.conversation, me=message.sender, peer=target
    )
    return talk.send(
        message.performative,
        id=message.reply_with,
        now=message.sent,
        content=None if message.content is msgspec.UNSET else message.content,
        language=message.language,
        ontology=message.ontology,
        reply_by=message.reply_by,
    )[0]
