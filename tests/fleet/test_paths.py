"""Paths of real agents are paths of the proven model: recorded runs, stories in memory, with deaths and cancels."""

from pathlib import Path

import pytest
from msgspec.structs import replace
from pretended_operator import begun, say, set_level, stepped, waiting

from agent_runtime.core.effects import Deed
from agent_runtime.core.step import Core
from agent_runtime.io.steplog import deeds
from agent_runtime.testing.memory_bus import Point
from companion.autonomy import WAIT_S, Level, Verb
from companion.design import DESIGN
from topdown.prove.paths import Follower

HISTORY = Path(__file__).parents[1] / "histories" / "deeds_seed_7"
"""The steps of six processes over Zenoh that poured (seed 7, speed max); what came in and went out was cut off."""


@pytest.fixture
def done(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, Deed]]:
    """Acts of all agents of the process, in order."""
    made: list[tuple[str, Deed]] = []
    right = Core.step

    def step(self, state, event, now):
        after, effects = right(self, state, event, now)
        if effects.deed is not None:
            made.append((self.agent.name, effects.deed))
        return after, effects

    monkeypatch.setattr(Core, "step", step)
    return made


def test_a_recorded_run_is_a_path() -> None:
    """659 steps of six processes."""
    made = deeds(HISTORY / "steps")
    assert len({agent for agent, _ in made}) == 6
    assert Follower(DESIGN).follow(made) is None


@pytest.mark.parametrize("number", range(0, 659, 60))
def test_a_step_that_was_not_made_is_missed(number: int) -> None:
    """Without a step that says or takes something the rest of the run is not a path."""
    made = deeds(HISTORY / "steps")
    follower = Follower(DESIGN)
    loud = [place for place in range(number, len(made)) if _matters(follower, *made[place])]
    found = follower.follow([*made[: loud[0]], *made[loud[0] + 1 :]])
    assert found is not None
    assert found.number > loud[0]


def _matters(follower: Follower, agent: str, deed: Deed) -> bool:
    """A step on a durable stream that the model does not leave out."""
    uses = follower.steps[agent].uses
    said = [one for one in deed.said if uses[one[0]].durable and one not in follower.fleet.parts.silent]
    return bool(said)


def test_a_word_in_place_of_another_is_noticed() -> None:
    """co tells hi of a failure where the plan succeeded: a move of co, but hi takes what was never said."""
    made = deeds(HISTORY / "steps")
    place = max(n for n, (agent, deed) in enumerate(made) if agent == "co" and deed.took and "final" in deed.took[2])
    agent, deed = made[place]
    said = tuple((use, type(act)("failure") if act == "inform" else act, kind) for use, act, kind in deed.said)
    assert Follower(DESIGN).follow([*made[:place], (agent, replace(deed, said=said)), *made[place + 1 :]]) is not None


def test_a_story_in_memory(fleet, done) -> None:
    """A command, plan #1, Replan, plan #2."""
    fleet.say("pour the jar into the bowl")
    fleet.finish()
    assert Follower(DESIGN).follow(done) is None


@pytest.mark.parametrize("acts", range(1, 12, 2))
def test_a_cancelled_story(fleet, done, acts: int) -> None:
    """Cancelled when that many acts were begun."""
    fleet.say("pour the jar into the bowl")
    fleet.wires.run(lambda: len(fleet.world.begun) >= acts)
    fleet.cancel()
    fleet.finish()
    assert Follower(DESIGN).follow(done) is None


@pytest.mark.parametrize("name", DESIGN.agents)
@pytest.mark.parametrize("acts", [0, 1, 4])
def test_a_story_with_a_death(fleet, done, name: str, acts: int) -> None:
    """Each agent dies once its next record is written, early, in the first act, in the fourth."""
    fleet.say("pour the jar into the bowl")
    fleet.wires.run(lambda: len(fleet.world.begun) >= acts)
    fleet.wires.crash(name, Point.RECORDED)
    fleet.finish()
    assert Follower(DESIGN).follow(done) is None


@pytest.mark.parametrize("name", ["", *DESIGN.agents])
def test_a_story_act_by_act(fleet, done, name: str) -> None:
    """Each act waits for an operator; somebody dies while the first one does."""
    begun(fleet, Level.CONFIRM)
    fleet.wires.run(lambda: waiting(fleet))
    if name:
        fleet.wires.kill(name)
        fleet.wires.run_for(5.0)
    stepped(fleet)
    assert fleet.finish() == ["done"]
    assert Follower(DESIGN).follow(done) is None


@pytest.mark.parametrize("acts", [0, 1, 4])
@pytest.mark.parametrize("end", ["cancel", "replan", "nobody"])
def test_a_story_in_which_an_act_that_waits_is_given_up(fleet, done, end: str, acts: int) -> None:
    """Cancelled, planned again, or left alone until the wait is over."""
    begun(fleet, Level.CONFIRM)
    for _ in range(acts):
        fleet.wires.run(lambda: waiting(fleet))
        say(fleet, Verb.GO)
        fleet.wires.run(lambda: not waiting(fleet))
    fleet.wires.run(lambda: waiting(fleet))
    if end == "cancel":
        fleet.cancel()
    elif end == "replan":
        set_level(fleet, Level.HANDLING)
        fleet.wires.run(lambda: waiting(fleet))
        say(fleet, Verb.REPLAN)
        stepped(fleet)
    fleet.finish(limit_s=WAIT_S + 60.0)
    assert Follower(DESIGN).follow(done) is None


def test_a_story_in_which_an_act_under_way_is_given_up(fleet, done) -> None:
    """The operator wants another plan."""
    begun(fleet, Level.AUTO)
    fleet.wires.run(lambda: fleet.wires.nodes["ex"].state.state == "acting" and fleet.tasks[0].at is not None)
    say(fleet, Verb.REPLAN, fleet.tasks[0].at.id)
    fleet.finish()
    assert fleet.reports()[0] == "Replan"
    assert Follower(DESIGN).follow(done) is None
