"""One agent dies once, at any point of any step, and comes back: the task still ends well, exactly once."""

import pytest
from pretended_fleet import FINAL, Fleet

from agent_runtime.testing.memory_bus import Faults, Point
from companion.design import DESIGN

POINTS = list(Point)
SAMPLES = 24  # steps per agent that are tried, spread over all it makes
VICTIMS = tuple(DESIGN.agents)


def steps_of_the_story() -> dict[str, int]:
    """Return the number of steps each agent makes without a fault."""
    fleet = Fleet()
    fleet.say("pour the jar into the bowl")
    fleet.finish()
    counted = {name: node.steps for name, node in fleet.wires.nodes.items()}
    fleet.close()
    return counted


@pytest.fixture(scope="module")
def counted() -> dict[str, int]:
    """Steps of each agent in the story."""
    return steps_of_the_story()


def killed(victim: str, point: Point, step: int) -> Fleet:
    """The story with one death in it, run to its end."""
    fleet = Fleet(seed=step)
    fleet.wires.crash(victim, point, in_steps=step)
    fleet.say("pour the jar into the bowl")
    states = fleet.finish()
    assert states == ["done"], (victim, point, step, fleet.tasks)
    return fleet


@pytest.mark.parametrize("point", POINTS)
@pytest.mark.parametrize("victim", ["co", "pl", "km", "ta"])
def test_a_death_changes_nothing_of_the_outcome(victim: str, point: Point, counted: dict[str, int]) -> None:
    """Poured once, done once, no act begun twice; agents that do not move the robot cost no act either."""
    total = counted[victim]
    for step in sorted({1 + k * total // SAMPLES for k in range(SAMPLES)}):
        fleet = killed(victim, point, step)
        assert fleet.world.poured == 1, (victim, point, step)
        assert fleet.reports()[-1] == "Succeeded", (victim, point, step)
        assert fleet.reports().count("Succeeded") == 1, (victim, point, step)
        assert sum(task.state in FINAL for task in fleet.tasks) == 1
        fleet.close()


@pytest.mark.parametrize("point", POINTS)
@pytest.mark.parametrize("victim", ["ex", "hi"])
def test_deaths_of_robot_and_human_interface(victim: str, point: Point, counted: dict[str, int]) -> None:
    """ex calls an act in which it died unknown and never begins it again; the plan is made again from what is seen."""
    total = counted[victim]
    for step in sorted({1 + k * total // SAMPLES for k in range(SAMPLES)}):
        if victim == "hi" and step < 4:
            continue  # the person's word is lost with it: nothing was promised yet
        fleet = killed(victim, point, step)
        assert fleet.world.poured >= 1
        starts = [key for k, key in enumerate(fleet.world.begun) if k == 0 or fleet.world.begun[k - 1] != key]
        assert len(starts) == len(set(starts)), (point, step, starts)
        fleet.close()


@pytest.mark.parametrize("seed", range(12))
def test_many_faults(seed: int) -> None:
    """Loss, copies, disorder and deaths of anybody: the command ends, and the fleet comes to rest."""
    faults = Faults(loss=0.05, duplication=0.05, delay=0.1, crash=0.002)
    fleet = Fleet(seed=seed)
    fleet.say("look around")
    fleet.wires.faults = faults
    fleet.wires.run(fleet.ended, limit_s=3600.0)
    fleet.wires.faults = Faults()
    fleet.wires.run(fleet.at_rest, limit_s=300.0)
    fleet.say("pour the jar into the bowl")
    fleet.wires.faults = faults
    fleet.wires.run(lambda: fleet.ended(2), limit_s=3600.0)
    fleet.wires.faults = Faults()
    fleet.wires.run(fleet.at_rest, limit_s=300.0)
    assert str(fleet.tasks[-1].state) in ("done", "failed")
    fleet.close()
