"""compSP: pl is asked for the schedule parameters of all tasks that wait, and `costs` decides with
them.
"""

import pytest
from msgspec.structs import replace
from partners_of_co import POUR, a_plan, no_plan, stop_planning

from agent_runtime.core.step import OUTSIDE
from agent_runtime.testing.memory_bus import Point
from companion.languages import hfsm, sw
from companion.languages.facts import Kind, fact
from companion.languages.sw import WorkerState
from companion.tasks.look_around.command import LookAround
from companion.tasks.put_down.command import PutDown
from companion.tasks.take.command import Take
from fipa_codec.performatives import Performative as P
from services.coordinator.memory import Stage

LOOK = LookAround()


def stages(scene):
    """The tasks of co in their order, by class and stage."""
    return [(type(job.command).__name__, job.stage) for job in scene.memory.jobs]


def told(scene, task):
    """The facts of all that hi was told of a task."""
    return [content.why for _, content in scene.heard("hi", task)]


@pytest.fixture(autouse=True)
def all_steps_are_rows(scene):
    """Check after each test that co did only what its rows say."""
    yield
    assert OUTSIDE not in scene.co.state.counts


def test_pl_is_asked_for_the_parameters_of_all_that_wait(scene):
    """One after the other while the first one runs, each once; none of them is begun."""
    scene.running(POUR)
    scene.command(LOOK)
    scene.command(Take("box"))
    for _ in range(2):
        scene.plan(90.0)
    asked = [content.tasks[0].name for act, content in scene.heard("pl") if act is P.REQUEST]
    assert asked == ["pour", "look_around", "take"]
    assert all(job.schedule for job in scene.memory.jobs)
    assert len(scene.requests("ta")) == 1


def test_what_comes_after_another_task_is_not_asked_about(scene):
    """Its plan would be one for a world that is not there yet: nothing is in the hand."""
    scene.running(Take("jar"))
    scene.command(PutDown("jar"))
    assert len(scene.requests("pl")) == 1


def test_a_task_that_costs_less_to_do_first_replaces_the_running_one(scene):
    """A look of 5 s and a pour of 100 s that nothing is held for: both hear why; the pour is
    planned again and done.
    """
    scene.puppets["pl"].answer = stop_planning
    pour = scene.running(POUR)
    look = scene.command(LOOK)
    scene.plan(5.0)
    assert scene.acts("ta")[-1] is P.CANCEL
    decision = scene.memory.decision
    assert (decision.task, decision.why.kind) == (look, Kind.SWITCH_COSTS)
    assert scene.last_why(pour) == (fact(Kind.LEFT_FOR, "look_around", decision.why),)
    scene.ta(WorkerState.PREEMPTED)
    scene.carry_out(5.0)
    assert scene.said(look)[-1] == "inform done"
    scene.carry_out()
    scene.ended(pour, "inform done")


def test_where_leaving_costs_too_much_the_running_task_goes_on_and_the_other_one_hears_why(scene):
    """The jar would have to be put down and taken again: 40 s for a look of 5 s."""
    scene.command(POUR)
    scene.plan(60.0, suspend=20.0, resume=20.0)
    look = scene.command(LOOK)
    scene.plan(5.0)
    assert P.CANCEL not in scene.acts("ta")
    decision = scene.memory.decision
    assert decision.why.kind is Kind.WAIT_COSTS
    assert scene.last_why(look) == (fact(Kind.GOES_ON, "pour", "jar", "bowl", decision.why),)
    assert (decision.switch, decision.rival) == (False, look)
    assert decision.switch_cost >= 0.9 * decision.wait_cost > 0.0


def test_a_decision_is_made_once_with_the_same_parameters(scene):
    """The person is not told at every report of ta."""
    scene.command(POUR)
    scene.plan(60.0, suspend=20.0, resume=20.0)
    look = scene.command(LOOK)
    scene.plan(5.0)
    before = len(told(scene, look))
    for number in range(5):
        scene.ta(WorkerState.RUNNING, at=hfsm.Place(("end", f"{number}")))
    assert len(told(scene, look)) == before


@pytest.mark.parametrize("answer", [P.FAILURE, P.REFUSE])
def test_a_task_without_parameters_waits_for_its_turn(scene, answer):
    """A task that cannot be planned now may be when its turn comes."""
    pour, look = scene.running(POUR), scene.command(LOOK)
    scene.pl(answer, no_plan())
    assert scene.said(look) == ["agree waiting"]
    scene.succeed()
    scene.carry_out(5.0)
    assert [scene.said(task)[-1] for task in (pour, look)] == ["inform done"] * 2
    assert scene.at_rest()


def test_a_question_under_way_is_called_off_when_a_plan_is_wanted(scene):
    """The world is another one then; the plan is asked for when pl has answered that."""
    scene.running(POUR)
    look = scene.command(LOOK)
    scene.succeed()
    assert scene.acts("pl") == [P.REQUEST, P.REQUEST, P.CANCEL]
    scene.pl_stops()
    assert len(scene.requests("pl")) == 3
    assert stages(scene) == [("LookAround", Stage.PLANNING)]
    scene.carry_out(5.0)
    scene.ended(look, "inform done")


def test_parameters_that_cross_the_recall_are_not_taken(scene):
    """They were worked out for the world before; the plan is asked for once more."""
    scene.running(POUR)
    scene.command(LOOK)
    question, run = scene.asked("pl"), scene.asked("ta")
    scene.wires.post("ta", lambda turn: turn.say(run, P.INFORM, sw.Report(WorkerState.SUCCEEDED)))
    scene.wires.post("pl", lambda turn: turn.say(question, P.INFORM, a_plan()))
    scene.settle()
    assert len(scene.requests("pl")) == 3
    (job,) = scene.memory.jobs
    assert (job.stage, job.schedule) == (Stage.PLANNING, ())


