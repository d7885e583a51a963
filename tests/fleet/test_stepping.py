"""An operator lets a plan go on act by act: at each level of autonomy, through deaths, cancels and long waits."""

import pytest
from pretended_fleet import NAMES, Fleet
from pretended_operator import POUR, asked, begun, say, set_level, stepped, waiting

from agent_runtime.core.control import SetParameter
from agent_runtime.core.step import OUTSIDE
from companion.autonomy import STEP, WAIT_S, Level, Verb
from companion.languages.cmd import TaskState
from companion.languages.facts import Kind, fact
from services.human_interface.grammar import understand
from services.human_interface.local import Said


def acts(fleet: Fleet) -> int:
    """Return the number of motions the robot has begun."""
    return len(fleet.world.begun)


def within_design(fleet: Fleet) -> bool:
    """Whether each step of all agents was one of the design's: what was proven holds for them."""
    return not any(fleet.wires.nodes[name].state.counts.get(OUTSIDE) for name in NAMES)


def test_the_levels_ask_for_no_act_for_those_that_handle_things_and_for_all() -> None:
    """Each act waits once, in the order of the plan, and the robot stands while one waits."""
    found = {}
    for level in Level:
        one = Fleet(seed=1)
        found[level] = stepped(begun(one, level))
        assert one.finish() == ["done"]
        assert one.world.poured == 1
        assert within_design(one)
        one.close()
    assert found[Level.AUTO] == []
    verbs = {leaf: leaf.split("/")[-1].split()[0] for leaf in found[Level.CONFIRM]}
    assert found[Level.HANDLING] == [leaf for leaf, verb in verbs.items() if verb in ("grasp", "release", "pour")]
    assert 0 < len(found[Level.HANDLING]) < len(verbs) == len(found[Level.CONFIRM])


def test_nothing_moves_while_an_act_waits(fleet) -> None:
    """Nor does any time limit of the plan run out: just before the wait is over, the plan still goes on."""
    begun(fleet, Level.CONFIRM)
    for _ in range(3):
        fleet.wires.run(lambda: waiting(fleet))
        before, leaf = acts(fleet), asked(fleet)
        fleet.wires.run_for(WAIT_S - 5.0)
        assert (acts(fleet), asked(fleet)) == (before, leaf)
        say(fleet, Verb.GO)
        fleet.wires.run(lambda before=before: acts(fleet) > before)
        assert (fleet.tasks[0].at.id, asked(fleet)) == (leaf, "")
    set_level(fleet, Level.AUTO)
    assert fleet.finish() == ["done"]
    assert within_design(fleet)


def test_who_does_not_come_ends_the_plan_and_moves_nothing(fleet) -> None:
    """The task has failed, says so and what is held; the next one is served."""
    begun(fleet, Level.HANDLING)
    fleet.wires.run(lambda: waiting(fleet))
    say(fleet, Verb.GO)  # the jar is grasped
    fleet.wires.run(lambda: not asked(fleet))
    fleet.wires.run(lambda: waiting(fleet))
    before = acts(fleet)
    assert fleet.finish(limit_s=WAIT_S + 60.0) == ["failed"]
    assert acts(fleet) == before
    assert fleet.tasks[0].why == (fact(Kind.NOBODY_CAME, WAIT_S / 60.0), fact(Kind.HOLDING, "jar_1"))
    set_level(fleet, Level.AUTO)
    fleet.say("look around")
    assert fleet.finish(2)[-1] == "done"
    assert within_design(fleet)


@pytest.mark.parametrize("victim", NAMES)
def test_a_wait_outlives_the_death_of_anybody(victim: str) -> None:
    """The leaf still waits, is seen to wait, and goes on at a word; no act is begun twice."""
    fleet = begun(Fleet(seed=2), Level.HANDLING)
    leaves = []
    while not fleet.ended():
        fleet.wires.run(lambda: fleet.ended() or waiting(fleet))
        if fleet.ended():
            break
        leaves.append(asked(fleet))
        before = acts(fleet)
        fleet.wires.kill(victim)
        fleet.wires.run_for(5.0)
        assert waiting(fleet)
        assert (asked(fleet), acts(fleet)) == (leaves[-1], before)
        say(fleet, Verb.GO)
        fleet.wires.run(lambda before=leaves[-1]: asked(fleet) != before)
    assert fleet.finish() == ["done"]
    assert len(leaves) == len(set(leaves))
    assert within_design(fleet)
    fleet.close()


