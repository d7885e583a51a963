"""Every row of co's side of C1, C2 and C3, one after another."""

import msgspec
import pytest
from msgspec.structs import replace
from partners_of_co import (
    BUSY,
    SLIPS,
    UNREACHED,
    Scene,
    a_plan,
    a_plan_of,
    no_plan,
    refuse_plans,
)

from agent_runtime.testing.memory_bus import Point
from companion.design import AgentName
from companion.languages import cmd, hfsm
from companion.languages.facts import Kind, fact
from companion.languages.sw import FINAL, WorkerState
from companion.languages.values import Side
from companion.tasks.bring.command import Bring
from companion.tasks.clear_table.command import ClearTable
from companion.tasks.look_around.command import LookAround
from companion.tasks.pour.command import PourInto
from companion.tasks.put_down.command import PutDown
from companion.tasks.swap_hands.command import SwapHands
from companion.tasks.take.command import Take
from fipa_codec import languages
from fipa_codec.communicate import Communicate
from fipa_codec.languages import Reason
from fipa_codec.performatives import Performative as P
from services.coordinator import outgoing_messages
from services.coordinator.memory import Limits

NOT_LOCALIZED = fact(Kind.NOT_LOCALIZED, "bowl_1")


def told_in_log(scene, event="refused"):
    """Return a list to which sentences of peers and runtime are added as co logs them, in lines of
    this event.
    """
    logged = []
    scene.wires.on_step = lambda agent, effects: logged.extend(
        line.fields["why"] for line in effects.logs if agent == "co" and line.event == event
    )
    return logged


# --- the way through without trouble --------------------------------------------------------------


def test_a_command_is_agreed_planned_run_and_done(scene):
    """hi hears of each stage, and of the states of the plan."""
    name = scene.running()
    scene.ta(WorkerState.RUNNING, at=hfsm.Place(("main", "take")))
    scene.succeed()
    running = ["inform running"] * 3
    assert scene.said(name) == ["agree waiting", "inform planning", *running, "inform done"]
    places = [content.at and content.at.path for _, content in scene.heard("hi", name)]
    assert places == [None, None, None, ("end",), ("main", "take"), None]
    assert scene.at_rest()


def test_hi_is_told_the_planned_rest_and_what_the_hands_hold(scene):
    """Of the step that is under way, and of the whole plan before; hands as ta told last."""
    name = scene.command()
    steps = {"take": 60.0, "carry": 25.0}
    scene.pl(P.INFORM, a_plan_of(steps))
    hands = ({}, {Side.LEFT: "jar_1"}, {})
    for step, held in zip(steps, hands, strict=False):
        scene.ta(WorkerState.RUNNING, at=hfsm.Place((step,)), hands=held)
    scene.ta(WorkerState.SUCCEEDED, hands=hands[-1])
    told = [(content.rest, content.hands) for _, content in scene.heard("hi", name)]
    assert told[2:] == [
        (60.0, None), (0.0, None), (60.0, {}), (25.0, {Side.LEFT: "jar_1"}), (0.0, {}),
    ]  # fmt: skip


TASKS = {
    PourInto("jar", "bowl"): ("pour", "jar", "bowl"),
    Take("jar", "left"): ("take", "jar", "left"),
    Bring("jar", "right"): ("bring", "jar", "right"),
    SwapHands(): ("swap_hands", ""),
    PutDown("jar", "cabinet"): ("put_at", "jar", "cabinet"),
    PutDown("jar", cmd.BACK): ("put_at", "jar", "back"),
    ClearTable(): ("clear_table",),
    PutDown("bowl"): ("put_down", "bowl"),
    LookAround(): ("look_around",),
}


def test_a_command_becomes_its_ground_task():
    """pl gets the one task of the planning domain."""
    for command, (name, *arguments) in TASKS.items():
        scene = Scene()
        conversation = scene.command(command)
        (network,) = scene.requests("pl")
        assert network.tasks == (hfsm.Task(name, tuple(arguments)),)
        assert network.id.startswith(conversation)


def test_every_inform_of_ta_is_confirmed(scene):
    """As many confirms as reports, final ones included; also after a cancel."""
    name = scene.running()
    scene.ta(WorkerState.RUNNING, at=hfsm.Place(("main", "a")))
    scene.ta(WorkerState.ERROR, why=(SLIPS,))
    scene.cancel(name)
    scene.ta(WorkerState.TERMINATING)
    scene.ta(WorkerState.PREEMPTED)
    assert scene.acts("ta").count(P.CONFIRM) == 5
    assert scene.at_rest()


