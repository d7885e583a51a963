"""No false alarms: whatever dies, is lost or delayed, the judge finds the traffic of the agents as designed."""

from collections import Counter

import pytest
from pretended_fleet import Fleet
from tapped_fleet import Tapped

from agent_runtime.testing.memory_bus import Faults, Point
from companion.design import DESIGN
from topdown.judge.verdicts import Verdict

STEPS = (2, 5, 9, 14, 22, 35, 51, 80)
VICTIMS = tuple(DESIGN.agents)


def told(fleet: Fleet) -> tuple[Tapped, Counter[Verdict]]:
    """The tap of a fleet whose task is over, and its verdicts."""
    tapped = fleet.wires.traffic
    assert isinstance(tapped, Tapped)
    assert tapped.violations() == []
    return tapped, Counter(one.verdict for one in tapped.judgements)


def test_a_pour_is_as_designed() -> None:
    """Every communicate is judged, and none is found wrong; nothing is left unjudged, since all was heard."""
    fleet = Fleet()
    Tapped(fleet.wires)
    fleet.say("pour the jar into the bowl")
    assert fleet.finish() == ["done"]
    tapped, verdicts = told(fleet)
    assert len(tapped.judgements) == len(tapped) > 150
    assert verdicts[Verdict.NOT_JUDGED] == 0
    fleet.close()


@pytest.mark.parametrize("point", list(Point))
@pytest.mark.parametrize("victim", VICTIMS)
def test_a_death_is_no_violation(victim: str, point: Point) -> None:
    """One agent dies at any point of its steps and comes back: what it says again, or newly, is as designed."""
    for step in STEPS:
        fleet = Fleet(seed=step)
        Tapped(fleet.wires)
        fleet.wires.crash(victim, point, in_steps=step)
        fleet.say("pour the jar into the bowl")
        fleet.finish()
        told(fleet)
        fleet.close()


@pytest.mark.parametrize("seed", range(16))
def test_faults_of_the_wire_are_no_violations(seed: int) -> None:
    """Loss, disorder and deaths of anybody: what is said is as designed, since the agents hold to it.

    The wire makes no copies here: one that the tap does not hear is answered, and that answer was never asked for.
    """
    fleet = Fleet(seed=seed)
    tapped = Tapped(fleet.wires)
    fleet.wires.faults = Faults(loss=0.05, delay=0.1, crash=0.002)
    fleet.say("pour the jar into the bowl")
    fleet.wires.run(fleet.ended, limit_s=3600.0)
    fleet.wires.faults = Faults()
    fleet.wires.run(fleet.at_rest, limit_s=300.0)
    late = {Verdict.LATE, Verdict.UNANSWERED}  # of a peer that was dead for too long: true ones
    wrong = [one for one in tapped.finished() if one.violation and one.verdict not in late]
    assert wrong == []
    fleet.close()
