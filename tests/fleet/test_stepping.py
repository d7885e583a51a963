"""An operator lets a plan go on act by act: at each level of autonomy, through deaths, cancels and
long waits.
"""

import pytest
from pretended_fleet import NAMES, Fleet

from agent_runtime.core.control import SetParameter
from companion.autonomy import STEP, WAIT_S, Level, Verb
from companion.languages.cmd import TaskState
from companion.languages.facts import Kind, fact
from services.human_interface.device_messages import Sentence
from services.human_interface.grammar import understand


def acts(fleet):
    """Number of motions the robot has begun."""
    return len(fleet.world.begun)


def test_the_levels_ask_for_no_act_for_those_that_handle_things_and_for_all():
    """Each act waits once, in the order of the plan, and the robot stands while one waits."""
    found = {}
    for level in Level:
        with Fleet(seed=1) as fleet:
            found[level] = fleet.begin(level).step_through()
            assert fleet.finish() == ["done"]
            assert fleet.world.poured == 1
    assert found[Level.AUTO] == []
    verbs = {leaf: leaf.split("/")[-1].split()[0] for leaf in found[Level.CONFIRM]}
    handling = [leaf for leaf, verb in verbs.items() if verb in ("grasp", "release", "pour")]
    assert found[Level.HANDLING] == handling
    assert 0 < len(found[Level.HANDLING]) < len(verbs) == len(found[Level.CONFIRM])


def test_nothing_moves_while_an_act_waits(fleet):
    """Nor does any time limit of the plan run out: just before the wait is over, the plan still
    goes on.
    """
    fleet.begin(Level.CONFIRM)
    for _ in range(3):
        fleet.until(lambda: fleet.waiting)
        before, leaf = acts(fleet), fleet.waits_for
        fleet.wires.run_for(WAIT_S - 5.0)
        assert (acts(fleet), fleet.waits_for) == (before, leaf)
        fleet.order(Verb.GO)
        fleet.until(lambda before=before: acts(fleet) > before)
        assert (fleet.tasks[0].at.id, fleet.waits_for) == (leaf, "")
    fleet.set_level(Level.AUTO)
    assert fleet.finish() == ["done"]


def test_who_does_not_come_ends_the_plan_and_moves_nothing(fleet):
    """The task has failed, says so and what is held; the next one is served."""
    fleet.begin(Level.HANDLING).let_go()  # the jar is grasped
    fleet.until(lambda: fleet.waiting)
    before = acts(fleet)
    assert fleet.finish(limit_s=WAIT_S + 60.0) == ["failed"]
    assert acts(fleet) == before
    assert fleet.why() == (fact(Kind.NOBODY_CAME, WAIT_S / 60.0), fact(Kind.HOLDING, "jar_1"))
    fleet.set_level(Level.AUTO)
    fleet.say("look around")
    assert fleet.finish(2)[-1] == "done"


@pytest.mark.parametrize("victim", NAMES)
def test_a_wait_outlives_the_death_of_anybody(victim):
    """The leaf still waits, is seen to wait, and goes on when the operator says so."""
    leaves = []
    with Fleet(seed=2) as fleet:
        fleet.begin(Level.HANDLING)
        fleet.until(lambda: fleet.waiting)
        while fleet.waiting:
            before = (fleet.waits_for, acts(fleet))
            fleet.wires.kill(victim)
            fleet.wires.run_for(5.0)
            assert fleet.waiting
            assert (fleet.waits_for, acts(fleet)) == before
            leaves.append(fleet.let_go())
            fleet.until(lambda: fleet.ended() or fleet.waiting)
        assert fleet.finish() == ["done"]
    assert len(leaves) == len(set(leaves)) > 2


def test_a_wait_begins_while_hi_is_down(fleet):
    """It is told all the same: nothing goes on before somebody has read it."""
    fleet.begin(Level.HANDLING)
    fleet.until(lambda: fleet.state("ta") == "running")
    fleet.wires.kill("hi", restart_s=60.0)
    fleet.until(lambda: fleet.state("ta") == "waiting")
    fleet.wires.run_for(90.0)
    assert fleet.waits_for


@pytest.mark.parametrize("step", range(6))
def test_a_cancel_while_an_act_waits(step):
    """The held object is put down, which waits for nobody; the next command is served."""
    with Fleet(seed=3) as fleet:
        fleet.begin(Level.HANDLING)
        for _ in range(step):
            fleet.let_go()
        fleet.until(lambda: fleet.waiting or fleet.ended())
        if not fleet.ended():
            fleet.cancel()
            assert fleet.finish() == ["cancelled"]
            assert not fleet.held
        fleet.set_level(Level.AUTO)
        fleet.say()
        assert fleet.finish(2)[-1] == "done"


def test_a_cancel_while_the_first_act_waits_puts_down_what_an_earlier_task_holds(fleet):
    """Though no state of this plan has been active."""
    assert fleet.begin(Level.AUTO).finish() == ["done"]
    assert fleet.held
    fleet.set_level(Level.CONFIRM)
    fleet.say()
    fleet.until(lambda: fleet.waiting)
    fleet.cancel()
    assert fleet.finish(2)[-1] == "cancelled"
    assert not fleet.held


def test_a_plan_that_waits_is_left_for_a_more_urgent_task(fleet):
    """And resumed afterwards, with a plan whose acts wait again."""
    fleet.begin(Level.HANDLING)
    fleet.until(lambda: fleet.waiting)
    fleet.wires.post("hi", Sentence("urgent", "look around", understand("look around"), urgency=1))
    fleet.until(lambda: fleet.tasks[-1].state == TaskState.DONE)
    assert [task.state for task in fleet.tasks if task.said != "look around"] != [TaskState.DONE]
    assert fleet.step_through()
    assert fleet.finish(2) == ["done", "done"]


def test_an_order_about_another_act_changes_nothing(fleet):
    """It came late, or twice: the act after it has not been looked at by anybody."""
    first = fleet.begin(Level.CONFIRM).let_go()
    fleet.until(lambda: fleet.waiting and fleet.waits_for != first)
    second, before = fleet.waits_for, acts(fleet)
    for verb in Verb:
        fleet.order(verb, first)
    fleet.wires.order("ta", SetParameter(STEP, "go"))
    fleet.wires.run_for(30.0)
    assert (fleet.waits_for, acts(fleet)) == (second, before)


def test_a_new_plan_instead_of_the_act_that_waits(fleet):
    """The act is not begun; the task goes on with another plan, whose first act is asked about
    again.
    """
    fleet.begin(Level.CONFIRM)
    fleet.until(lambda: fleet.waiting)
    before = acts(fleet)
    fleet.order(Verb.REPLAN)
    fleet.until(lambda: not fleet.waits_for)
    fleet.until(lambda: fleet.waiting)
    assert acts(fleet) == before
    assert fleet.reports() == ["Replan"]
    assert fleet.tasks[0].state == TaskState.RUNNING
    fleet.set_level(Level.AUTO)
    assert fleet.finish() == ["done"]


def test_a_new_plan_instead_of_the_act_under_way(fleet):
    """The act is ended safely before the plan is left, and nothing of it is begun again."""
    fleet.begin(Level.AUTO)
    fleet.until(lambda: fleet.state("ex") == "acting" and fleet.tasks[0].at is not None)
    fleet.order(Verb.REPLAN, fleet.tasks[0].at.id)
    fleet.until(fleet.reports)
    assert fleet.reports() == ["Replan"]
    assert fleet.state("ex") == "idle"
    assert fleet.finish() == ["done"]
