"""Paths of real agents are paths of the proven model: recorded runs, stories in memory, with deaths
and cancels.
"""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace
from pretended_fleet import Fleet

from agent_runtime.io.steplog import deeds
from agent_runtime.testing.memory_bus import Point
from companion.autonomy import WAIT_S, Level, Verb
from companion.design import DESIGN
from topdown.prove.paths import Follower

HISTORY = Path(__file__).parents[1] / "histories" / "deeds_seed_7"
"""The steps of six processes over Zenoh that poured (seed 7, speed max); what came in and went out
was cut off.
"""
Some = Callable[[Any, int], list[Any]]


@pytest.fixture
def fleet():
    """A fleet whose story, whatever it is, turns out to be a path."""
    with Fleet() as made:
        yield made
    assert Follower(DESIGN).follow(made.deeds) is None


@cache
def recorded():
    """The 659 steps of the recorded run."""
    return deeds(HISTORY / "steps")


def test_a_recorded_run_is_a_path():
    """Of all six processes."""
    assert {agent for agent, _ in recorded()} == {*DESIGN.agents}
    assert Follower(DESIGN).follow(recorded()) is None


def test_a_step_that_was_not_made_is_missed(some):
    """Without a step that says something on a durable stream the rest of the run is not a path."""
    made, whole = recorded(), Follower(DESIGN)

    def loud(agent, deed):
        uses = whole.steps[agent].uses
        return any(
            uses[one[0]].durable and one not in whole.fleet.parts.silent for one in deed.said
        )

    for number in some(range(0, 659, 60), 3):
        place = next(place for place in range(number, len(made)) if loud(*made[place]))
        found = Follower(DESIGN).follow([*made[:place], *made[place + 1 :]])
        assert found is not None, place
        assert found.number > place


def test_a_message_in_place_of_another_is_noticed():
    """co tells hi of a failure where the plan succeeded: a move of co, but hi takes what was never
    said.
    """
    made = recorded()
    by_co = [(n, deed) for n, (agent, deed) in enumerate(made) if agent == "co"]
    place = max(n for n, deed in by_co if deed.took and "final" in deed.took[2])
    agent, deed = made[place]
    said = tuple(
        (use, type(act)("failure") if act == "inform" else act, kind)
        for use, act, kind in deed.said
    )
    changed = [*made[:place], (agent, replace(deed, said=said)), *made[place + 1 :]]
    assert Follower(DESIGN).follow(changed) is not None


@pytest.mark.parametrize("acts", range(1, 12, 2))
def test_a_cancelled_story(fleet, acts):
    """Cancelled when that many acts were begun."""
    fleet.say()
    fleet.until(lambda: len(fleet.world.begun) >= acts)
    fleet.cancel()
    fleet.finish()


@pytest.mark.parametrize("name", DESIGN.agents)
@pytest.mark.parametrize("acts", [0, 1, 4])
def test_a_story_with_a_death(fleet, name, acts):
    """Each agent dies once its next record is written, early, in the first act, in the fourth."""
    fleet.say()
    fleet.until(lambda: len(fleet.world.begun) >= acts)
    fleet.wires.crash(name, Point.RECORDED)
    fleet.finish()


@pytest.mark.parametrize("name", ["", *DESIGN.agents])
def test_a_story_act_by_act(fleet, name):
    """Each act waits for an operator; somebody dies while the first one does."""
    fleet.begin(Level.CONFIRM)
    fleet.until(lambda: fleet.waiting)
    if name:
        fleet.wires.kill(name)
        fleet.wires.run_for(5.0)
    fleet.step_through()
    assert fleet.finish() == ["done"]


@pytest.mark.parametrize("acts", [0, 1, 4])
@pytest.mark.parametrize("end", ["cancel", "replan", "nobody"])
def test_a_story_in_which_an_act_that_waits_is_given_up(fleet, end, acts):
    """Cancelled, planned again, or left alone until the wait is over."""
    fleet.begin(Level.CONFIRM)
    for _ in range(acts):
        fleet.let_go()
    fleet.until(lambda: fleet.waiting)
    if end == "cancel":
        fleet.cancel()
    elif end == "replan":
        fleet.set_level(Level.HANDLING)
        fleet.until(lambda: fleet.waiting)
        fleet.order(Verb.REPLAN)
        fleet.until(lambda: not fleet.waiting)
        fleet.step_through()
    fleet.finish(limit_s=WAIT_S + 60.0)


def test_a_story_in_which_an_act_under_way_is_given_up(fleet):
    """The operator wants another plan."""
    fleet.begin(Level.AUTO)
    fleet.until(lambda: fleet.state("ex") == "acting" and fleet.tasks[0].at is not None)
    fleet.order(Verb.REPLAN, fleet.tasks[0].at.id)
    fleet.finish()
    assert fleet.reports()[0] == "Replan"
