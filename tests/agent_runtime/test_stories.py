"""Every protocol of FIPA is carried by the runtime, between two agents, in a crowd and by a broker,
under faults.
"""

from collections.abc import Iterable

import fipa_agents as fipa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from toy_agents import LANGUAGES, asker, fleet

from agent_runtime.core.agent import Agent, Behaviour
from agent_runtime.core.events import Started
from agent_runtime.core.step import Core
from agent_runtime.core.turn import Turn
from agent_runtime.core.wiring import Delivery, Link, Wiring
from agent_runtime.testing.memory_bus import Faults, MemoryBus
from fipa_codec.communicate import Communicate
from fipa_codec.conversation import Conversation
from fipa_codec.errors import LocalProtocolError
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import Role


def stage(
    faults: Faults | None = None,
    seed: int = 0,
    query: Delivery = Delivery.DURABLE,
    names: Iterable[str] = ("alice", "bob"),
) -> MemoryBus:
    """These agents in memory."""
    return fleet(
        *((fipa.made(name), fipa.wiring(name, query=query)) for name in names),
        seed=seed,
        faults=faults,
    )


def expect_all_ended(wires: MemoryBus) -> None:
    """All stories came to their ends on both sides."""
    count = len(fipa.SCRIPT)
    wires.run(
        lambda: any(
            wires.memory(name).wrong or len(wires.memory(name).ends) == count
            for name in ("alice", "bob")
        ),
        limit_s=1e6,
    )
    wires.faults = Faults()  # who has just died comes back
    wires.run_for(10.0)
    for name, role in (("alice", Role.INITIATOR), ("bob", Role.PARTICIPANT)):
        assert not wires.memory(name).wrong
        assert wires.memory(name).ends == fipa.wanted(role)
        state = wires.nodes[name].state
        assert state is not None
        assert not state.conversations


@pytest.mark.parametrize("query", [Delivery.DURABLE, Delivery.VOLATILE])
def test_all_stories_of_all_protocols(query: Delivery) -> None:
    """Twelve protocols, and each with its cancels."""
    assert {name for name, _ in fipa.SCRIPT} == {protocol.name for protocol in fipa.PROTOCOLS}
    expect_all_ended(stage(query=query))


FAULTS = st.builds(
    Faults,
    loss=st.sampled_from([0.0, 0.2]),
    duplication=st.sampled_from([0.0, 0.3]),
    delay=st.sampled_from([0.0, 0.3]),
    crash=st.sampled_from([0.0, 0.02]),
)


@given(FAULTS, st.integers(0, 2**32))
@settings(max_examples=8, deadline=None)
def test_all_stories_under_faults(faults: Faults, seed: int) -> None:
    """Losses, copies, delays and kills change no story."""
    expect_all_ended(stage(faults, seed))


@given(st.integers(0, 2**32), st.sampled_from([0.0, 0.3]), st.sampled_from([0.0, 0.3]))
@settings(max_examples=30, deadline=None)
def test_iterated_contract_net_with_a_crowd(seed: int, loss: float, duplication: float) -> None:
    """One conversation-id, four state machines: who is best wins, who is late is rejected, whoever
    says it first.
    """
    wires = stage(Faults(loss=loss, duplication=duplication), seed, names=("caller", *fipa.CROWD))
    wires.run(lambda: bool(wires.memory("caller").outcomes))
    wires.run_for(10.0)
    outcomes, ends = (
        wires.memory("caller").outcomes,
        {name: wires.memory(name).state for name in fipa.CROWD},
    )
    if not loss:
        assert (outcomes, ends) == (fipa.OUTCOMES, fipa.ENDS)
        # neither had ended when its time was over
        assert set(wires.memory("caller").late) == {"eager", "slow"}
    assert len({c.conversation for c in wires.traffic}) == 1
    assert outcomes["slow"] == "refused"
    assert not any(node.state is None or node.state.conversations for node in wires.nodes.values())


@pytest.mark.parametrize("steps", range(1, 12))
def test_caller_that_dies_goes_on_with_its_crowd(steps: int) -> None:
    """The multicast is memory, the conversations are in the journal: a restored caller comes to the
    same award.
    """
    wires = stage(names=("caller", *fipa.CROWD))
    wires.crash("caller", in_steps=steps, restart_s=0.05)
    wires.run(lambda: bool(wires.memory("caller").outcomes))
    state = wires.nodes["caller"].state
    assert state is not None
    assert state.incarnation == 2
    assert wires.memory("caller").outcomes == fipa.OUTCOMES


