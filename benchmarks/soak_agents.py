"""Two agents that say numbered words to each other, as many and as long as in the paper; the
processes of soak.py.

    python benchmarks/soak_agents.py ta|ex <address> <run folder> <exchanges>

ta requests, ex agrees and answers, as on channel C5 of the design: durable streams, journal, step
log, TLS, the rights of the design. Each keeps in its journalled memory which number it took last,
and what was lost, doubled or misordered.
"""

import os
import sys
from pathlib import Path
from typing import Any

import msgspec
from msgspec.structs import replace

from agent_runtime.core.agent import Agent, Behaviour
from agent_runtime.core.events import Received, Started
from agent_runtime.core.turn import Turn
from agent_runtime.core.wiring import Delivery, Link, Wiring
from agent_runtime.io import shell
from agent_runtime.io.cli import endpoints
from agent_runtime.io.options import AGENTS_VARIABLE, Options
from fipa_codec.languages import Language, Languages
from fipa_codec.performatives import Performative
from fipa_codec.tables import Role

SYSTEM = "soak"
OPEN = 3
"""Requests under way at the same time: more than one, so that order and doubling can go wrong
(estimate).
"""
ENVELOPE = 103
"""Bytes of a communicate beside its text (measured: 98 to 108, by the digits of its numbers)."""


class Load(msgspec.Struct, frozen=True, tag=True):
    """The `number`th request, or its answer."""

    number: int
    text: str


class Memory(msgspec.Struct, frozen=True):
    """`said`: requests opened (ta); `taken`: the number that came last; the rest: what came
    otherwise than next.
    """

    said: int = 0
    taken: int = 0
    lost: int = 0
    doubled: int = 0
    unordered: int = 0


class Progress(msgspec.Struct, frozen=True):
    """To the file of an agent."""

    memory: Memory


LANGUAGES = Languages([Language("LOAD", Load)])


def size(number: int) -> int:
    """Return the bytes of the `number`th communicate: the paper's sizes (section 5.7).

    86 % have less than 0.5 kB; on C4 the least is 231 B, the mean 654 B, the most 98 kB; the
    largest of all has 852 kB.
    """
    if number % 20_000 == 10_000:
        return 852_000
    if number % 5_000 == 2_500:
        return 98_000
    return 2_200 if number % 7 == 0 else 231 + number * 37 % 269


def load(number: int) -> Load:
    """Return content of the right length."""
    return Load(number, "x" * (size(number) - ENVELOPE))


def taken(memory: Memory, number: int) -> Memory:
    """Return the memory after a number has come."""
    expected = memory.taken + 1
    return replace(
        memory,
        taken=max(number, memory.taken),
        lost=memory.lost + max(0, number - expected),
        doubled=memory.doubled + (number == memory.taken),
        unordered=memory.unordered + (number < memory.taken),
    )


def asker(total: int) -> Agent[Memory]:
    """Keep OPEN requests under way until all are answered."""

    def ask(memory: Memory, turn: Turn) -> Memory:
        match turn.event:
            case Received(content=Load(number=number)):
                memory = taken(memory, number)
            case Started():
                pass
            case _:
                return memory
        while memory.said < min(total, memory.taken + OPEN):
            memory = replace(memory, said=memory.said + 1)
            turn.open("ex", "request", Performative.REQUEST, load(memory.said))
        turn.tell(Progress(memory))
        return memory

    return Agent(name="ta", start="asking", memory=Memory(), behaviours={"asking": Behaviour(ask)})


def answerer() -> Agent[Memory]:
    """Agree and answer at once, with as many bytes."""

    def answer(memory: Memory, turn: Turn) -> Memory:
        match turn.event:
            case Received(content=Load(number=number)) as received:
                turn.say(received.conversation, Performative.AGREE)
                turn.say(received.conversation, Performative.INFORM, load(number))
                return taken(memory, number)
        return memory

    return Agent(
        name="ex", start="answering", memory=Memory(), behaviours={"answering": Behaviour(answer)}
    )


def wiring(agent: str, peer: str, role: Role) -> Wiring:
    """Return one side of C5's request."""
    link = Link(
        peer=peer,
        channel="C5",
        protocol="request",
        role=role,
        delivery=Delivery.DURABLE,
        silent="LOAD",
    )
    return Wiring(SYSTEM, agent, (link,), LANGUAGES)


class Told:
    """Writes the newest progress of ta for soak.py to look at; what counts is in the journals."""

    busy = False

    def __init__(self, file: Path) -> None:
        self._file = file

    def tell(self, content: Any) -> None:
        """Write it."""
        beside = self._file.with_name(f".{self._file.name}")
        beside.write_bytes(msgspec.json.encode(content.memory))
        beside.replace(self._file)

    def close(self) -> None:
        """Nothing to close."""


def main(name: str, address: str, run: Path, exchanges: int) -> int:
    """Serve as one of the two until told to stop."""
    agents = endpoints(os.environ[AGENTS_VARIABLE])
    options = Options(
        connect=address,
        run_dir=run,
        system=SYSTEM,
        log_level="warning",
        keys=run / "keys",
        agents=agents,
    )
    if name == "ex":
        return shell.run(answerer(), wiring("ex", "ta", Role.PARTICIPANT), options)
    progress = run / "ta.progress"
    return shell.run(
        asker(exchanges), wiring("ta", "ex", Role.INITIATOR), options, lambda post: Told(progress)
    )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2], Path(sys.argv[3]), int(sys.argv[4])))
