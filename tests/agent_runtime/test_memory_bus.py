"""Two toy agents in memory: whatever is lost, doubled, reordered, killed or forged, each request is
answered once.
"""

from functools import partial

import pytest
import toy_agents as toy
from driven import message
from hypothesis import given, settings
from hypothesis import strategies as st
from toy_agents import Double, Want, answers, toys

from agent_runtime.core.events import Effects
from agent_runtime.core.state import restored
from agent_runtime.core.streams import KEPT, OUTBOX_BOUND
from agent_runtime.testing.alone import Alone
from agent_runtime.testing.memory_bus import Faults, MemoryBus, Point, Quiet
from fipa_codec.communicate import Communicate
from fipa_codec.errors import LocalProtocolError, RemoteProtocolError
from fipa_codec.performatives import Performative as P

STOLEN = 99


def stolen(number: int) -> Communicate:
    """A thief's request in the asker's name."""
    labels = {"conversation": f"thief-{number}", "id": str(number), "reply_with": str(number)}
    return message(P.REQUEST, "asker>server", "request", Double(STOLEN), **labels)


def test_requests_are_answered_in_order() -> None:
    """Without faults each number comes back doubled, in the order asked."""
    wires = toys(1, 2, 3)
    wires.run(lambda: len(answers(wires)) == 3)
    assert answers(wires) == ((1, 2), (2, 4), (3, 6))
    wires.run_for(3.0)
    assert [str(c.performative) for c in wires.traffic] == ["request", "agree", "inform"] * 3


def test_a_word_not_taken_waits() -> None:
    """A person's word that comes while the asker asks is taken when it is idle again."""
    wires = toys(1)
    wires.run(lambda: any(c.sender == "server" for c in wires.traffic))
    wires.post("asker", Want(7))
    wires.run(lambda: len(answers(wires)) == 2)
    assert answers(wires)[-1] == (7, 14)


def test_quiet_wires_say_where_everybody_stands() -> None:
    """A wait that never ends raises an error that names the agents' states."""
    wires = toys()
    with pytest.raises(Quiet, match="asker idle, server serving"):
        wires.run(lambda: False)


@pytest.mark.parametrize("point", list(Point))
@pytest.mark.parametrize("victim", ["asker", "server"])
@pytest.mark.parametrize("step", range(1, 9))
def test_each_crash_once(victim: str, point: Point, step: int) -> None:
    """A death at each point of each step of either agent changes nothing of the outcome."""
    wires = toys(5, 6)
    wires.crash(victim, point, in_steps=step)
    wires.run(lambda: len(answers(wires)) == 2)
    assert answers(wires) == ((5, 10), (6, 12))
    assert wires.memory("server").done == (5, 6)


def test_the_same_seed_gives_the_same_bytes() -> None:
    """A run is repeatable: no clock and no chance but the seed's goes in."""

    def run() -> list[object]:
        wires = toys(
            *range(4), seed=3, faults=Faults(loss=0.2, duplication=0.2, delay=0.3, crash=0.05)
        )
        wires.run(lambda: len(answers(wires)) == 4, limit_s=3600.0)
        return [(c.id, c.conversation, c.sent) for c in wires.traffic]

    assert run() == run()


def steal(wires: MemoryBus, ahead: int) -> None:
    """Say a word in the asker's name, that many numbers after the last one that the server took."""
    node = wires.nodes["server"]
    if node.journal is not None:
        taken = restored(node.core.agent, node.journal).taken.get("asker", 0)
        wires.deliver(stolen(max(1, taken + ahead)), ("asker-journal-1", "server-journal-1"))


