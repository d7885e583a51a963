"""Agents that ask each other more than an outbox holds come to an end of it, whatever the wires
do.
"""

import msgspec
import pytest
from driven import Driven, agree, quiet, request
from hypothesis import given, settings
from hypothesis import strategies as st
from toy_agents import (
    RING,
    Doubled,
    Order,
    Want,
    faulty,
    fleet,
    ring_agent,
    ring_wiring,
    wirings,
)

from agent_runtime.core.events import Late, Local, Receipted, Woken
from agent_runtime.core.state import Outgoing
from agent_runtime.core.streams import ANSWERS_BOUND, OUTBOX_BOUND
from agent_runtime.core.turn import Turn
from agent_runtime.testing.memory_bus import Faults, MemoryBus
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P

LIMIT_S = 300.0
"""Of virtual time; re-sending goes up to every 2 s."""


def ring(count: int, *, seed: int = 0) -> MemoryBus:
    """So many agents."""
    members = RING[:count]
    return fleet(
        *((ring_agent(me, members), ring_wiring(me, members)) for me in members), seed=seed
    )


def order(wires: MemoryBus, wanted: range, at_once: int) -> None:
    """Each is to ask all these, so many in one step."""
    for first in range(0, len(wanted), at_once):
        for name in wires.nodes:
            wires.post(name, Order(tuple(wanted[first : first + at_once])))


def expect_all_answered(wires: MemoryBus, wanted: range) -> None:
    """Each question once, in each direction."""
    longest = [0]

    def look(name: str, _: object) -> None:
        state = wires.nodes[name].state
        if state is not None:
            longest[0] = max(longest[0], *map(len, state.outbox.values()), 0)

    def answered() -> bool:
        return all(len(wires.memory(name).answers) == len(wanted) for name in wires.nodes)

    wires.on_step = look
    wires.run(answered, limit_s=LIMIT_S)
    for name in wires.nodes:
        memory = wires.memory(name)
        assert sorted(memory.answers) == [(number, 2 * number) for number in wanted]
        assert sorted(memory.done) == list(wanted)
    assert longest[0] <= ANSWERS_BOUND


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize("at_once", [1, 5, 12, 16])
def test_a_ring_of_questions_ends(count: int, at_once: int) -> None:
    """Twelve at once in both directions filled both outboxes, and then neither took what would have
    emptied them.
    """
    wires = ring(count)
    order(wires, range(48), at_once)
    expect_all_answered(wires, range(48))


@pytest.mark.parametrize("count", [2, 3])
def test_a_ring_of_chains_ends(count: int) -> None:
    """Each end of a conversation opens the next one."""
    wires = ring(count)
    for name in wires.nodes:
        wires.post(name, Order(tuple(range(16)), rest=tuple(range(16, 64))))
    expect_all_answered(wires, range(64))


@given(
    faults=faulty(0.3, 0.3, 0.3, 0.02),
    seed=st.integers(0, 2**32),
    count=st.sampled_from([2, 3]),
    at_once=st.integers(1, 16),
)
@settings(max_examples=25, deadline=None)
def test_a_ring_of_questions_ends_under_faults(
    faults: Faults, seed: int, count: int, at_once: int
) -> None:
    """Each question that an agent has asked is answered; a death may take a person's word that it
    has not read.
    """
    wires = ring(count, seed=seed)
    order(wires, range(24), at_once)
    wires.run(lambda: all(wires.memory(name).asked for name in wires.nodes))
    wires.faults = faults
    wires.run_for(10.0)
    wires.faults = msgspec.structs.replace(faults, crash=0.0)
    wires.run(lambda: at_rest(wires), limit_s=LIMIT_S)
    for name in wires.nodes:
        answers = wires.memory(name).answers
        assert sorted(answers) == [(number, 2 * number) for number in sorted(dict(answers))]


def at_rest(wires: MemoryBus) -> bool:
    """Whether all live, and nothing is asked, owed or on its way."""
    states = [node.state for node in wires.nodes.values()]
    return not any(
        state is None
        or (state.memory.asked or state.memory.owed or state.outbox or state.soft.inbox)
        for state in states
    )


def test_new_questions_wait_while_the_outbox_is_full() -> None:
    """A peer that is away holds the next questions back, and nothing else: what others ask is
    agreed to.
    """
    wires = ring(3)
    wires.run_for(1.0)
    wires.crash("two", restart_s=30.0)
    wires.post("two", Order((1,)))
    for number in range(40):
        wires.post("one", Order((number,)), delay_s=1.0)
    wires.post("three", Order((7,)), delay_s=2.0)
    wires.run(lambda: bool(wires.memory("three").answers), limit_s=10.0)
    state = wires.nodes["one"].state
    assert state is not None
    assert len(state.outbox["two"]) == OUTBOX_BOUND
    assert len(state.soft.inbox) == 40 - OUTBOX_BOUND
    assert state.soft.full == "two"
    wires.run(lambda: len(wires.memory("one").answers) == 40, limit_s=60.0)


@pytest.mark.parametrize(
    ("held", "own", "peers"),
    [(OUTBOX_BOUND, 1, 1), (ANSWERS_BOUND, 0, 1), (2 * ANSWERS_BOUND, 0, 0)],
)
def test_room_for_answers_ends_too(held: int, own: int, peers: int) -> None:
    """Beyond the bound news that nobody asked for wait; beyond twice the bound so does the peer
    that brings it about.

    What is held back is taken when there is room.
    """

    def said(turn: Turn) -> None:
        if isinstance(turn.event, Local):
            turn.say("asker-1-1", P.INFORM, Doubled(0), kind=Kind.PROGRESS)
        agree(turn)

    one = Driven(quiet(said), wirings()[1])
    one.step(request(1))
    kept = one.state.outbox["asker"][0]
    one.state.outbox["asker"] = tuple(
        Outgoing(number, kept.communicate) for number in range(1, held + 1)
    )
    one.state.issued["asker"] = held
    one.step(Local(Want(1)))
    assert len(one.state.outbox["asker"]) == held + own
    one.step(request(2, conversation="asker-1-2"))
    assert one.state.taken == {"asker": 1 + peers}
    assert len(one.state.outbox["asker"]) == held + own + peers
    one.step(Receipted("asker", taken=held))
    assert len(one.state.outbox["asker"]) == 2


def test_a_wake_up_and_a_wait_that_is_over_are_held_back_too() -> None:
    """Each opens a conversation; with room again each does, once."""

    def said(turn: Turn) -> None:
        if isinstance(turn.event, Local | Late | Woken):
            first = isinstance(turn.event, Local) and turn.event.content.number
            turn.open("server", "request", P.REQUEST, reply_by_s=1.0 if first else None)
        if isinstance(turn.event, Local):
            turn.wake("again", turn.now + 1.0)

    one = Driven(quiet(said, name="asker"), wirings()[0])
    for number in range(OUTBOX_BOUND):
        one.step(Local(Want(int(number == 0))))
    effects = one.later(one.now + 2.0)
    assert not effects.more
    assert effects.wake_at is not None
    assert effects.wake_at > one.now  # to send again, not for what is held back
    assert len(one.state.outbox["server"]) == OUTBOX_BOUND
    one.step(Receipted("server", taken=3))
    assert len(one.state.outbox["server"]) == OUTBOX_BOUND - 3 + 2
    assert one.state.wakes == {}
