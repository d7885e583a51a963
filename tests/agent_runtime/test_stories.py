"""Every protocol of FIPA is carried by the runtime, between two agents, in a crowd and by a broker,
under faults.
"""

from collections.abc import Iterable

import fipa_agents as fipa
import pytest
from driven import message, quiet, refused
from hypothesis import given, settings
from hypothesis import strategies as st
from toy_agents import faulty, fleet, wired

from agent_runtime.core.events import Started
from agent_runtime.core.wiring import Delivery
from agent_runtime.testing.memory_bus import Faults, MemoryBus
from fipa_codec.conversation import Conversation
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
    agents = ((fipa.made(name), fipa.wiring(name, query=query)) for name in names)
    return fleet(*agents, seed=seed, faults=faults)


def expect_nothing_open(wires: MemoryBus) -> None:
    """No conversation, once who has just died is back."""
    wires.faults = Faults()
    wires.run_for(10.0)
    states = [node.state for node in wires.nodes.values()]
    assert not any(state is None or state.conversations for state in states)


def expect_all_ended(wires: MemoryBus) -> None:
    """All stories came to their ends on both sides."""
    roles = {"alice": Role.INITIATOR, "bob": Role.PARTICIPANT}

    def over(name: str) -> bool:
        return wires.memory(name).wrong or len(wires.memory(name).ends) == len(fipa.SCRIPT)

    wires.run(lambda: any(map(over, roles)), limit_s=1e6)
    expect_nothing_open(wires)
    for name, role in roles.items():
        assert not wires.memory(name).wrong
        assert wires.memory(name).ends == fipa.wanted(role)


@pytest.mark.parametrize("query", [Delivery.DURABLE, Delivery.VOLATILE])
def test_all_stories_of_all_protocols(query: Delivery) -> None:
    """Twelve protocols, and each with its cancels."""
    assert {name for name, _ in fipa.SCRIPT} == {protocol.name for protocol in fipa.PROTOCOLS}
    expect_all_ended(stage(query=query))


@given(faulty(0.2, 0.3, 0.3, 0.02), st.integers(0, 2**32))
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
    caller = called(wires)
    expect_nothing_open(wires)
    if not loss:
        ends = {name: wires.memory(name).state for name in fipa.CROWD}
        assert (caller.outcomes, ends) == (fipa.OUTCOMES, fipa.ENDS)
        # neither had ended when its time was over
        assert set(caller.late) == {"eager", "slow"}
    assert len({c.conversation for c in wires.traffic}) == 1
    assert caller.outcomes["slow"] == "refused"


def called(wires: MemoryBus) -> fipa.Calling:
    """The caller when it knows all outcomes."""
    wires.run(lambda: bool(wires.memory("caller").outcomes))
    found: fipa.Calling = wires.memory("caller")
    return found


@pytest.mark.parametrize("steps", range(1, 12))
def test_caller_that_dies_goes_on_with_its_crowd(steps: int) -> None:
    """The multicast is memory, the conversations are in the journal: a restored caller comes to the
    same award.
    """
    wires = stage(names=("caller", *fipa.CROWD))
    wires.crash("caller", in_steps=steps, restart_s=0.05)
    assert called(wires).outcomes == fipa.OUTCOMES
    state = wires.nodes["caller"].state
    assert state is not None
    assert state.incarnation == 2


def test_garbage_of_one_participant_ends_its_conversation_only() -> None:
    """not-understood and Broken concern one of the crowd, named as peer; the next best is
    awarded.
    """
    wires = stage(names=("caller", *fipa.CROWD))
    wires.run(lambda: any(c.receiver == "eager" for c in wires.traffic))
    call = next(c for c in wires.traffic if c.receiver == "eager")
    wires.deliver(message(P.AGREE, "eager>caller", "icfp", conversation=call.conversation))
    changed = {"eager": "not-understood", "modest": "done"}
    assert called(wires).outcomes == fipa.OUTCOMES | changed
    wires.run_for(10.0)
    assert {name: wires.memory(name).state for name in fipa.CROWD} == fipa.ENDS | changed


def test_content_that_the_act_does_not_carry_is_the_speakers_fault() -> None:
    """The step fails before anything leaves."""
    proposition = fipa.content(P.INFORM, Kind.PLAIN)
    agent = quiet(lambda turn: turn.open("bob", "request", P.REQUEST, proposition), name="alice")
    words = "is a proposition; request carries an action expression"
    refused(words, agent, fipa.wiring("alice"), Started())


@pytest.mark.parametrize(
    ("to", "protocol", "words"),
    [
        ((), "request", "a multicast"),
        (("server", "server"), "request", "one conversation with each"),
        (("server",), "query", "not durable"),
    ],
)
def test_what_cannot_be_opened_with_several(to: tuple[str, ...], protocol: str, words: str) -> None:
    """Nobody, one twice, or over a link that promises nothing."""
    uses = [("asker", "server", "T1", "request", Delivery.DURABLE)]
    uses += [("asker", "server", "T1", "query", Delivery.VOLATILE)]
    agent = quiet(lambda turn: turn.open_all(to, protocol, P.REQUEST), name="asker")
    refused(words, agent, wired("asker", uses), Started())


# --- a broker between agents: brokering relays the answers, recruiting lets the targets give them -

NAMES = ("asker", "broker", *fipa.SCALES)


def played(faults: Faults | None = None, seed: int = 0) -> MemoryBus:
    """Everybody on the wires until all was answered."""
    wires = stage(faults, seed, names=NAMES)

    def over() -> bool:
        asker = wires.memory("asker")
        return len(asker.ends) == 2 and len(asker.answered) == len(fipa.SCALES)

    wires.run(over)
    expect_nothing_open(wires)
    return wires


@given(faulty(0.3, 0.3, 0.3, 0.05), st.integers(0, 2**32))
@settings(max_examples=40, deadline=None)
def test_every_answer_comes_once_whatever_the_wires_do(faults: Faults, seed: int) -> None:
    """By the broker's mouth first, from the scales themselves then, in whatever order; nobody is
    left waiting.
    """
    wires = played(faults, seed)
    asker = wires.memory("asker")
    assert asker.ends == ("brokering done", "recruiting done")
    assert sorted(asker.relayed) == sorted(asker.answered) == sorted(fipa.WEIGHTS.items())
    assert {wires.memory(name).told for name in fipa.SCALES} == {("broker", "asker")}


def test_each_conversation_inside_has_its_own_id() -> None:
    """Brokering: the targets never hear of the asker's id. Recruiting: the message keeps its own to
    the very target.
    """
    said = played().traffic
    inner = {c.conversation for c in said if {c.receiver, c.sender} & set(fipa.SCALES)}
    outer = {c.conversation for c in said if c.protocol in ("brokering", "recruiting")}
    assert len(outer) == 2
    assert not outer & inner
    direct = [c for c in said if c.receiver == "asker" and c.sender in fipa.SCALES]
    assert {c.conversation for c in direct} == {"asker-1-recruiting"}


@pytest.mark.parametrize(
    ("role", "peer", "words"),
    [
        (Role.PARTICIPANT, "left-scale", "durable as initiator"),
        (Role.INITIATOR, "nobody", "has no 'query'"),
    ],
)
def test_what_cannot_be_joined(role: Role, peer: str, words: str) -> None:
    """A conversation the design has no link for."""
    talk = Conversation.open("query", role, id="x-1", me="asker", peer=peer)
    agent = quiet(lambda turn: turn.join(talk), name="asker")
    refused(words, agent, fipa.wiring("asker"), Started())
