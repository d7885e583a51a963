"""A cancel at any time ends the task as cancelled (or it was done before), puts down what is held, and leaves a fleet
that serves the next command.
"""

import random

import pytest
from pretended_fleet import Fleet

from agent_runtime.testing.memory_bus import Faults, Point

LONGEST_S = 45.0  # the story takes about this long in virtual time


def cancelled_at(fleet: Fleet, after_s: float) -> list[str]:
    """Say it, wait, cancel it, run to the end."""
    fleet.say("pour the jar into the bowl")
    fleet.wires.run_for(after_s)
    fleet.cancel()
    return fleet.finish()


@pytest.mark.parametrize("block", range(6))
def test_a_cancel_at_any_time(block: int) -> None:
    """Preempted or done, hands empty after a cancel, and the next pour succeeds."""
    chance = random.Random(block)
    for _ in range(8):
        after_s = chance.uniform(0.0, LONGEST_S)
        fleet = Fleet(seed=block)
        states = cancelled_at(fleet, after_s)
        assert states[0] in ("cancelled", "done"), (after_s, fleet.tasks)
        if states[0] == "cancelled":
            assert set(fleet.reports()) <= {"Preempted", "Replan"}, after_s
            assert not fleet.wires.memory("ex").remembered.held, after_s
        fleet.say("pour the jar into the bowl")
        assert fleet.finish(2)[-1] == "done", after_s
        fleet.close()


def test_a_cancel_while_searching(fleet) -> None:
    """pl answers at once: no act is begun."""
    fleet.say("pour the jar into the bowl")
    fleet.wires.run(lambda: fleet.wires.nodes["pl"].state.state == "search")
    begun = list(fleet.world.begun)
    fleet.cancel()
    assert fleet.finish() == ["cancelled"]
    assert fleet.world.begun == begun


def replanning(fleet: Fleet) -> None:
    """Until the second plan is made, with the jar in a hand."""
    fleet.say("pour the jar into the bowl")
    fleet.wires.run(lambda: "Replan" in fleet.reports() and fleet.wires.nodes["pl"].state.state == "search")
    assert fleet.wires.memory("ex").remembered.held


def test_a_cancel_while_a_new_plan_is_made(fleet) -> None:
    """The jar is put down all the same: ta gets the plan, and leaves it."""
    replanning(fleet)
    fleet.cancel()
    assert fleet.finish() == ["cancelled"]
    assert fleet.reports() == ["Replan", "Preempted"]
    assert not fleet.wires.memory("ex").remembered.held


def test_an_urgent_word_while_a_new_plan_is_made(fleet) -> None:
    """The jar is put down before the robot looks around; then it pours."""
    replanning(fleet)
    fleet.say("look around", urgency=1)
    fleet.wires.run(lambda: any(task.state == "done" for task in fleet.tasks))
    assert not fleet.wires.memory("ex").remembered.held
    assert fleet.finish(2) == ["done", "done"]


def test_a_cancel_mid_pour(fleet) -> None:
    """The jar is put down, the plan is Preempted."""
    fleet.say("pour the jar into the bowl")
    fleet.wires.run(lambda: "pour" in str(getattr(fleet.wires.memory("ex").act, "command", "")).lower())
    fleet.wires.run(lambda: fleet.wires.nodes["ex"].state.state == "acting")
    fleet.cancel()
    assert fleet.finish() == ["cancelled"]
    assert fleet.reports() == ["Replan", "Preempted"]
    assert not fleet.wires.memory("ex").remembered.held


@pytest.mark.parametrize("victim", ["co", "pl", "km", "ta", "ex"])
def test_a_cancel_with_a_death(victim: str) -> None:
    """A cancel and a death of anybody, at times by chance: the task ends, and the next command is served."""
    chance = random.Random(victim)
    for seed in range(8):
        fleet = Fleet(seed=seed, faults=Faults())
        fleet.say("pour the jar into the bowl")
        fleet.wires.run_for(chance.uniform(0.0, LONGEST_S))
        fleet.wires.crash(victim, chance.choice(list(Point)), in_steps=chance.randrange(1, 12))
        fleet.cancel()
        states = fleet.finish()
        assert states[0] in ("cancelled", "done"), (victim, seed, fleet.tasks)
        fleet.say("pour the jar into the bowl")
        assert fleet.finish(2)[-1] == "done", (victim, seed)
        fleet.close()
