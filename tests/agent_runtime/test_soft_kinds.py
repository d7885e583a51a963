"""Observations and questions: the newest value arrives, the barrier holds, questions end, whatever
is lost.
"""

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from toy_agents import fleet
from toy_observers import Finish, Seen, WhatOf, asker, knower, watcher, wiring

from agent_runtime.testing.memory_bus import Faults, MemoryBus, Point
from fipa_codec.performatives import Performative


def observers(*, seed: int = 0, faults: Faults | None = None) -> MemoryBus:
    """Watcher, knower and asker on the wires."""
    agents = (watcher(), knower(), asker())
    return fleet(*((agent, wiring(agent.name)) for agent in agents), seed=seed, faults=faults)


def store(wires: MemoryBus) -> dict[str, int]:
    """Return the knower's store."""
    return dict(wires.memory("knower").store)


def test_observations_arrive_and_settle() -> None:
    """Each subject's newest value is stored; the watcher finishes only when all is receipted."""
    wires = observers()
    for value in range(3):
        wires.post("watcher", Seen("jar", value))
    wires.post("watcher", Seen("bowl", 7))
    wires.post("watcher", Finish())
    wires.run(lambda: wires.memory("watcher").finished)
    assert store(wires) == {"jar": 2, "bowl": 7}


def test_the_barrier_holds_while_the_subscriber_is_away() -> None:
    """Nothing is finished while the knower is dead, however long; all arrives once it is back."""
    wires = observers()
    wires.run_for(1.0)
    wires.crash("knower", Point.BEFORE, restart_s=100.0)
    wires.post("watcher", Seen("jar", 1))
    wires.post("watcher", Finish(), delay_s=0.1)
    wires.run_for(50.0)
    assert not wires.memory("watcher").finished
    wires.run(lambda: wires.memory("watcher").finished)
    assert store(wires) == {"jar": 1}


@given(
    seed=st.integers(0, 2**32),
    loss=st.sampled_from([0.0, 0.3]),
    delay=st.sampled_from([0.0, 0.4]),
    crash=st.sampled_from([0.0, 0.05]),
)
# a late copy of an older subscribe came after the newer one
@example(seed=56653, loss=0.3, delay=0.4, crash=0.05)
@settings(max_examples=100, deadline=None)
def test_latest_value_under_faults(seed: int, loss: float, delay: float, crash: float) -> None:
    """The knower holds the newest value once the watcher finished; its store never went back to an
    older one.
    """
    faults = Faults(loss=loss, duplication=0.2, delay=delay, crash=0.0)
    wires = observers(seed=seed, faults=faults)
    for value in range(1, 6):
        # What the receptor says may be lost with the process, so it is said without crashes; they
        # strike afterwards.
        wires.post("watcher", Seen("jar", value), delay_s=0.05 * value)
        wires.post("watcher", Seen("bowl", 10 * value), delay_s=0.05 * value)
    wires.run_for(0.5)
    wires.faults = Faults(loss=loss, duplication=0.2, delay=delay, crash=crash)
    wires.run_for(5.0)
    wires.faults = Faults(loss=loss)
    wires.run(lambda: wires.up("watcher") and wires.up("knower"))
    wires.post("watcher", Finish())
    wires.run(lambda: wires.memory("watcher").finished, limit_s=3600.0)
    assert store(wires) == {"jar": 5, "bowl": 50}
    seen = [one.value for one in wires.memory("knower").history if one.subject == "jar"]
    assert seen == sorted(set(seen))


def test_a_subscriber_that_lost_its_journal_is_served_again() -> None:
    """It counts its lives from 1 again; its subscription is not a late copy of an earlier one."""
    wires = observers()
    for _ in range(3):
        wires.run_for(1.0)
        wires.crash("knower")
        wires.post("asker", WhatOf("jar"))
        wires.run(lambda: not wires.up("knower"))
        wires.run(lambda: wires.up("knower"))
    wires.run_for(1.0)
    wires.crash("knower")
    wires.post("asker", WhatOf("jar"))
    wires.run(lambda: not wires.up("knower"))
    wires.nodes["knower"].journal = None
    wires.run(lambda: wires.up("knower"))
    wires.run_for(1.0)
    wires.post("watcher", Seen("jar", 1))
    wires.run(lambda: store(wires) == {"jar": 1}, limit_s=5.0)


