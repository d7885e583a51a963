"""Agents in a ring: each asks its successor to double numbers, all at once, and doubles those of its predecessor.

Two of them ask each other. What is asked is agreed to at once and answered when a wake-up comes.
"""

from collections.abc import Sequence

import msgspec
from toy_agents import LANGUAGES, Double, Doubled

from agent_runtime.core.agent import Agent, Behaviour
from agent_runtime.core.events import Broken, Local, Received, Woken
from agent_runtime.core.turn import Turn
from agent_runtime.core.wiring import Delivery, Link, Wiring
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import Role

NAMES = ("one", "two", "three")
WORK_S = 0.1
"""Time from the agree to the answer."""


class Order(msgspec.Struct, frozen=True, tag=True):
    """A person's word: ask for all these in one step, and for one of the `rest` with each answer."""

    numbers: tuple[int, ...]
    rest: tuple[int, ...] = ()


class Mutual(msgspec.Struct, frozen=True):
    """`rest`: to be asked; questions and debts by conversation; answers; numbers worked on; ends without an answer."""

    rest: tuple[int, ...] = ()
    asked: dict[str, int] = {}
    owed: dict[str, int] = {}
    answers: tuple[tuple[int, int], ...] = ()
    done: tuple[int, ...] = ()
    broken: tuple[str, ...] = ()


def live(memory: Mutual, turn: Turn, successor: str, protocol: str) -> Mutual:
    """Ask what a person wants, agree to what is asked, and answer when its time has come."""
    match turn.event:
        case Local(content=Order(numbers=numbers, rest=rest)):
            opened = {turn.open(successor, protocol, P.REQUEST, Double(number)): number for number in numbers}
            return msgspec.structs.replace(memory, asked=memory.asked | opened, rest=memory.rest + rest)
        case Received(content=Double(number=number), conversation=name):
            turn.say(name, P.AGREE)
            turn.wake(name, turn.now + WORK_S)
            return msgspec.structs.replace(memory, owed=memory.owed | {name: number})
        case Woken(name=name) if name in memory.owed and turn.holds(name):
            turn.say(name, P.INFORM, Doubled(2 * memory.owed[name]))
            return msgspec.structs.replace(
                memory, owed=without(memory.owed, name), done=(*memory.done, memory.owed[name])
            )
        case Received(content=Doubled(number=number), conversation=name):
            answer, asked = (memory.asked[name], number), without(memory.asked, name)
            asked |= {turn.open(successor, protocol, P.REQUEST, Double(one)): one for one in memory.rest[:1]}
            return msgspec.structs.replace(memory, asked=asked, rest=memory.rest[1:], answers=(*memory.answers, answer))
        case Broken(conversation=name):
            return msgspec.structs.replace(
                memory,
                asked=without(memory.asked, name),
                owed=without(memory.owed, name),
                broken=(*memory.broken, name),
            )
        case _:
            return memory


def without(table: dict[str, int], name: str) -> dict[str, int]:
    """The table less one entry."""
    return {key: value for key, value in table.items() if key != name}


def agent(me: str, ring: Sequence[str]) -> Agent[Mutual]:
    """One state that takes everything."""
    successor, protocol = ring[(ring.index(me) + 1) % len(ring)], protocol_of(me)
    behaviour = Behaviour[Mutual](lambda memory, turn: live(memory, turn, successor, protocol))
    return Agent(name=me, start="living", memory=Mutual(), behaviours={"living": behaviour}, local=Order)


def protocol_of(asker: str) -> str:
    """Two agents that ask each other need two protocols: a protocol between two has one initiator."""
    return "request" if asker == NAMES[0] else "fipa-request"


def wiring(me: str, ring: Sequence[str]) -> Wiring:
    """Both sides of an agent."""
    at = ring.index(me)
    after, before = ring[(at + 1) % len(ring)], ring[at - 1]
    links = (
        Link(after, "T1", protocol_of(me), Role.INITIATOR, Delivery.DURABLE, silent="SUM"),
        Link(before, "T1", protocol_of(before), Role.PARTICIPANT, Delivery.DURABLE, silent="SUM"),
    )
    return Wiring("toy", me, links, LANGUAGES)
