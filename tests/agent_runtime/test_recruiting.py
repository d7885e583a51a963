"""A broker between agents: brokering relays the answers, recruiting lets the targets give them."""

import pytest
import recruiting_agents as cast
from hypothesis import given, settings
from hypothesis import strategies as st

from agent_runtime.core.agent import Agent, Behaviour
from agent_runtime.core.events import Started
from agent_runtime.core.step import Core
from agent_runtime.core.turn import Turn
from agent_runtime.testing.memory_bus import Faults, MemoryBus
from fipa_codec.conversation import Conversation
from fipa_codec.errors import LocalProtocolError
from fipa_codec.tables import Role

NAMES = ("asker", "broker", *cast.SCALES)


def played(faults: Faults | None = None, seed: int = 0) -> MemoryBus:
    """Everybody on the wires until all was answered."""
    wires = MemoryBus(seed=seed, faults=faults)
    for agent in (cast.asker(), cast.broker(), *map(cast.scale, cast.SCALES)):
        wires.add(agent, cast.wiring(agent.name))
    wires.run(lambda: len(wires.memory("asker").ends) == 2 and len(wires.memory("asker").answered) == len(cast.SCALES))
    wires.faults = Faults()  # who has just died comes back
    wires.run_for(10.0)
    return wires


@given(
    st.builds(
        Faults,
        loss=st.sampled_from([0.0, 0.3]),
        duplication=st.sampled_from([0.0, 0.3]),
        delay=st.sampled_from([0.0, 0.3]),
        crash=st.sampled_from([0.0, 0.05]),
    ),
    st.integers(0, 2**32),
)
@settings(max_examples=40, deadline=None)
def test_every_answer_comes_once_whatever_the_wires_do(faults: Faults, seed: int) -> None:
    """By the broker's mouth first, from the scales themselves then, in whatever order; nobody is left waiting."""
    wires = played(faults, seed)
    asker = wires.memory("asker")
    assert asker.ends == ("brokering done", "recruiting done")
    assert sorted(asker.relayed) == sorted(asker.answered) == sorted(cast.WEIGHTS.items())
    for name in cast.SCALES:
        assert wires.memory(name).told == ("broker", "asker")
    for name in NAMES:
        state = wires.nodes[name].state
        assert state is not None
        assert not state.conversations


def test_each_conversation_inside_has_its_own_id() -> None:
    """Brokering: the targets never hear of the asker's id. Recruiting: the message keeps its own to the very target."""
    wires = played()
    spoken = {(c.protocol, c.conversation) for c in wires.traffic if "scale" in c.receiver or "scale" in c.sender}
    outer = {c.conversation for c in wires.traffic if c.protocol in ("brokering", "recruiting")}
    assert len(outer) == 2
    assert not outer & {conversation for _, conversation in spoken}
    direct = {c.conversation for c in wires.traffic if c.receiver == "asker" and c.sender in cast.SCALES}
    assert direct == {"asker-1-recruiting"}


@pytest.mark.parametrize(
    ("role", "peer", "word"),
    [(Role.PARTICIPANT, "left-scale", "durable as initiator"), (Role.INITIATOR, "nobody", "has no 'query'")],
)
def test_what_cannot_be_joined(role: Role, peer: str, word: str) -> None:
    """A conversation the design has no link for."""

    def go(memory: cast.Weighing, turn: Turn) -> cast.Weighing:
        turn.join(Conversation.open("query", role, id="x-1", me="asker", peer=peer))
        return memory

    agent = Agent(name="asker", start="one", memory=cast.Weighing(), behaviours={"one": Behaviour(go)})
    core = Core(agent, cast.wiring("asker"))
    with pytest.raises(LocalProtocolError, match=word):
        core.step(core.boot(None), Started(), 0.0)