@given(
    seed=st.integers(0, 2**32),
    loss=st.sampled_from([0.0, 0.3, 0.6]),
    crash=st.sampled_from([0.0, 0.05]),
)
@settings(max_examples=50, deadline=None)
def test_who_knows_the_last_one_knows_the_others(seed: int, loss: float, crash: float) -> None:
    """Of a group of observations the one that is to be the last arrives last, whatever is lost and
    whoever dies.
    """
    wires = observers(seed=seed, faults=Faults(loss=loss, duplication=0.2, delay=0.3))
    wires.run_for(1.0)
    for subject in ("jar", "bowl", "table", "all-told"):
        wires.post("watcher", Seen(subject, 1))
    wires.run_for(0.0)
    wires.faults = Faults(loss=loss, duplication=0.2, delay=0.3, crash=crash)
    wires.run(lambda: "all-told" in store(wires), limit_s=3600.0)
    assert store(wires) == {"jar": 1, "bowl": 1, "table": 1, "all-told": 1}


def test_a_late_copy_of_an_older_subscription_is_dropped() -> None:
    """Observations go on in the newest subscription, whatever comes late from one that was given
    up.
    """
    wires = observers()
    wires.run_for(1.0)
    (old,) = [one for one in wires.traffic if one.performative is Performative.SUBSCRIBE]
    wires.crash("watcher", Point.BEFORE)
    wires.post("watcher", Seen("bowl", 1))
    wires.run_for(2.0)
    wires.deliver(old)
    wires.run_for(1.0)
    wires.post("watcher", Seen("jar", 1))
    wires.post("watcher", Finish())
    wires.run(lambda: wires.memory("watcher").finished, limit_s=1.0)
    assert store(wires)["jar"] == 1


@pytest.mark.parametrize("loss", [0.0, 0.5])
def test_questions_are_asked_again(loss: float) -> None:
    """A question gets one answer for the asker, however many copies travel."""
    wires = observers(seed=5, faults=Faults(loss=loss, duplication=0.3))
    wires.post("watcher", Seen("jar", 4))
    wires.run(lambda: store(wires) == {"jar": 4})
    for _ in range(5):
        wires.post("asker", WhatOf("jar"))
    wires.run(lambda: len(wires.memory("asker").answers) + wires.memory("asker").late == 5)
    wires.run_for(10.0)
    assert wires.memory("asker").answers.count(4) == 5 - wires.memory("asker").late


def test_questions_write_no_record() -> None:
    """Hundreds of questions cost the one who answers no disk sync."""
    wires = observers()
    wires.run_for(1.0)
    records: list[str] = []
    wires.on_step = lambda agent, effects: (
        records.append(agent) if effects.record is not None else None
    )
    for _ in range(20):
        wires.post("asker", WhatOf("jar"))
    wires.run(lambda: len(wires.memory("asker").answers) == 20)
    assert "knower" not in records


def test_an_unanswered_question_is_late_once() -> None:
    """With nobody there the question ends at reply-by, and nothing is asked any more."""
    wires = fleet((asker(), wiring("asker")))
    wires.post("asker", WhatOf("jar"))
    start = wires.now
    wires.run(lambda: wires.memory("asker").late == 1)
    assert 5.0 < wires.now - start < 5.01
    sent = len(wires.traffic)
    wires.run_for(20.0)
    assert len(wires.traffic) == sent
    assert wires.memory("asker").late == 1


def test_a_server_killed_in_the_middle_is_asked_again() -> None:
    """The knower dies with the question; the answer comes from its next life, from what it
    stored.
    """
    wires = observers()
    wires.post("watcher", Seen("jar", 4))
    wires.run(lambda: store(wires) == {"jar": 4})
    wires.run_for(1.0)
    wires.crash("knower", Point.BEFORE, restart_s=1.0)
    wires.post("asker", WhatOf("jar"))
    wires.run(lambda: wires.memory("asker").answers == (4,))
