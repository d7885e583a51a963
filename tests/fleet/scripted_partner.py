"""An agent that only says what a test has it say, and keeps what it hears: a partner for one agent
under test.
"""

from typing import Any

import msgspec

from agent_runtime.core.agent import Agent, Behaviour
from agent_runtime.core.events import Local, Received
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import SEND


class Open(msgspec.Struct, frozen=True):
    """Open a conversation."""

    to: str
    protocol: str
    performative: Performative
    content: Any = None


class Say(msgspec.Struct, frozen=True):
    """Say something in the nth conversation that was opened or heard of; `kind` tells an answer to
    a cancel.
    """

    number: int
    performative: Performative
    content: Any = None
    kind: Kind | None = None


class Names(msgspec.Struct, frozen=True):
    """Conversations in order."""

    talks: tuple[str, ...] = ()


def partner(name, heard, *, confirms=True):
    """The agent `name`; `heard` gets (number of conversation, performative, content)."""

    def serve(memory, turn):
        match turn.event:
            case Local(content=Open(to=to, protocol=protocol, performative=act, content=content)):
                return Names((*memory.talks, turn.open(to, protocol, act, content)))
            case Local(content=Say(number=number, performative=act, content=content, kind=kind)):
                turn.say(memory.talks[number], act, content, kind=kind)
                _pay(turn, memory.talks[number])
            case Received(communicate=word, content=content, conversation=talk):
                memory = memory if talk in memory.talks else Names((*memory.talks, talk))
                heard.append((memory.talks.index(talk), str(word.performative), content))
                if confirms:
                    _pay(turn, talk)
        return memory

    behaviours = {"here": Behaviour(serve)}
    return Agent(name, "here", Names(), behaviours, local=Open | Say)


def _pay(turn, talk):
    """Say what the protocol wants said in the same step."""
    if turn.holds(talk) and turn.conversation(talk).owes:
        row = turn.conversation(talk).table.allowed(turn.conversation(talk).state, SEND)[0]
        turn.say(talk, row.performative, kind=row.kind if row.kind is Kind.CANCEL else None)


class Puppet:
    """A partner that does what a test posts to it, a function of its turn. It obeys the protocols
    (the core makes it). `answer(turn, received)` is called with each message, after it was noted in
    `heard`.
    """

    def __init__(self, name, answer=None):
        self.name, self.answer, self.heard = name, answer, []

    def agent(self):
        """One state that never ends."""
        return Agent(self.name, "on", Names(), {"on": Behaviour(self.act)})

    def act(self, memory, turn):
        if isinstance(turn.event, Received):
            self.heard.append(turn.event)
            if self.answer:
                self.answer(turn, turn.event)
        elif isinstance(turn.event, Local):
            turn.event.content(turn)
        return memory
