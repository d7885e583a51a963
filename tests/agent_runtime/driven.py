"""A core stepped by hand, and agents that do what a test says: no wires, no clock, each step in
view.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
import toy_agents
import toy_observers
from msgspec import Raw, Struct
from msgspec.msgpack import encode as pack
from toy_agents import Double, Doubled, Want, single, wirings

from agent_runtime.core.agent import Agent
from agent_runtime.core.errors import BehaviourError
from agent_runtime.core.events import AnyEvent, Arrived, Effects, Local, Next, Received, Tick
from agent_runtime.core.state import CoreState
from agent_runtime.core.step import Core
from agent_runtime.core.turn import Turn
from agent_runtime.core.wiring import Delivery
from agent_runtime.io import steplog
from fipa_codec.communicate import Communicate, decode, encode
from fipa_codec.errors import LocalProtocolError
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P


class Seen(Struct, frozen=True):
    """Every event the agent saw, by class name."""

    seen: tuple[str, ...] = ()


class Driven:
    """A core with its state, stepped by hand; `do` is the transition's body."""

    def __init__(self, agent: Agent[Any], wiring: Any) -> None:
        self.core = Core(agent, wiring)
        self.state: CoreState = self.core.boot(None)
        self.now = 100.0
        self.out: list[Effects] = []
        self.count = 0

    def step(self, event: Any) -> Effects:
        """Step, and again while more can be taken; the first step's effects."""
        self.out = []
        following = event
        while following is not None:
            before = pack(self.core.record(self.state))
            after, effects = self.core.step(self.state, following, self.now)
            assert pack(self.core.record(self.state)) == before, (
                "a step must not change the state it is given"
            )
            self.state, following = after, Next() if effects.more else None
            self.out.append(effects)
        return self.out[0]

    @property
    def tells(self) -> list[Any]:
        """Words told to the own side in the last step and those that followed it."""
        return [word for effects in self.out for word in effects.tells]

    def hears(
        self, sender: str, protocol: str, act: P, content: Any = None, *, talk: str, **fields: Any
    ) -> Effects:
        """Step with a communicate of a peer, the next of its stream where the link is durable."""
        wiring = self.core.wiring
        durable = wiring.required(sender, protocol).delivery is Delivery.DURABLE
        self.count += 1
        number = self.state.taken.get(sender, 0) + 1 if durable else self.count
        fields = {"id": str(number), "reply_with": f"r{number}", "conversation": talk} | fields
        if content is not None and not isinstance(content, Raw):
            language = wiring.language(content)
            content, fields = language.encode(content), {"language": language.name} | fields
        way = f"{sender}>{wiring.agent}"
        return self.step(Arrived(message(act, way, protocol, content, **fields)))

    def later(self, now: float) -> Effects:
        """A tick at this time."""
        self.now = now
        return self.step(Tick())

    def state_wake(self) -> float:
        """Return the time at which the last step wanted to be woken."""
        assert self.out[-1].wake_at is not None
        return self.out[-1].wake_at

    def sends(self) -> list[Communicate]:
        """All communicates of the last step and those that followed it, through the codec."""
        return [decode(encode(one)) for effects in self.out for one in effects.sends]


def recording(
    *, said: Any = None, takes: Any = None, name: str = "server", local: Any = Want
) -> Agent[Seen]:
    """An agent that notes what it sees; `said(turn)` may speak."""

    def transition(memory: Seen, turn: Turn) -> Seen:
        if said is not None:
            said(turn)
        return Seen((*memory.seen, type(turn.event).__name__))

    return single(name, Seen(), transition, takes=takes, local=local)


def quiet(said: Any, *, name: str = "server", local: Any = Want) -> Agent[Seen]:
    """An agent that does what `said(turn)` does and remembers nothing: no step is durable for its
    memory's sake.
    """

    def transition(memory: Seen, turn: Turn) -> Seen:
        said(turn)
        return memory

    return single(name, Seen(), transition, local=local)


KNOWN = (toy_agents.LANGUAGES.named("SUM"), toy_observers.LANGUAGES.named("OBS"))


def message(act: P, way: str, protocol: str, content: Any = None, **fields: Any) -> Communicate:
    """A message of `way`, sender>receiver, with content of the toys' languages."""
    sender, _, receiver = way.partition(">")
    if content is not None and not isinstance(content, Raw):
        language = next(one for one in KNOWN if type(content) in one.classes)
        fields = {"content": language.encode(content), "language": language.name} | fields
    elif content is not None:
        fields = {"content": content} | fields
    fields = {"id": "1", "sender": sender, "receiver": receiver} | fields
    return Communicate(performative=act, protocol=protocol, **fields)


def request(
    number: int, *, conversation: str = "asker-1-1", content: Any = None, **fields: Any
) -> Arrived:
    """A request of the asker as it comes off the wire."""
    fields = {"id": str(number), "reply_with": str(number), "language": "SUM"} | fields
    act = fields.pop("performative", P.REQUEST)
    raw = Raw(pack(Double(3))) if content is None else content
    said = message(act, "asker>server", "request", raw, conversation=conversation, **fields)
    return Arrived(said)


def ask(turn: Turn) -> None:
    """Ask what a person wants."""
    if isinstance(turn.event, Local):
        turn.open("server", "request", P.REQUEST, Double(1), reply_by_s=5.0)


def refused(words: str, agent: Agent[Any], wiring: Any, event: Any) -> None:
    """Check that a step with this event raises an error of ours with these words."""
    with pytest.raises((BehaviourError, LocalProtocolError), match=words):
        Driven(agent, wiring).step(event)


def agree(turn: Turn) -> None:
    """Agree to a request."""
    if isinstance(turn.event, Received) and turn.event.communicate.performative is P.REQUEST:
        turn.say(turn.event.conversation, P.AGREE)


def stop(turn: Turn) -> None:
    """Agree to a request, stop at a cancel."""
    agree(turn)
    if isinstance(turn.event, Received) and turn.event.communicate.performative is P.CANCEL:
        turn.say(turn.event.conversation, P.INFORM, Doubled(0), kind=Kind.CANCEL)


def logged(path: Path, agent: Agent[Any], lives: Iterable[Iterable[AnyEvent]]) -> list[bytes]:
    """Write the log of an agent that lived so; what it said, as on the wire."""
    core, log, record, said = Core(agent, wirings()[1]), steplog.StepLog(path), b"", []
    for number, events in enumerate(lives, 1):
        state = core.boot(record or None)
        log.boot(number, record, 1.0)
        record = core.record(state)
        for event in events:
            state, effects = core.step(state, event, 2.0)
            log.write([steplog.noted(number, state.soft.step, 2.0, event, effects)])
            record, said = effects.record or record, said + [encode(one) for one in effects.sends]
    log.close()
    return said


class World:
    """In the place of a shell's wire and device: what is none of a test's business."""

    at_router = False

    def knows(self, journals: Any) -> None:
        """Names of journals."""

    def publish(self, kind: str, data: bytes) -> None:
        """Heartbeats."""

    def ping(self, peer: str, channel: bytes, pong: bool = False) -> None:
        """Pings."""

    def close(self) -> None:
        """Nothing to close."""
