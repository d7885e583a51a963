"""Toy agents for the runtime's tests, and the example of how an agent is written.

`asker` asks `server` to double numbers, one durable request at a time; `server` agrees and answers,
and counts in its memory how often it worked on each number: the effect that must happen exactly
once. Agents of a ring do both. Those of the soft kinds are in toy_observers, those that play FIPA's
protocols in fipa_agents.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import msgspec
from hypothesis import strategies as st
from msgspec.structs import replace

from agent_runtime.core.agent import Agent, Arc, Behaviour
from agent_runtime.core.events import Broken, Late, Local, Received, Started, Woken
from agent_runtime.core.turn import Turn
from agent_runtime.core.wiring import Delivery, Link, Wiring
from agent_runtime.testing.memory_bus import Faults, MemoryBus
from fipa_codec.languages import REASON, Language, Languages
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


Use = tuple[str, str, str, str, Delivery]
"""Initiator, participant, channel, protocol, delivery."""


def wired(
    agent: str, uses: Iterable[Use], languages: Languages = LANGUAGES, system: str = "toy"
) -> Wiring:
    """The wiring of an agent in a system with these uses and one language of its own."""
    silent, links = next(name for name in languages.names if name != REASON.name), []
    for initiator, participant, channel, protocol, delivery in uses:
        sides = {
            initiator: (participant, Role.INITIATOR),
            participant: (initiator, Role.PARTICIPANT),
        }
        if agent in sides:
            peer, role = sides[agent]
            links.append(Link(peer, channel, protocol, role, delivery, silent=silent))
    return Wiring(system, agent, tuple(links), languages)


def wirings(
    delivery: Delivery = Delivery.DURABLE, protocol: str = "request"
) -> tuple[Wiring, Wiring]:
    """The asker's and the server's side of one channel."""
    use = ("asker", "server", "T1", protocol, delivery)
    return wired("asker", [use]), wired("server", [use])


def single(
    name: str, memory: Any, transition: Any, *, takes: Any = None, state: str = "s", **more: Any
) -> Agent[Any]:
    """An agent of one state that never ends."""
    behaviour = Behaviour(transition, takes=takes) if takes else Behaviour(transition)
    return Agent(name, state, memory, {state: behaviour}, **more)


def fleet(
    *agents: tuple[Agent[Any], Wiring], seed: int = 0, faults: Faults | None = None
) -> MemoryBus:
    """These agents in memory."""
    wires = MemoryBus(seed=seed, faults=faults)
    for agent, wiring in agents:
        wires.add(agent, wiring)
    return wires


# --- the asker ------------------------------------------------------------------------------------


class AskerMemory(msgspec.Struct, frozen=True):
    """Questions still to be asked, those under way by conversation, and the answers."""

    wanted: tuple[int, ...] = ()
    asking: str = ""
    answers: tuple[tuple[int, int], ...] = ()
    late: int = 0


def collect(memory: AskerMemory, turn: Turn) -> AskerMemory:
    """Behaviour of `idle`: take the words of the person."""
    if isinstance(turn.event, Local) and isinstance(turn.event.content, Want):
        return replace(memory, wanted=(*memory.wanted, turn.event.content.number))
    return memory


def ask(memory: AskerMemory, turn: Turn) -> AskerMemory:
    """Behaviour of `asking`: request on entry, then take what comes until the answer is there."""
    match turn.event:
        case None:
            name = turn.open(
                "server", "request", Performative.REQUEST, Double(memory.wanted[0]), reply_by_s=5.0
            )
            return replace(memory, asking=name)
        case Received(content=Doubled(number=number)):
            return replace(
                memory,
                asking="",
                wanted=memory.wanted[1:],
                answers=(*memory.answers, (memory.wanted[0], number)),
            )
        case Broken():
            return replace(memory, asking="")  # it is asked again
        case Late():
            return replace(memory, late=memory.late + 1)
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
                # the person waits till we are idle
                takes=lambda memory, event: not isinstance(event, Local),
            ),
        },
        arcs=(Arc("idle", "asking", "work"), Arc("asking", "idle")),
        conditions={"work": lambda memory: bool(memory.wanted)},
        local=Want,
    )


# --- the server -----------------------------------------------------------------------------------


class ServerMemory(msgspec.Struct, frozen=True):
    """Number of times each number was worked on (the effect), and the conversations agreed to and
    not answered yet.
    """

    done: tuple[int, ...] = ()
    agreed: tuple[tuple[str, int], ...] = ()


def serve(memory: ServerMemory, turn: Turn) -> ServerMemory:
    """Agree at once; answer when the wake-up comes, 0.1 s later."""
    match turn.event:
        case Received(content=Double(number=number)) as received:
            turn.say(received.conversation, Performative.AGREE)
            turn.wake(received.conversation, turn.now + 0.1)
            return replace(memory, agreed=(*memory.agreed, (received.conversation, number)))
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
    return single("server", ServerMemory(), serve, state="serving")


def toys(*wanted: int, seed: int = 0, faults: Faults | None = None) -> MemoryBus:
    """Asker and server."""
    return fleet(*zip((asker(*wanted), server()), wirings(), strict=True), seed=seed, faults=faults)


def answers(wires: MemoryBus) -> tuple[tuple[int, int], ...]:
    """The asker's answers so far."""
    found: tuple[tuple[int, int], ...] = wires.memory("asker").answers
    return found