@given(
    seed=st.integers(0, 2**32),
    faults=st.builds(
        Faults,
        loss=st.sampled_from([0.0, 0.1, 0.4]),
        duplication=st.sampled_from([0.0, 0.3]),
        delay=st.sampled_from([0.0, 0.4]),
        crash=st.sampled_from([0.0, 0.02, 0.1]),
    ),
    thefts=st.lists(st.tuples(st.floats(0.0, 3.0), st.integers(-1, 3)), max_size=KEPT - 2),
)
@settings(max_examples=150, deadline=None)
def test_exactly_once_under_faults(
    seed: int, faults: Faults, thefts: list[tuple[float, int]]
) -> None:
    """Each request is worked on and answered once, in order, whatever strikes and whatever a thief
    of the key says.
    """
    wires = toys(*range(6), seed=seed, faults=faults)
    for at, ahead in thefts:
        wires.call(at, partial(steal, wires, ahead))
    wires.run(lambda: len(answers(wires)) == 6, limit_s=3600.0)
    wires.faults = Faults()
    wires.run(lambda: wires.up("asker") and wires.up("server"))
    assert answers(wires) == tuple((n, 2 * n) for n in range(6))
    assert tuple(n for n in wires.memory("server").done if n != STOLEN) == tuple(range(6))


def test_an_old_copy_of_a_journal_that_is_put_back_loses_no_word() -> None:
    """Its agent finds its numbers used: it says new words after them."""
    wires = toys()
    wires.run_for(1.0)
    old = wires.nodes["asker"].journal
    wires.post("asker", Want(1))
    wires.run(lambda: len(answers(wires)) == 1)
    wires.kill("asker")
    wires.nodes["asker"].journal = old
    wires.post("asker", Want(2))
    wires.run(lambda: answers(wires) == ((2, 4),))
    assert wires.memory("server").done == (1, 2)


def test_a_thief_who_always_says_the_next_number_is_passed() -> None:
    """It answers each receipt at once with the number after it, faster than the asker's disk."""
    wires = toys(1, 2, 3)

    def answered(agent: str, effects: Effects) -> None:
        if agent == "server" and effects.receipts:
            steal(wires, 1)

    wires.on_step = answered
    wires.run(lambda: len(answers(wires)) == 3, limit_s=60.0)
    assert answers(wires) == ((1, 2), (2, 4), (3, 6))


# --- One agent by itself --------------------------------------------------------------------------


def test_an_agent_that_asks_is_answered_by_hand() -> None:
    """Its words are there with their conversation; the answer goes back into it, and it goes on."""
    one = Alone(toy.asker(), toy.wirings()[0])
    one.post(toy.Want(4))
    (asked,) = one.said
    assert (one.state, one.content(asked)) == ("asking", toy.Double(4))
    one.answer(asked.conversation, P.INFORM, toy.Doubled(8))
    assert one.memory.answers == ((4, 8),)
    assert one.state == "idle"


def test_an_agent_that_is_asked_answers_in_pretended_time() -> None:
    """Agree at once, the result when its wake-up has come."""
    one = Alone(toy.server(), toy.wirings()[1])
    name = one.ask("asker", "request", P.REQUEST, toy.Double(3))
    assert one.answers(name) == (P.AGREE,)
    one.wait(0.05)
    assert one.answers(name) == (P.AGREE,)
    one.wait(0.1)
    assert one.answers(name) == (P.AGREE, P.INFORM)
    assert one.memory.done == (3,)


def test_a_message_that_waits_is_counted() -> None:
    """The asker is busy: a person's second word waits in the inbox."""
    one = Alone(toy.asker(), toy.wirings()[0])
    one.post(toy.Want(1))
    one.post(toy.Want(2))
    assert one.waiting == 1


def test_what_it_says_is_receipted_and_what_waits_is_taken() -> None:
    """More messages than an outbox holds, one behind the other: none stops the agent."""
    one = Alone(toy.server(), toy.wirings()[1])
    for number in range(2 * OUTBOX_BOUND):
        one.ask("asker", "request", P.REQUEST, toy.Double(number))
    one.wait(1.0)
    assert sorted(one.memory.done) == list(range(2 * OUTBOX_BOUND))


def test_nothing_out_of_sequence_gets_through() -> None:
    """Neither what the test says, nor what the agent says."""
    one = Alone(toy.server(), toy.wirings()[1])
    name = one.ask("asker", "request", P.REQUEST, toy.Double(3))
    with pytest.raises(LocalProtocolError):
        one.answer(name, P.INFORM, toy.Doubled(3))
    agreed = one.said[0]
    with pytest.raises(RemoteProtocolError):
        one.talks[name].receive(agreed)