def test_the_plan_reaches_ta_with_its_reply_by(scene):
    """Five times the planned duration and 50 s from the handing over; the plan has no act."""
    scene.command()
    scene.plan(duration=100.0)
    messages = [one.communicate for one in scene.puppets["ta"].heard]
    (request,) = [one for one in messages if one.performative is P.REQUEST]
    assert request.reply_by == pytest.approx(request.sent + 550.0)


# --- running: ends --------------------------------------------------------------------------------


@pytest.mark.parametrize("state", [WorkerState.FAILED, WorkerState.PREEMPTED])
def test_a_plan_that_fails_fails_its_task_with_the_reason(scene, state):
    """hi gets ta's facts."""
    name = scene.running()
    scene.ta(state, why=(SLIPS,))
    scene.ended(name, "failure failed", why=(SLIPS,))


def test_a_refused_plan_fails_its_task():
    """ta refuses: hi failure."""
    scene = Scene(ta=refuse_plans)
    name = scene.running()
    scene.ended(name, "failure failed", why=(BUSY,))


def test_replan_asks_for_another_plan_of_the_same_task(scene):
    """Plan #1, Replan, plan #2: two requests to pl with the same task and different ids."""
    name = scene.running()
    scene.ta(WorkerState.REPLAN, why=(NOT_LOCALIZED,))
    (first, second) = scene.requests("pl")
    assert first.tasks == second.tasks
    assert first.id != second.id
    assert scene.last_why(name) == (fact(Kind.PLAN, 2, NOT_LOCALIZED),)
    scene.carry_out()
    scene.ended(name, "inform done")


@pytest.mark.parametrize("named", ["", "jar_1"])
def test_a_swap_means_the_same_thing_in_its_second_plan(scene, named):
    """Amid the swap it is in no hand: the first plan said which thing goes into which hand."""
    scene.command(SwapHands(named))
    plan = replace(a_plan(), holds={Side.RIGHT: "jar_1"})
    scene.pl(P.INFORM, plan)
    scene.ta(WorkerState.REPLAN, why=(fact(Kind.NOT_STRAIGHT, Side.RIGHT),))
    scene.pl(P.INFORM, plan)
    scene.ta(WorkerState.REPLAN, why=(SLIPS,))
    tasks = [content.tasks for act, content in scene.heard("pl") if act is P.REQUEST]
    again = (hfsm.Task("bring", ("jar_1", "right")),)
    assert tasks == [(hfsm.Task("swap_hands", (named,)),), again, again]


def test_replans_are_bounded():
    """After the last allowed one the task fails, with the reason of that."""
    scene = Scene(limits=Limits(replans=2))
    name = scene.running()
    for _ in range(2):
        scene.ta(WorkerState.REPLAN, why=(NOT_LOCALIZED,))
        scene.plan()
    scene.ta(WorkerState.REPLAN, why=(NOT_LOCALIZED,))
    scene.ended(name, "failure failed", why=(fact(Kind.GIVEN_UP, 3, NOT_LOCALIZED),))


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (no_plan(), UNREACHED),
        (hfsm.NoPlan("p", ()), fact(Kind.NO_REASON, AgentName.PL)),
        (Reason("the jar is out of reach"), fact(Kind.NO_REASON, AgentName.PL)),
    ],
)
@pytest.mark.parametrize("performative", [P.FAILURE, P.REFUSE])
def test_no_plan_fails_the_task_with_the_reason(scene, performative, content, why):
    """Refused or failed, told by pl in either language; a sentence is no reason, but stands in the
    log.
    """
    name, logged = scene.command(), told_in_log(scene)
    scene.pl(performative, content)
    assert (scene.said(name)[-1], scene.last_why(name)) == ("failure failed", (why,))
    assert logged == ([content.text] if isinstance(content, Reason) else [])
    assert scene.at_rest()


@pytest.mark.parametrize("content", [None, cmd.TaskReport(cmd.TaskState.DONE)])
def test_a_request_that_is_no_command_is_not_understood(scene, content):
    """Nothing, or a sentence of CMD that is not a command; the fleet serves on."""
    name = scene.command(content)
    assert scene.acts("hi", name) == [P.NOT_UNDERSTOOD]
    assert scene.serves()