def test_garbage_of_one_participant_ends_its_conversation_only() -> None:
    """not-understood and Broken concern one of the crowd, named as peer; the next best is
    awarded.
    """
    wires = stage(names=("caller", *fipa.CROWD))
    wires.run(lambda: any(c.receiver == "eager" for c in wires.traffic))
    call = next(c for c in wires.traffic if c.receiver == "eager")
    wires.deliver(
        Communicate(
            performative=P.AGREE,
            protocol="icfp",
            conversation=call.conversation,
            sender="eager",
            receiver="caller",
            id="1",
        )
    )
    wires.run(lambda: bool(wires.memory("caller").outcomes))
    changed = {"eager": "not-understood", "modest": "done"}
    assert wires.memory("caller").outcomes == fipa.OUTCOMES | changed
    wires.run_for(10.0)
    assert {name: wires.memory(name).state for name in fipa.CROWD} == fipa.ENDS | changed


def test_content_that_the_act_does_not_carry_is_the_speakers_fault() -> None:
    """The step fails before anything leaves."""

    def go(memory: fipa.Played, turn: Turn) -> fipa.Played:
        turn.open("bob", "request", P.REQUEST, fipa.content(P.INFORM, Kind.PLAIN))
        return memory

    agent = Agent(
        name="alice", start="one", memory=fipa.Played(), behaviours={"one": Behaviour(go)}
    )
    core = Core(agent, fipa.wiring("alice"))
    with pytest.raises(
        LocalProtocolError, match="is a proposition; request carries an action expression"
    ):
        core.step(core.boot(None), Started(), 0.0)


@pytest.mark.parametrize(
    ("to", "protocol", "word"),
    [((), "request", "a multicast"), (("server", "server"), "request",
                                      "one conversation with each"),
     (("server",), "query", "not durable")],
)  # fmt: skip
def test_what_cannot_be_opened_with_several(to: tuple[str, ...], protocol: str, word: str) -> None:
    """Nobody, one twice, or over a link that promises nothing."""

    def go(memory: object, turn: Turn) -> object:
        turn.open_all(to, protocol, P.REQUEST)
        return memory

    links = (
        Link("server", "T1", "request", Role.INITIATOR, Delivery.DURABLE, silent="SUM"),
        Link("server", "T1", "query", Role.INITIATOR, Delivery.VOLATILE, silent="SUM"),
    )
    agent = Agent(
        name="asker", start="one", memory=asker().memory, behaviours={"one": Behaviour(go)}
    )
    core = Core(agent, Wiring("toy", "asker", links, LANGUAGES))
    with pytest.raises(LocalProtocolError, match=word):
        core.step(core.boot(None), Started(), 0.0)


# --- a broker between agents: brokering relays the answers, recruiting lets the targets give them -

NAMES = ("asker", "broker", *fipa.SCALES)


def played(faults: Faults | None = None, seed: int = 0) -> MemoryBus:
    """Everybody on the wires until all was answered."""
    wires = stage(faults, seed, names=NAMES)
    wires.run(
        lambda: (
            len(wires.memory("asker").ends) == 2
            and len(wires.memory("asker").answered) == len(fipa.SCALES)
        )
    )
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
    """By the broker's mouth first, from the scales themselves then, in whatever order; nobody is
    left waiting.
    """
    wires = played(faults, seed)
    asker = wires.memory("asker")
    assert asker.ends == ("brokering done", "recruiting done")
    assert sorted(asker.relayed) == sorted(asker.answered) == sorted(fipa.WEIGHTS.items())
    for name in fipa.SCALES:
        assert wires.memory(name).told == ("broker", "asker")
    for name in NAMES:
        state = wires.nodes[name].state
        assert state is not None
        assert not state.conversations


def test_each_conversation_inside_has_its_own_id() -> None:
    """Brokering: the targets never hear of the asker's id. Recruiting: the message keeps its own to
    the very target.
    """
    wires = played()
    spoken = {
        (c.protocol, c.conversation)
        for c in wires.traffic
        if "scale" in c.receiver or "scale" in c.sender
    }
    outer = {c.conversation for c in wires.traffic if c.protocol in ("brokering", "recruiting")}
    assert len(outer) == 2
    assert not outer & {conversation for _, conversation in spoken}
    direct = {
        c.conversation for c in wires.traffic if c.receiver == "asker" and c.sender in fipa.SCALES
    }
    assert direct == {"asker-1-recruiting"}


@pytest.mark.parametrize(
    ("role", "peer", "word"),
    [
        (Role.PARTICIPANT, "left-scale", "durable as initiator"),
        (Role.INITIATOR, "nobody", "has no 'query'"),
    ],
)
def test_what_cannot_be_joined(role: Role, peer: str, word: str) -> None:
    """A conversation the design has no link for."""

    def go(memory: fipa.Weighing, turn: Turn) -> fipa.Weighing:
        turn.join(Conversation.open("query", role, id="x-1", me="asker", peer=peer))
        return memory

    agent = Agent(
        name="asker", start="one", memory=fipa.Weighing(), behaviours={"one": Behaviour(go)}
    )
    core = Core(agent, fipa.wiring("asker"))
    with pytest.raises(LocalProtocolError, match=word):
        core.step(core.boot(None), Started(), 0.0)
