"""Two toy agents over pretend wires: whatever is lost, doubled, reordered or killed, each request is answered once."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from toy_agents import Want, asker, server, wirings

from agent_runtime.testing.memory_bus import Faults, MemoryBus, Point, Quiet


def toy_wires(*wanted: int, seed: int = 0, faults: Faults | None = None) -> MemoryBus:
    """Asker and server on the wires."""
    wires = MemoryBus(seed=seed, faults=faults)
    to_server, to_asker = wirings()
    wires.add(asker(*wanted), to_server)
    wires.add(server(), to_asker)
    return wires


def answers(wires: MemoryBus) -> tuple[tuple[int, int], ...]:
    """Return the asker's answers so far."""
    found: tuple[tuple[int, int], ...] = wires.memory("asker").answers
    return found


def test_requests_are_answered_in_order() -> None:
    """Without faults each number comes back doubled, in the order asked."""
    wires = toy_wires(1, 2, 3)
    wires.run(lambda: len(answers(wires)) == 3)
    assert answers(wires) == ((1, 2), (2, 4), (3, 6))
    wires.run_for(3.0)
    assert [str(c.performative) for c in wires.traffic] == ["request", "agree", "inform"] * 3


def test_a_word_not_taken_waits() -> None:
    """A person's word that comes while the asker asks is taken when it is idle again."""
    wires = toy_wires(1)
    wires.run(lambda: any(c.sender == "server" for c in wires.traffic))
    wires.post("asker", Want(7))
    wires.run(lambda: len(answers(wires)) == 2)
    assert answers(wires)[-1] == (7, 14)


def test_quiet_wires_say_where_everybody_stands() -> None:
    """A wait that never ends raises an error that names the agents' states."""
    wires = toy_wires()
    with pytest.raises(Quiet, match="asker idle, server serving"):
        wires.run(lambda: False)


@given(
    seed=st.integers(0, 2**32),
    loss=st.sampled_from([0.0, 0.1, 0.4]),
    duplication=st.sampled_from([0.0, 0.3]),
    delay=st.sampled_from([0.0, 0.4]),
    crash=st.sampled_from([0.0, 0.02, 0.1]),
)
@settings(max_examples=150, deadline=None)
def test_exactly_once_under_faults(seed: int, loss: float, duplication: float, delay: float, crash: float) -> None:
    """Every request is worked on once and answered once, in order, whatever faults strike."""
    wires = toy_wires(*range(6), seed=seed, faults=Faults(loss=loss, duplication=duplication, delay=delay, crash=crash))
    wires.run(lambda: len(answers(wires)) == 6, limit_s=3600.0)
    wires.faults = Faults()
    wires.run(lambda: wires.up("asker") and wires.up("server"))
    assert answers(wires) == tuple((n, 2 * n) for n in range(6))
    assert wires.memory("server").done == tuple(range(6))


@pytest.mark.parametrize("point", list(Point))
@pytest.mark.parametrize("victim", ["asker", "server"])
@pytest.mark.parametrize("step", range(1, 9))
def test_each_crash_once(victim: str, point: Point, step: int) -> None:
    """A death at each point of each step of either agent changes nothing of the outcome."""
    wires = toy_wires(5, 6)
    wires.crash(victim, point, in_steps=step)
    wires.run(lambda: len(answers(wires)) == 2)
    assert answers(wires) == ((5, 10), (6, 12))
    assert wires.memory("server").done == (5, 6)


def test_the_same_seed_gives_the_same_bytes() -> None:
    """A run is repeatable: no clock and no chance but the seed's goes in."""

    def run() -> list[object]:
        wires = toy_wires(*range(4), seed=3, faults=Faults(loss=0.2, duplication=0.2, delay=0.3, crash=0.05))
        wires.run(lambda: len(answers(wires)) == 4, limit_s=3600.0)
        return [(c.id, c.conversation, c.sent) for c in wires.traffic]

    assert run() == run()