# --- cancel in each phase -------------------------------------------------------------------------


def test_cancel_of_a_waiting_task_ends_it_at_once(scene):
    """Neither pl nor ta hears of it; the first task goes on."""
    first, second = scene.running(), scene.command()
    scene.cancel(second)
    assert scene.said(second) == ["agree waiting", "inform cancelled"]
    scene.succeed()
    assert scene.said(first)[-1] == "inform done"
    assert len(scene.requests("pl")) == 1
    assert scene.at_rest()


def test_cancel_while_planning_cancels_the_planning(scene):
    """hi hears cancelled when pl has said so."""
    name = scene.command()
    scene.cancel(name)
    assert scene.acts("pl") == [P.REQUEST, P.CANCEL]
    assert "inform cancelled" not in scene.said(name)
    scene.pl_stops()
    scene.ended(name, "inform cancelled")


@pytest.mark.parametrize(
    "crossing", [(P.INFORM, a_plan()), (P.FAILURE, no_plan()), (P.REFUSE, no_plan())]
)
def test_cancel_that_crosses_the_plan_ends_when_pl_answers_it(crossing):
    """The plan comes, then the failure in reply to the cancel: the plan is not run."""
    scene = Scene()
    name = scene.command()
    conversation = scene.asked("pl")
    scene.wires.post("hi", lambda turn: turn.say(name, P.CANCEL))
    scene.wires.post("pl", lambda turn: turn.say(conversation, *crossing))
    scene.settle()
    assert scene.said(name)[-1] == "inform cancelled"
    assert not scene.requests("ta")
    assert scene.at_rest()


@pytest.mark.parametrize("state", sorted(FINAL - {WorkerState.SUCCEEDED}))
def test_cancel_while_running_ends_as_cancelled_whatever_ta_ends_with(scene, state):
    """Preempted, Failed and Replan alike; no new plan is asked for."""
    name = scene.running()
    scene.cancel(name)
    assert scene.acts("ta")[-1] is P.CANCEL
    scene.ta(state, why=(SLIPS,))
    assert (scene.said(name)[-1], scene.last_why(name)) == ("inform cancelled", (SLIPS,))
    assert len(scene.requests("pl")) == 1
    assert scene.serves()


def test_cancel_that_comes_too_late_is_answered_behind_the_result(scene):
    """Succeeded after the cancel: done, then failure in reply to the cancel."""
    name = scene.running()
    scene.cancel(name)
    scene.succeed()
    scene.ended(name, "inform done", "failure reason")


def test_cancel_that_meets_ta_s_refuse_ends_as_cancelled():
    """The refuse answers the cancel."""
    scene = Scene(ta=refuse_plans)
    name = scene.command()
    pl = scene.asked("pl")
    scene.wires.post("pl", lambda turn: turn.say(pl, P.INFORM, a_plan()))
    scene.wires.post("hi", lambda turn: turn.say(name, P.CANCEL), 0.0005)
    scene.settle()
    scene.ended(name, "inform cancelled")


# --- T: reply-by passes ---------------------------------------------------------------------------


def test_a_late_planner_fails_the_task_and_is_cancelled(scene):
    """hi is told at once; a new command is refused until pl has had its last word, then one is
    served.
    """
    name = scene.command()
    scene.settle(61.0)
    assert scene.said(name)[-1] == "failure failed"
    assert scene.last_why(name) == (fact(Kind.NOT_ANSWERED, AgentName.PL),)
    assert scene.acts("pl") == [P.REQUEST, P.CANCEL]
    refused = scene.command()
    assert scene.said(refused) == ["refuse failed"]
    assert scene.last_why(refused) == (fact(Kind.NOT_ANSWERING, AgentName.PL),)
    scene.pl_stops()
    assert scene.serves()


def test_a_late_plan_is_not_run(scene):
    """It crosses the cancel; pl then answers that."""
    scene.command()
    scene.settle(60.0011 - 0.05)
    scene.plan()
    scene.settle(1.0)
    assert scene.memory.loose == ()
    assert not scene.requests("ta")
    assert scene.at_rest()


