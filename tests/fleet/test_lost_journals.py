"""One agent loses its journal, or its end, amid a task: the task ends, a person hears why, and the fleet is at rest."""

import pytest
from pretended_fleet import FINAL, Fleet

from companion.design import DESIGN
from companion.languages.facts import Kind

AT = (0.15, 0.4, 0.6, 0.75, 0.9)
"""Parts of the steps that the victim makes in the story."""


@pytest.fixture(scope="module")
def counted() -> dict[str, int]:
    """Steps of each agent in a pour without a fault."""
    fleet = Fleet()
    fleet.say("pour the jar into the bowl")
    fleet.finish()
    found = {name: node.steps for name, node in fleet.wires.nodes.items()}
    fleet.close()
    return found


def lost(victim: str, step: int) -> Fleet:
    """The story up to this step of the victim, whose journal is deleted then."""
    fleet = Fleet(seed=step)
    fleet.say("pour the jar into the bowl")
    fleet.wires.run(lambda: fleet.wires.nodes[victim].steps >= step or fleet.ended(), limit_s=3600.0)
    fleet.wires.lose_journal(victim)
    return fleet


@pytest.mark.parametrize("part", AT)
@pytest.mark.parametrize("victim", DESIGN.agents)
def test_a_task_ends_and_the_fleet_is_at_rest(victim: str, part: float, counted: dict[str, int]) -> None:
    """Nobody waits for ever; of what a lost conversation ended, the person is told the reason."""
    fleet = lost(victim, 1 + int(part * counted[victim]))
    if victim != "hi":  # who forgets its tasks has none to end
        fleet.wires.run(fleet.ended, limit_s=3600.0)
        ends = [task for task in fleet.tasks if task.state in FINAL]
        assert ends
        why = Kind.NOT_SEEN if victim == "km" else Kind.BROKE_OFF  # km forgets the world, not a conversation
        assert all(task.state == "done" or why in [one.kind for one in task.why] for task in ends), ends
    fleet.wires.run(fleet.at_rest, limit_s=900.0)
    fleet.close()


@pytest.mark.parametrize("back", [1, 2, 5, 20])
@pytest.mark.parametrize("part", AT)
@pytest.mark.parametrize("victim", ["co", "pl", "ta", "ex", "km"])
def test_a_shorter_journal_ends_the_task_too(victim: str, part: float, back: int, counted: dict[str, int]) -> None:
    """As it was some records ago: nobody waits for a message that was taken and is forgotten."""
    fleet = Fleet(seed=back)
    kept: list[bytes] = []
    node = fleet.wires.nodes[victim]
    fleet.wires.on_step = lambda agent, effects: (
        kept.append(effects.record) if agent == victim and effects.record is not None else None
    )
    fleet.say("pour the jar into the bowl")
    fleet.wires.run(lambda: node.steps >= 1 + int(part * counted[victim]) or fleet.ended(), limit_s=3600.0)
    fleet.wires.put_back(victim, kept[max(0, len(kept) - 1 - back)])
    fleet.wires.run(fleet.ended, limit_s=3600.0)
    assert all(task.state == "done" or task.why for task in fleet.tasks), fleet.tasks
    fleet.wires.run(fleet.at_rest, limit_s=900.0)
    fleet.close()