@pytest.mark.parametrize("recalled", [False, True])
def test_a_waiting_task_is_cancelled_while_pl_is_asked_about_it(scene, recalled):
    """It ends when pl has answered, with one cancel to pl."""
    scene.running(POUR)
    look = scene.command(LOOK)
    if recalled:
        scene.succeed()
    scene.cancel(look)
    assert scene.acts("pl").count(P.CANCEL) == 1
    scene.pl_stops()
    assert scene.said(look)[-1] == "inform cancelled"
    if not recalled:
        scene.succeed()
    assert scene.at_rest()


def test_a_planner_that_is_late_about_parameters_does_not_end_the_task_that_runs(scene):
    """The question is called off; where that is not answered either, the task that waits ends."""
    pour, look = scene.running(POUR), scene.command(LOOK)
    scene.settle(61.0)
    assert scene.acts("pl")[-1] is P.CANCEL
    assert scene.said(look) == ["agree waiting"]
    scene.settle(11.0)
    assert scene.said(look)[-1] == "failure failed"
    scene.settle(61.0)
    scene.succeed()
    assert scene.said(pour)[-1] == "inform done"


def test_the_order_of_those_that_wait_is_by_costs_once_all_are_known(scene):
    """Two looks of 60 s and 5 s: the short one is next though it came last, and hears why."""
    scene.puppets["pl"].answer = stop_planning
    scene.command(Take("jar"))
    scene.plan(20.0, suspend=500.0)
    long, short = scene.command(Take("box")), scene.command(LOOK)
    scene.plan(60.0)
    scene.carry_out(5.0)
    assert stages(scene) == [("LookAround", Stage.PLANNING), ("Take", Stage.WAITING)]
    assert scene.last_why(short) == (fact(Kind.PLAN, 1, fact(Kind.COSTS_LEAST)),)
    assert scene.said(long)[-1] in ("agree waiting", "inform waiting")


def test_a_later_leg_of_the_plan_has_its_own_parameters(scene):
    """A later leg has less work left, and leaving it costs as much as the things held then."""
    name = scene.command(POUR)
    pour = hfsm.ScheduleParameters("pour jar_1", 20.0, 16.0, 12.0)
    legs = (hfsm.ScheduleParameters("take jar_1", 60.0), pour)
    state = hfsm.EndState("take jar_1", hfsm.Outcome.SUCCEEDED)
    main = hfsm.Machine("main", "take jar_1", (state,))
    plan = hfsm.HierarchicalPlan("p", "pour", main, 60.0, 1, legs)
    scene.pl(P.INFORM, plan)
    job = scene.memory.of_hi(name)
    assert job.parameters == legs[0]
    scene.ta(WorkerState.RUNNING, at=hfsm.Place(("pour jar_1", "move-joint")))
    assert scene.memory.of_hi(name).parameters == legs[1]


# --- times to start -------------------------------------------------------------------------------


def at(scene, seconds, task=LOOK):
    """A task that may begin in that many seconds."""
    return replace(task, start=scene.wires.now + seconds)


def test_a_task_that_begins_later_keeps_nobody_waiting(scene):
    """It is told when it begins; what comes meanwhile is done, and it is planned when its time has
    come.
    """
    later = scene.command(at(scene, 300.0, Take("jar", urgency=1)))
    (((begins,),),) = [told(scene, later)]
    assert begins.kind is Kind.BEGINS_IN
    assert begins.numbers == pytest.approx((300.0,), abs=0.1)
    assert not scene.requests("pl")
    first = scene.running(Take("jar"))
    assert P.CANCEL not in scene.acts("ta")
    scene.succeed()
    assert scene.said(first)[-1] == "inform done"
    scene.settle(301.0)
    assert len(scene.requests("pl")) == 2
    scene.carry_out()
    scene.ended(later, "inform done")


def test_a_more_urgent_task_interrupts_when_its_time_has_come(scene):
    """Not before."""
    scene.command(at(scene, 20.0, LookAround(urgency=1)))
    scene.running(POUR)
    scene.settle(15.0)
    assert P.CANCEL not in scene.acts("ta")
    scene.settle(10.0)
    assert scene.acts("ta")[-1] is P.CANCEL


def test_a_task_is_cancelled_before_its_time(scene):
    """Nothing comes of it then."""
    later = scene.command(at(scene, 20.0))
    scene.cancel(later)
    assert scene.said(later)[-1] == "inform cancelled"
    scene.settle(30.0)
    assert not scene.requests("pl")
    assert scene.at_rest()


def test_the_time_to_start_comes_though_co_died_meanwhile(scene):
    """It is in the journal."""
    scene.command(at(scene, 20.0))
    scene.wires.crash("co", Point.BEFORE, restart_s=30.0)
    scene.do("co", lambda turn: None)
    scene.settle(40.0)
    assert len(scene.requests("pl")) == 1


def test_tasks_that_begin_together_keep_their_order(scene):
    """Take it, put it down: said in one sentence for later."""
    start = scene.wires.now + 30.0
    for task in (Take("jar"), PutDown("jar")):
        scene.command(replace(task, start=start))
    scene.settle(60.0)
    assert [kind for kind, _ in stages(scene)] == ["Take", "PutDown"]