def test_late_while_running_fails_the_task_and_awaits_the_last_word(scene):
    """running, T: cancel to ta, failure(late) to hi; the final inform is confirmed."""
    name = scene.running()
    scene.settle(551.0)
    assert scene.said(name)[-1] == "failure failed"
    assert scene.acts("ta")[-1] is P.CANCEL
    scene.ta(WorkerState.RUNNING, at=hfsm.Place(("main", "put_down")))
    scene.ta(WorkerState.PREEMPTED)
    assert scene.acts("ta")[-1] is P.CONFIRM
    assert scene.serves()


@pytest.mark.parametrize("running", [True, False])
def test_late_while_cancelling_answers_the_cancel_too(scene, running):
    """cancelling, T: failure(late), then failure in reply to the cancel; the same towards pl."""
    name = scene.running() if running else scene.command()
    scene.cancel(name)
    scene.settle(241.0 if running else 11.0)
    assert scene.said(name)[-2:] == ["failure failed", "failure reason"]
    assert scene.memory.loose
    if running:
        scene.ta(WorkerState.PREEMPTED)
    else:
        scene.pl(P.FAILURE, no_plan(), kind=languages.Kind.CANCEL)
    assert scene.at_rest()


def test_waiting_tasks_do_not_wait_for_ever_for_a_robot_that_is_late(scene):
    """They go on when it comes back in time, and fail with the reason when it does not."""
    scene.running()
    waiting = scene.command()
    scene.settle(551.0)
    assert scene.said(waiting) == ["agree waiting"]
    scene.settle(61.0)
    assert scene.said(waiting)[-1] == "failure failed"
    silent = fact(Kind.NOT_ANSWERING, AgentName.TA)
    assert scene.last_why(waiting) == (fact(Kind.SAY_AGAIN_LATER, silent),)


def test_waiting_tasks_go_on_when_the_late_robot_is_back_in_time(scene):
    """The last word of ta lets co ask for the plan of the next task."""
    scene.running()
    waiting = scene.command()
    scene.settle(551.0)
    scene.ta(WorkerState.PREEMPTED)
    scene.carry_out()
    scene.settle(100.0)
    scene.ended(waiting, "inform done")


# --- more than one task ---------------------------------------------------------------------------


def test_two_tasks_are_done_one_after_the_other_in_order_of_arrival(scene):
    """The second is planned after the first has ended, since the world is another one then."""
    first = scene.command(Take("jar"))
    second = scene.command(PutDown("jar"))
    scene.plan()
    assert len(scene.requests("pl")) == 1
    scene.succeed()
    assert scene.said(first)[-1] == "inform done"
    assert [content.tasks[0].name for _, content in scene.heard("pl")] == ["take", "put_down"]
    scene.carry_out()
    scene.ended(second, "inform done")


def test_a_queue_that_is_full_refuses(scene):
    """The bound keeps the outbox to a dead hi from filling."""
    names = [scene.command() for _ in range(6)]
    assert [scene.said(name)[0] for name in names] == ["agree waiting"] * 5 + ["refuse failed"]
    assert scene.last_why(names[-1]) == (fact(Kind.TASKS_OPEN, 5),)


def test_each_task_of_a_full_queue_hears_how_many_come_before_it(scene):
    """With as many of them as there is room for in a report."""
    names = [scene.command(PourInto(f"{'jar' * 10}_{number}", "bowl_1")) for number in range(5)]
    places = [scene.agreed(name) for name in names]
    assert places[0] == (fact(Kind.IS_NEXT),)
    for before, (place,) in enumerate(places[1:], 1):
        assert (place.kind, place.numbers) == (Kind.TASKS_BEFORE, (before,))
        assert {one.kind for one in place.because} == {Kind.COMES_BEFORE}
        assert len(msgspec.msgpack.encode((place,))) <= outgoing_messages.MOST_BYTES
    assert [len(place.because) for (place,) in places[1:3]] == [1, 2]


# --- peers that slip ------------------------------------------------------------------------------


@pytest.mark.parametrize("peer", ["pl", "ta"])
def test_what_a_peer_says_out_of_sequence_fails_the_task_only(scene, peer):
    """The peer is told not-understood, hi a failure, and the next command is served; the log says
    what was wrong.
    """
    name = scene.running() if peer == "ta" else scene.command()
    logged = told_in_log(scene, "broken")
    protocol, conversation = {"pl": "request", "ta": "coordinate"}[peer], scene.asked(peer)

    def slip(turn):
        state = turn._state
        number = state.issued.get("co", 0) + 1
        state.issued["co"] = number
        del state.conversations[conversation]
        ends = {"conversation": conversation, "sender": peer, "receiver": "co"}
        bad = Communicate(performative=P.PROPOSE, protocol=protocol, id=str(number), **ends)
        turn._out.sends.append(bad)

    scene.do(peer, slip)
    assert scene.said(name)[-1] == "failure failed"
    assert ["propose" in why for why in logged] == [True]
    assert scene.memory.jobs == ()
    assert scene.serves()


