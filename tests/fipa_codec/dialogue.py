"""Both sides of a conversation, connected by queues, driven by the steps of a story."""

from typing import Any

import msgspec
from stories import Story

from fipa_codec.communicate import Communicate, decode, encode
from fipa_codec.conversation import Conversation
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import Role

ROLES = {"i": Role.INITIATOR, "p": Role.PARTICIPANT}


def parsed(word: str) -> tuple[Role, str, Performative | None, Kind]:
    """Return role, operator (: > < !), performative and kind of a step."""
    role, how, act = ROLES[word[0]], word[1], word[2:]
    name, _, kind = act.removesuffix("]").partition("[")
    return role, how, Performative(name) if name else None, Kind(kind)


class Dialogue:
    """Both sides of one conversation and two FIFO channels; `heard`: all received messages in
    order.
    """

    def __init__(self, protocol: str, *, reply_by: float | None = None) -> None:
        self.protocol, self.reply_by, self.count = protocol, reply_by, 0
        self.sides = {
            Role.INITIATOR: Conversation.open(
                protocol, Role.INITIATOR, id="co-1-1", me="co", peer="ta"
            )
        }
        self.wires: dict[Role, list[tuple[bytes, Kind]]] = {role: [] for role in Role}
        self.heard: list[tuple[Role, Communicate, Kind]] = []

    def play(self, story: Story) -> "Dialogue":
        """Perform all steps of a story."""
        for word in story.words:
            self.word(word)
        return self

    def word(self, word: str) -> None:
        """Perform one step of a story."""
        role, how, performative, kind = parsed(word)
        if how == "!":
            del self.sides[role]
        elif how == "<":
            self.take(role)
        else:
            assert performative is not None
            self.say(role, performative, kind)
            if how == ":":
                self.take(role.other)

    def say(
        self, role: Role, performative: Performative, kind: Kind = Kind.PLAIN, **options: Any
    ) -> Communicate:
        """Send a message of `role`; it stays in transit."""
        self.count += 1
        options = {
            "id": f"{role}-{self.count}",
            "now": float(self.count),
            "reply_by": self.reply_by,
        } | options
        side, message = self.sides[role].send(performative, kind=kind, **options)
        self.sides[role] = recorded(side)
        self.wires[role.other].append((encode(message), kind))
        return message

    def take(self, role: Role) -> Communicate:
        """Receive the first message in transit to `role`; the participant opens its side with
        it.
        """
        data, kind = self.wires[role].pop(0)
        message = decode(data)
        if role not in self.sides:
            self.sides[role] = Conversation.answering(message, "ta")
        self.sides[role] = recorded(self.sides[role].receive(message, kind))
        self.heard.append((role, message, kind))
        return message

    @property
    def states(self) -> tuple[str, str]:
        """States of initiator and participant."""
        return self.sides[Role.INITIATOR].state, self.sides[Role.PARTICIPANT].state


def recorded(side: Conversation) -> Conversation:
    """Return the conversation encoded and decoded, as by a journal; it must be equal."""
    again = msgspec.msgpack.decode(msgspec.msgpack.encode(side), type=Conversation)
    assert again == side
    return again
