"""An agent dies, or loses its journal, at any point of any step: the task still ends well, exactly
once.

Of each run, the fleet itself finds what is wrong (pretended_fleet): no act begins twice, and
nothing that was said is against the design. Deaths at every message: benchmarks/kill_boundaries.py.
"""

from collections.abc import Callable
from typing import Any

import boundaries
import pytest
from boundaries import Side
from pretended_fleet import FINAL, NAMES, Fleet

from agent_runtime.testing.memory_bus import Faults, Point
from companion.languages.facts import Kind

Some = Callable[[Any, int], list[Any]]
SAMPLES = range(24)  # steps of an agent that are tried, spread over all it makes
# of the steps that an agent makes, after which it loses its journal
PARTS = (0.15, 0.4, 0.6, 0.75, 0.9)
UNSTEADY = Faults(loss=0.05, delay=0.1, crash=0.002)


@pytest.fixture(scope="module")
def counted():
    """Steps of each agent in the story."""
    with Fleet() as fleet:
        fleet.say()
        fleet.finish()
        return fleet.steps


@pytest.mark.parametrize("point", list(Point))
@pytest.mark.parametrize("victim", NAMES)
def test_a_death_changes_nothing_of_the_outcome(victim, point, counted, some):
    """Poured once, done once; agents that do not move the robot cost no act either.

    ex calls an act in which it died unknown, and the plan is made again from what is seen.
    """
    for step in sorted({1 + k * counted[victim] // len(SAMPLES) for k in some(SAMPLES, 5)}):
        if victim == "hi" and step < 4:
            continue  # the person's words are lost with it: nothing was promised yet
        with Fleet(seed=step) as fleet:
            fleet.wires.crash(victim, point, in_steps=step)
            fleet.say()
            assert fleet.finish() == ["done"], (step, fleet.tasks)
            assert fleet.reports().count("Succeeded") == 1, step
            assert fleet.reports()[-1] == "Succeeded", step
            assert fleet.world.poured == 1 or (victim == "ex" and fleet.world.poured > 1), step


@pytest.mark.parametrize("side", list(Side))
@pytest.mark.parametrize("victim", boundaries.VICTIMS)
def test_a_death_at_a_message_changes_no_end(victim, side, usual, some):
    """The same world at km, objects where they stood, the same last report; no act twice, poured
    once.
    """
    offset = 1 + 6 * boundaries.VICTIMS.index(victim) + 3 * list(Side).index(side)
    # a prime, so that all phases are hit
    for number in some(range(offset, usual.messages + 1, 41), 1):
        found = boundaries.run(victim, number, side)
        assert found.world == usual.world, number
        assert (found.stands, found.last, found.poured) == (usual.stands, usual.last, 1), number
        assert not found.doubled, number


def test_the_death_happens(usual):
    """Of ex in an act: it is not known how it ended, so more is commanded; of co nothing is."""
    after = (boundaries.run("ex", number, Side.AFTER) for number in range(20, 100, 8))
    assert any(len(run.acts) > len(usual.acts) for run in after)
    assert boundaries.run("co", 50, Side.AFTER).acts == usual.acts


@pytest.fixture(scope="module")
def usual():
    """The run without a death."""
    return boundaries.run()


@pytest.mark.parametrize(
    "faults", [UNSTEADY, Faults(UNSTEADY.loss, 0.05, UNSTEADY.delay, UNSTEADY.crash)]
)
def test_many_faults(faults, some):
    """Loss, copies, disorder and deaths of anybody: each command ends, and the fleet comes to rest.

    Copies are not judged: one that the judge does not hear is answered, and that answer was never
    asked for.
    """
    for seed in some(range(12), 4):
        with Fleet(seed=seed) as fleet:
            fleet.judged = not faults.duplication
            for count, command in enumerate(("look around", "pour the jar into the bowl"), start=1):
                fleet.say(command)
                fleet.wires.faults = faults
                fleet.until(lambda count=count: fleet.ended(count), 3600.0)
                fleet.wires.faults = Faults()
                fleet.until(fleet.at_rest)
            assert str(fleet.tasks[-1].state) in ("done", "failed"), seed


def until(fleet, victim, step):
    """Run until the victim's step of this number, or the end."""
    fleet.until(lambda: fleet.steps[victim] >= step or fleet.ended(), 3600.0)


# --- journals -------------------------------------------------------------------------------------


@pytest.mark.parametrize("victim", NAMES)
def test_without_its_journal_a_task_ends_and_the_fleet_is_at_rest(victim, counted, some):
    """Nobody waits for ever; of what a lost conversation ended, the person is told the reason."""
    for step in (1 + int(part * counted[victim]) for part in some(PARTS, 3)):
        fleet = Fleet(seed=step)  # what was said in a life that nobody remembers is not judged
        fleet.say()
        until(fleet, victim, step)
        fleet.wires.put_back(victim, None)
        if victim != "hi":  # who forgets its tasks has none to end
            fleet.until(fleet.ended, 3600.0)
            ends = [task for task in fleet.tasks if task.state in FINAL]
            # km forgets the world, not a conversation
            why = Kind.NOT_SEEN if victim == "km" else Kind.BROKE_OFF
            assert all(
                task.state == "done" or why in [one.kind for one in task.why] for task in ends
            ), (step, ends)
        fleet.until(fleet.at_rest, 900.0)
        fleet.wires.close()


@pytest.mark.parametrize("back", [1, 2, 5, 20])
@pytest.mark.parametrize("victim", ["co", "pl", "ta", "ex", "km"])
def test_a_shorter_journal_ends_the_task_too(victim, back, counted, some):
    """As it was some records ago: nobody waits for a message that was taken and is forgotten."""
    for step in (1 + int(part * counted[victim]) for part in some(PARTS, 2)):
        fleet, kept = Fleet(seed=back), list[bytes]()
        fleet.watch = lambda agent, effects, kept=kept: (
            kept.append(effects.record) if agent == victim and effects.record is not None else None
        )
        fleet.say()
        until(fleet, victim, step)
        fleet.wires.put_back(victim, kept[max(0, len(kept) - 1 - back)])
        fleet.until(fleet.ended, 3600.0)
        assert all(task.state == "done" or task.why for task in fleet.tasks), (step, fleet.tasks)
        fleet.until(fleet.at_rest, 900.0)
        fleet.wires.close()