def test_a_wait_begins_while_hi_is_down(fleet) -> None:
    """It is told all the same: nothing goes on before somebody has read it."""
    begun(fleet, Level.HANDLING)
    fleet.wires.run(lambda: fleet.wires.nodes["ta"].state.state == "running")
    fleet.wires.kill("hi", restart_s=60.0)
    fleet.wires.run(lambda: fleet.wires.nodes["ta"].state.state == "waiting")
    fleet.wires.run_for(90.0)
    assert asked(fleet)


@pytest.mark.parametrize("step", range(6))
def test_a_cancel_while_an_act_waits(step: int) -> None:
    """The held thing is put down, which waits for nobody; the next command is served."""
    fleet = begun(Fleet(seed=3), Level.HANDLING)
    for _ in range(step):
        fleet.wires.run(lambda: waiting(fleet) or fleet.ended())
        leaf = asked(fleet)
        say(fleet, Verb.GO)
        fleet.wires.run(lambda leaf=leaf: asked(fleet) != leaf or fleet.ended())
    fleet.wires.run(lambda: waiting(fleet) or fleet.ended())
    if not fleet.ended():
        fleet.cancel()
        assert fleet.finish() == ["cancelled"]
        assert not fleet.wires.memory("ex").remembered.held
    set_level(fleet, Level.AUTO)
    fleet.say(POUR)
    assert fleet.finish(2)[-1] == "done"
    assert within_design(fleet)
    fleet.close()


def test_a_cancel_while_the_first_act_waits_puts_down_what_an_earlier_task_holds(fleet) -> None:
    """Though no state of this plan has been active."""
    assert begun(fleet, Level.AUTO).finish() == ["done"]
    assert fleet.wires.memory("ex").remembered.held
    set_level(fleet, Level.CONFIRM)
    fleet.say(POUR)
    fleet.wires.run(lambda: waiting(fleet))
    fleet.cancel()
    assert fleet.finish(2)[-1] == "cancelled"
    assert not fleet.wires.memory("ex").remembered.held


def test_a_plan_that_waits_is_left_for_a_more_urgent_task(fleet) -> None:
    """And resumed afterwards, with a plan whose acts wait again."""
    begun(fleet, Level.HANDLING)
    fleet.wires.run(lambda: waiting(fleet))
    fleet.wires.post("hi", Said("urgent", "look around", understand("look around"), urgency=1))
    fleet.wires.run(lambda: fleet.tasks[-1].state == TaskState.DONE)
    assert [task.state for task in fleet.tasks if task.said != "look around"] != [TaskState.DONE]
    assert stepped(fleet, ended=2)
    assert fleet.finish(2) == ["done", "done"]
    assert within_design(fleet)


def test_a_word_about_another_leaf_changes_nothing(fleet) -> None:
    """It came late, or twice: the leaf after it has not been looked at by anybody."""
    begun(fleet, Level.CONFIRM)
    fleet.wires.run(lambda: waiting(fleet))
    first = asked(fleet)
    say(fleet, Verb.GO)
    fleet.wires.run(lambda: waiting(fleet) and asked(fleet) != first)
    second, before = asked(fleet), acts(fleet)
    for verb in Verb:
        say(fleet, verb, first)
    fleet.wires.order("ta", SetParameter(STEP, "go"))
    fleet.wires.run_for(30.0)
    assert (asked(fleet), acts(fleet)) == (second, before)


def test_a_new_plan_instead_of_the_act_that_waits(fleet) -> None:
    """The act is not begun; the task goes on with another plan, whose first act is asked about again."""
    begun(fleet, Level.CONFIRM)
    fleet.wires.run(lambda: waiting(fleet))
    before = acts(fleet)
    say(fleet, Verb.REPLAN)
    fleet.wires.run(lambda: not asked(fleet))
    fleet.wires.run(lambda: waiting(fleet))
    assert acts(fleet) == before
    assert fleet.reports() == ["Replan"]
    assert fleet.tasks[0].state == TaskState.RUNNING
    set_level(fleet, Level.AUTO)
    assert fleet.finish() == ["done"]
    assert within_design(fleet)


def test_a_new_plan_instead_of_the_act_under_way(fleet) -> None:
    """The act is ended safely before the plan is left, and nothing of it is begun again."""
    begun(fleet, Level.AUTO)
    fleet.wires.run(lambda: fleet.wires.nodes["ex"].state.state == "acting" and fleet.tasks[0].at is not None)
    say(fleet, Verb.REPLAN, fleet.tasks[0].at.id)
    fleet.wires.run(lambda: bool(fleet.reports()))
    assert fleet.reports() == ["Replan"]
    assert fleet.wires.nodes["ex"].state.state == "idle"
    assert fleet.finish() == ["done"]
    assert within_design(fleet)
