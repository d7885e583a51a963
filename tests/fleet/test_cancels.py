"""A cancel at any time ends the task as cancelled (or it was done before), puts down what is held,
and leaves a fleet that serves the next command.
"""

import random
from collections.abc import Callable
from typing import Any

import pytest
from pretended_fleet import Fleet

from agent_runtime.testing.memory_bus import Point

LONGEST_S = 45.0  # the story takes about this long in virtual time
Some = Callable[[Any, int], list[Any]]


@pytest.mark.parametrize("block", range(6))
def test_a_cancel_at_any_time(block, some):
    """Preempted or done, hands empty after a cancel, and the next pour succeeds."""
    chance = random.Random(block)
    for after_s in some([chance.uniform(0.0, LONGEST_S) for _ in range(8)], 2):
        with Fleet(seed=block) as fleet:
            fleet.say()
            fleet.wires.run_for(after_s)
            fleet.cancel()
            (state,) = fleet.finish()
            assert state in ("cancelled", "done"), (after_s, fleet.tasks)
            if state == "cancelled":
                assert set(fleet.reports()) <= {"Preempted", "Replan"}, after_s
                assert not fleet.held, after_s
            fleet.say()
            assert fleet.finish(2)[-1] == "done", after_s


def replanning(fleet):
    """Until the second plan is made, with the jar in a hand."""
    fleet.say()
    fleet.until(lambda: "Replan" in fleet.reports() and fleet.state("pl") == "search")
    assert fleet.held


def test_a_cancel_while_a_new_plan_is_made(fleet):
    """The jar is put down all the same: ta gets the plan, and leaves it."""
    replanning(fleet)
    fleet.cancel()
    assert fleet.finish() == ["cancelled"]
    assert fleet.reports() == ["Replan", "Preempted"]
    assert not fleet.held


def test_an_urgent_word_while_a_new_plan_is_made(fleet):
    """The jar is put down before the robot looks around; then it pours."""
    replanning(fleet)
    fleet.say("look around", urgency=1)
    fleet.until(lambda: any(task.state == "done" for task in fleet.tasks))
    assert not fleet.held
    assert fleet.finish(2) == ["done", "done"]


def test_a_cancel_while_searching(fleet):
    """pl answers at once: no act is begun."""
    fleet.say()
    fleet.until(lambda: fleet.state("pl") == "search")
    begun = list(fleet.world.begun)
    fleet.cancel()
    assert fleet.finish() == ["cancelled"]
    assert fleet.world.begun == begun


def test_a_cancel_mid_pour(fleet):
    """The jar is put down, the plan is Preempted."""
    fleet.say()
    fleet.until(lambda: "pour" in str(getattr(fleet.wires.memory("ex").act, "command", "")).lower())
    fleet.until(lambda: fleet.state("ex") == "acting")
    fleet.cancel()
    assert fleet.finish() == ["cancelled"]
    assert fleet.reports() == ["Replan", "Preempted"]
    assert not fleet.held


@pytest.mark.parametrize("victim", ["co", "pl", "km", "ta", "ex"])
def test_a_cancel_with_a_death(victim, some):
    """A cancel and a death of anybody, at times by chance: the task ends, and the next command is
    served.
    """
    chance = random.Random(victim)
    for seed in some(range(8), 2):
        with Fleet(seed=seed) as fleet:
            fleet.say()
            fleet.wires.run_for(chance.uniform(0.0, LONGEST_S))
            fleet.wires.crash(victim, chance.choice(list(Point)), in_steps=chance.randrange(1, 12))
            fleet.cancel()
            assert fleet.finish()[0] in ("cancelled", "done"), (seed, fleet.tasks)
            fleet.say()
            assert fleet.finish(2)[-1] == "done", seed
