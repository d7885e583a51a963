"""The paper's main run in memory: a command, plan #1, Replan, plan #2, Succeeded; every fact asked of the true km."""

import itertools

from agent_runtime.testing.memory_bus import Point
from companion.languages import wm


def test_the_story(fleet) -> None:
    """Plan #1 ends in Replan, plan #2 pours, the person is told once."""
    fleet.say("pour the jar into the bowl")
    assert fleet.finish() == ["done"]
    assert fleet.reports() == ["Replan", "Succeeded"]
    assert fleet.world.poured == 1
    assert any(isinstance(query, wm.HypotheticalState) for query in fleet.asked)


def test_no_act_is_begun_twice(fleet) -> None:
    """Each key moves the robot in one act only: its two motions follow each other."""
    fleet.say("pour the jar into the bowl")
    fleet.finish()
    runs = [key for key, _ in itertools.groupby(fleet.world.begun)]
    assert len(runs) == len(set(runs))


def test_the_next_command_is_served(fleet) -> None:
    """After one task another one is done."""
    fleet.say("look around")
    fleet.say("pour the jar into the bowl")
    assert fleet.finish(2) == ["done", "done"]


def test_the_triple_store_mirrors_the_journal(fleet) -> None:
    """After a death of km and at the end its store holds what its memory holds."""
    fleet.say("pour the jar into the bowl")
    fleet.wires.run(lambda: bool(fleet.world.begun))
    fleet.wires.crash("km", Point.RECORDED)
    fleet.finish()
    km = fleet.wires.nodes["km"]
    assert km.state.memory.scene.things
    assert km.device.store.scene == km.state.memory.scene
