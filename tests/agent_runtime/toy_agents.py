"""Toy agents for the runtime's tests, and the example of how an agent is written.

`asker` asks `server` to double numbers, one durable request at a time; `server` agrees and answers, and counts in its
memory how often it worked on each number: the effect that must happen exactly once.
"""

from typing import Any

import msgspec

from agent_runtime.core.agent import Agent, Arc, Behaviour
from agent_runtime.core.events import Broken, Late, Local, Received, Started
from agent_runtime.core.turn import Turn
from agent_runtime.core.wiring import Delivery, Link, Wiring
from fipa_codec.languages import Language, Languages
from fipa_codec.performatives import Performative
from fipa_codec.tables import Role


class Double(msgspec.Struct, frozen=True, tag=True):
    """Please double it."""

    number: int


class Doubled(msgspec.Struct, frozen=True, tag=True):
    """Here it is."""

    number: int


class Want(msgspec.Struct, frozen=True, tag=True):
    """A person's word to the asker."""

    number: int


LANGUAGES = Languages([Language("SUM", Double | Doubled)])


def wirings(delivery: Delivery = Delivery.DURABLE, protocol: str = "request") -> tuple[Wiring, Wiring]:
    """The asker's and the server's side of one channel."""

    def side(agent: str, peer: str, role: Role) -> Wiring:
        link = Link(peer=peer, channel="T1", protocol=protocol, role=role, delivery=delivery, silent="SUM")
        return Wiring("toy", agent, (link,), LANGUAGES)

    return side("asker", "server", Role.INITIATOR), side("server", "asker", Role.PARTICIPANT)


# --- the asker --------------------------------------------------------------------------------------------------------


class AskerMemory(msgspec.Struct, frozen=True):
    """Questions still to be asked, those under way by conversation, and the answers."""

    wanted: tuple[int, ...] = ()
    asking: str = ""
    answers: tuple[tuple[int, int], ...] = ()
    late: int = 0


def collect(memory: AskerMemory, turn: Turn) -> AskerMemory:
    """Behaviour of `idle`: take the words of the person."""
    if isinstance(turn.event, Local) and isinstance(turn.event.content, Want):
        return msgspec.structs.replace(memory, wanted=(*memory.wanted, turn.event.content.number))
    return memory


def ask(memory: AskerMemory, turn: Turn) -> AskerMemory:
    """Behaviour of `asking`: request on entry, then take what comes until the answer is there."""
    match turn.event:
        case None:
            name = turn.open("server", "request", Performative.REQUEST, Double(memory.wanted[0]), reply_by_s=5.0)
            return msgspec.structs.replace(memory, asking=name)
        case Received(content=Doubled(number=number)):
            return msgspec.structs.replace(
                memory, asking="", wanted=memory.wanted[1:], answers=(*memory.answers, (memory.wanted[0], number))
            )
        case Broken():
            return msgspec.structs.replace(memory, asking="")  # it is asked again
        case Late():
            return msgspec.structs.replace(memory, late=memory.late + 1)
        case _:
            return memory


def asker(*wanted: int) -> Agent[AskerMemory]:
    """idle -> asking -> idle."""
    return Agent(
        name="asker",
        start="idle",
        memory=AskerMemory(wanted),
        behaviours={
            "idle": Behaviour(collect, terminal=lambda memory: bool(memory.wanted)),
            "asking": Behaviour(
                ask,
                terminal=lambda memory: not memory.asking,
                takes=lambda memory, event: not isinstance(event, Local),  # the person waits till we are idle
            ),
        },
        arcs=(Arc("idle", "asking", "work"), Arc("asking", "idle")),
        conditions={"work": lambda memory: bool(memory.wanted)},
        local=Want,
    )


# --- the server -------------------------------------------------------------------------------------------------------


class ServerMemory(msgspec.Struct, frozen=True):
    """Number of times each number was worked on (the effect), and the conversations agreed to and not answered yet."""

    done: tuple[int, ...] = ()
    agreed: tuple[tuple[str, int], ...] = ()


def serve(memory: ServerMemory, turn: Turn) -> ServerMemory:
    """Agree at once; answer when the wake-up comes, 0.1 s later."""
    match turn.event:
        case Received(content=Double(number=number)) as received:
            turn.say(received.conversation, Performative.AGREE)
            turn.wake(received.conversation, turn.now + 0.1)
            return msgspec.structs.replace(memory, agreed=(*memory.agreed, (received.conversation, number)))
        case Started(first=False):
            return memory  # wake-ups survive
        case _:
            return answer_due(memory, turn)


def answer_due(memory: ServerMemory, turn: Turn) -> ServerMemory:
    """Answer the conversation whose wake-up this is."""
    name = getattr(turn.event, "name", None)
    for conversation, number in memory.agreed:
        if conversation == name:
            if turn.holds(conversation):  # else the asker has not understood what was said twice
                turn.say(conversation, Performative.INFORM, Doubled(2 * number))
            rest = tuple(pair for pair in memory.agreed if pair[0] != name)
            return ServerMemory(done=(*memory.done, number), agreed=rest)
    return memory


def server() -> Agent[ServerMemory]:
    """One state that never ends."""
    return Agent(name="server", start="serving", memory=ServerMemory(), behaviours={"serving": Behaviour(serve)})


def nobody(*_: Any) -> bool:
    """Takes nothing."""
    return False
