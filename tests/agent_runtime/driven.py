"""A core stepped by hand, and agents that do what a test says: no wires, no clock, each step in
view.
"""

from typing import Any

from msgspec import Raw, Struct
from msgspec.msgpack import encode as pack
from toy_agents import Double, Doubled, Want

from agent_runtime.core.agent import Agent, Behaviour
from agent_runtime.core.effects import Effects
from agent_runtime.core.events import Arrived, Next, Received
from agent_runtime.core.state import CoreState
from agent_runtime.core.step import Core
from agent_runtime.core.turn import Turn
from agent_runtime.core.wiring import Delivery
from fipa_codec.communicate import Communicate, decode, encode
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
        if content is not None and not isinstance(content, Raw):
            language = wiring.language(content)
            fields = {"content": Raw(language.encode(content)), "language": language.name} | fields
        elif content is not None:
            fields = {"content": content} | fields
        parts = {
            "sender": sender,
            "receiver": wiring.agent,
            "id": str(number),
            "reply_with": f"r{number}",
        } | fields
        return self.step(
            Arrived(Communicate(performative=act, protocol=protocol, conversation=talk, **parts))
        )

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

    behaviour = Behaviour(transition, takes=takes or (lambda memory, event: True))
    return Agent(name, "s", Seen(), {"s": behaviour}, local=local)


def quiet(said: Any, *, name: str = "server", local: Any = Want) -> Agent[Seen]:
    """An agent that does what `said(turn)` does and remembers nothing: no step is durable for its
    memory's sake.
    """

    def transition(memory: Seen, turn: Turn) -> Seen:
        said(turn)
        return memory

    return Agent(name, "s", Seen(), {"s": Behaviour(transition)}, local=local)


def request(
    number: int, *, conversation: str = "asker-1-1", content: Any = None, **fields: Any
) -> Arrived:
    """A request of the asker as it comes off the wire."""
    raw = Raw(pack(Double(3))) if content is None else content
    parts = {
        "performative": P.REQUEST,
        "content": raw,
        "language": "SUM",
        "reply_with": str(number),
        "sender": "asker",
    }
    parts |= fields
    return Arrived(
        Communicate(
            protocol="request",
            conversation=conversation,
            receiver="server",
            id=str(number),
            **parts,
        )
    )


def agree(turn: Turn) -> None:
    """Agree to a request."""
    if isinstance(turn.event, Received) and turn.event.communicate.performative is P.REQUEST:
        turn.say(turn.event.conversation, P.AGREE)


def stop(turn: Turn) -> None:
    """Agree to a request, stop at a cancel."""
    agree(turn)
    if isinstance(turn.event, Received) and turn.event.communicate.performative is P.CANCEL:
        turn.say(turn.event.conversation, P.INFORM, Doubled(0), kind=Kind.CANCEL)