# --- a ring: each asks its successor to double numbers, all at once, and doubles those of its
# predecessor
# Two of them ask each other. What is asked is agreed to at once and answered when a wake-up comes.


RING = ("one", "two", "three")
WORK_S = 0.1
"""Time from the agree to the answer."""


class Order(msgspec.Struct, frozen=True, tag=True):
    """A person's word: ask for all these in one step, and for one of the `rest` with each
    answer.
    """

    numbers: tuple[int, ...]
    rest: tuple[int, ...] = ()


class Mutual(msgspec.Struct, frozen=True):
    """`rest`: to be asked; questions and debts by conversation; answers; numbers worked on; ends
    without an answer.
    """

    rest: tuple[int, ...] = ()
    asked: dict[str, int] = {}
    owed: dict[str, int] = {}
    answers: tuple[tuple[int, int], ...] = ()
    done: tuple[int, ...] = ()
    broken: tuple[str, ...] = ()


def live(memory: Mutual, turn: Turn, successor: str, protocol: str) -> Mutual:
    """Ask what a person wants, agree to what is asked, and answer when its time has come."""

    def asked(*numbers: int) -> dict[str, int]:
        return {turn.open(successor, protocol, Performative.REQUEST, Double(n)): n for n in numbers}

    match turn.event:
        case Local(content=Order(numbers=numbers, rest=rest)):
            return replace(memory, asked=memory.asked | asked(*numbers), rest=memory.rest + rest)
        case Received(content=Double(number=number), conversation=name):
            turn.say(name, Performative.AGREE)
            turn.wake(name, turn.now + WORK_S)
            return replace(memory, owed=memory.owed | {name: number})
        case Woken(name=name) if name in memory.owed and turn.holds(name):
            turn.say(name, Performative.INFORM, Doubled(2 * memory.owed[name]))
            done = (*memory.done, memory.owed[name])
            return replace(memory, owed=without(memory.owed, name), done=done)
        case Received(content=Doubled(number=number), conversation=name):
            answers = (*memory.answers, (memory.asked[name], number))
            now = without(memory.asked, name) | asked(*memory.rest[:1])
            return replace(memory, asked=now, rest=memory.rest[1:], answers=answers)
        case Broken(conversation=name):
            left = {"asked": without(memory.asked, name), "owed": without(memory.owed, name)}
            return replace(memory, **left, broken=(*memory.broken, name))
        case _:
            return memory


def without(table: dict[str, int], name: str) -> dict[str, int]:
    """The table less one entry."""
    return {key: value for key, value in table.items() if key != name}


def ring_agent(me: str, ring: Sequence[str]) -> Agent[Mutual]:
    """One state that takes everything."""
    successor, protocol = ring[(ring.index(me) + 1) % len(ring)], protocol_of(me)
    return single(
        me, Mutual(), lambda memory, turn: live(memory, turn, successor, protocol), local=Order
    )


def protocol_of(asker: str) -> str:
    """Two agents that ask each other need two protocols: a protocol between two has one
    initiator.
    """
    return "request" if asker == RING[0] else "fipa-request"


def ring_wiring(me: str, ring: Sequence[str]) -> Wiring:
    """Both sides of an agent."""
    pairs = zip(ring, (*ring[1:], ring[0]), strict=True)
    return wired(
        me, [(one, other, "T1", protocol_of(one), Delivery.DURABLE) for one, other in pairs]
    )


def faulty(loss: float, duplication: float, delay: float, crash: float) -> Any:
    """Strategy: each of these faults of the wires may be there or not."""
    shares = {"loss": loss, "duplication": duplication, "delay": delay, "crash": crash}
    kinds = {name: st.sampled_from([0.0, share]) for name, share in shares.items()}
    return st.builds(Faults, **kinds)
