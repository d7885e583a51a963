"""Toy agents for the soft kinds: `watcher` owes its observations to `knower`, who subscribes and
can be asked.

`asker` puts questions to the knower; they are volatile: asked again until answered.
"""

import msgspec
from msgspec.structs import replace
from toy_agents import single, wired

from agent_runtime.core.agent import Agent
from agent_runtime.core.events import Broken, Late, Local, PeerChanged, Received, Settled, Started
from agent_runtime.core.turn import Turn
from agent_runtime.core.wiring import Delivery, Wiring
from fipa_codec.languages import Language, Languages
from fipa_codec.performatives import Performative


class Topic(msgspec.Struct, frozen=True, tag=True):
    """Everything, please."""


class Seen(msgspec.Struct, frozen=True, tag=True):
    """An observation; also the word of the watcher's receptor. That of "all-told" goes last."""

    subject: str
    value: int


class WhatOf(msgspec.Struct, frozen=True, tag=True):
    """What is known of it? Also a person's word to the asker."""

    subject: str


class Known(msgspec.Struct, frozen=True, tag=True):
    """This, or -1."""

    value: int


class Finish(msgspec.Struct, frozen=True, tag=True):
    """To the watcher: done, once everything is settled."""


LANGUAGES = Languages([Language("OBS", Topic | Seen | WhatOf | Known)])


USES = (
    ("knower", "watcher", "T2", "subscribe", Delivery.LATEST),
    ("asker", "knower", "T3", "query", Delivery.VOLATILE),
)


def wiring(agent: str) -> Wiring:
    """The wiring of one of the three."""
    return wired(agent, USES, LANGUAGES)


class WatcherMemory(msgspec.Struct, frozen=True):
    """Number of the knower's subscriptions; whether the end is wanted, and reached."""

    finishing: bool = False
    finished: bool = False


def watch(memory: WatcherMemory, turn: Turn) -> WatcherMemory:
    """Agree to each subscription, owe each observation, finish behind the barrier."""
    match turn.event:
        case Received(content=Topic()) as received:
            turn.say(received.conversation, Performative.AGREE)
        case Local(content=Seen(subject=subject) as seen):
            turn.observe("knower", subject, seen, last=subject == "all-told")
        case Local(content=Finish()):
            memory = replace(memory, finishing=True)
        case Settled() | Started():
            pass
    if memory.finishing and not turn.due:
        memory = replace(memory, finished=True)
    return memory


def watcher() -> Agent[WatcherMemory]:
    """The observing agent."""
    return single("watcher", WatcherMemory(), watch, local=Seen | Finish)


class Subscription(msgspec.Struct, frozen=True):
    """Soft: the conversation, and the incarnation of the watcher it was opened for."""

    conversation: str = ""
    incarnation: int = 0


class KnowerMemory(msgspec.Struct, frozen=True):
    """The store; the subscription is soft."""

    store: tuple[tuple[str, int], ...] = ()
    history: tuple[Seen, ...] = ()
    soft: Subscription = Subscription()


def know(memory: KnowerMemory, turn: Turn) -> KnowerMemory:
    """Subscribe to each incarnation of the watcher, store what comes, answer questions."""
    match turn.event:
        case PeerChanged(agent="watcher", incarnation=int(incarnation)):
            if incarnation != memory.soft.incarnation:
                turn.drop(memory.soft.conversation)
                name = turn.open("watcher", "subscribe", Performative.SUBSCRIBE, Topic())
                return replace(memory, soft=Subscription(name, incarnation))
        case Received(content=Seen() as seen):
            store = dict(memory.store) | {seen.subject: seen.value}
            return replace(memory, store=tuple(store.items()), history=(*memory.history, seen))
        case Received(content=WhatOf(subject=subject)) as received:
            known = Known(dict(memory.store).get(subject, -1))
            turn.say(received.conversation, Performative.INFORM_REF, known)
    return memory


def knower() -> Agent[KnowerMemory]:
    """The knowing agent."""
    return single("knower", KnowerMemory(), know)


class AskerMemory(msgspec.Struct, frozen=True):
    """Answers to the questions."""

    answers: tuple[int, ...] = ()
    late: int = 0
    broken: int = 0


def question(memory: AskerMemory, turn: Turn) -> AskerMemory:
    """Ask what a person wants to know."""
    match turn.event:
        case Local(content=WhatOf() as what):
            turn.open("knower", "query", Performative.QUERY_REF, what, reply_by_s=5.0)
        case Received(content=Known(value=value)):
            return replace(memory, answers=(*memory.answers, value))
        case Late():
            return replace(memory, late=memory.late + 1)
        case Broken():
            return replace(memory, broken=memory.broken + 1)
    return memory


def asker() -> Agent[AskerMemory]:
    """The asking agent."""
    return single("asker", AskerMemory(), question, local=WhatOf)