@pytest.mark.parametrize("peer", ["pl", "ta"])
def test_not_understood_of_a_peer_fails_the_task(scene, peer):
    """pl or ta did not understand the request; its words stand in the log."""
    name, logged = scene.running() if peer == "ta" else scene.command(), told_in_log(scene)
    talk, why = scene.asked(peer), Reason("no such task")
    scene.do(peer, lambda turn: turn.say(talk, P.NOT_UNDERSTOOD, why))
    scene_why = (fact(Kind.NOT_UNDERSTOOD, peer),)
    assert (scene.said(name)[-1], scene.last_why(name)) == ("failure failed", scene_why)
    assert logged == ["no such task"]
    assert scene.at_rest()


def test_hi_that_understands_nothing_more_has_its_task_cancelled(scene):
    """There is nobody to be told, but the robot stops."""
    name = scene.running()
    scene.do("hi", lambda turn: turn.say(name, P.NOT_UNDERSTOOD, Reason("what?")))
    assert scene.acts("ta")[-1] is P.CANCEL
    scene.ta(WorkerState.PREEMPTED)
    assert scene.at_rest()


def test_a_dead_hi_gets_no_progress_but_its_result(scene):
    """Progress would fill the outbox; the result waits there for hi."""
    name = scene.running()
    scene.wires.crash("hi", Point.BEFORE, restart_s=50.0)
    scene.do("hi", lambda turn: None)
    for number in range(40):
        scene.ta(WorkerState.RUNNING, at=hfsm.Place(("main", f"{number}")))
    scene.succeed()
    scene.settle(60.0)
    assert scene.said(name)[-1] == "inform done"
    assert len(scene.said(name)) < 10
    assert scene.at_rest()


# --- the world is still being looked at -----------------------------------------------------------


def still_looking(scene):
    """Pl puts a plan off."""
    scene.pl(P.FAILURE, hfsm.NoPlan("p", (fact(Kind.LOOK_NOT_OVER),), later=True))


def test_a_plan_that_is_put_off_is_asked_for_again(scene):
    """The same plan; hi is told once what is waited for, and no plan is counted."""
    name = scene.command()
    for _ in range(3):
        still_looking(scene)
    asked = [content.id for act, content in scene.heard("pl") if act is P.REQUEST]
    assert len(asked) == 4
    assert len(set(asked)) == 1
    whys = [content.why for _, content in scene.heard("hi", name)][1:]
    assert whys == [(fact(Kind.PLAN, 1),), (fact(Kind.PLAN, 1, fact(Kind.LOOKS_FIRST)),)]
    scene.carry_out()
    scene.ended(name, "inform done")


def test_a_plan_is_not_put_off_for_ever():
    """After that many times the task fails with the planner's reason."""
    scene = Scene(limits=Limits(looks=2))
    name = scene.command()
    for _ in range(3):
        still_looking(scene)
    scene.ended(name, "failure failed", why=(fact(Kind.LOOK_NOT_OVER),))


def test_a_cancel_while_a_plan_is_put_off():
    """What pl says crosses the cancel, whose answer ends the task."""
    scene = Scene(pl=lambda turn, received: None)
    name = scene.command()
    still_looking(scene)
    scene.cancel(name)
    scene.pl_stops()
    scene.ended(name, "inform cancelled")


def test_a_plan_that_was_handed_over_is_not_kept(scene):
    """It would be in every record of co; and what hi was told of an earlier plan is not said of the
    next.
    """
    name = scene.running()
    assert scene.memory.first.plan is None
    scene.ta(WorkerState.RUNNING, at=hfsm.Place(("main", "take")))
    moved = fact(Kind.MOVED, "jar_1", 0.1)
    scene.ta(WorkerState.REPLAN, why=(moved,))
    assert scene.last_why(name) == (fact(Kind.PLAN, 2, moved),)
    scene.plan()
    scene.ta(WorkerState.RUNNING, why=(moved,))
    assert scene.last_why(name) == (moved,)
