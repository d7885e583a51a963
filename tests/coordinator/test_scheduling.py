"""The scheduler's rules, and the queue of co that comes of them."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace
from partners_of_co import Scene

from companion.autonomy import WAIT_S
from companion.languages.facts import Kind, fact
from companion.languages.hfsm import PUT_DOWN_S, ScheduleParameters
from companion.languages.sw import WorkerState
from companion.tasks.clear_table.command import ClearTable
from companion.tasks.look_around.command import LookAround
from companion.tasks.put_down.command import PutDown
from companion.tasks.swap_hands.command import SwapHands
from companion.tasks.take.command import Take
from fipa_codec.performatives import Performative as P
from services.coordinator.memory import Choice, Job, Stage
from services.coordinator.scheduling import (
    PLAN_S,
    RULES,
    Decision,
    Offer,
    by_costs,
    by_deadline,
    first_come,
    first_in,
    in_order,
    offer,
    queued,
)

seconds = st.floats(0.0, 500.0)
offers = st.builds(
    Offer,
    task=st.uuids().map(str),
    arrived=seconds,
    rest=st.floats(1.0, 100.0),
    deadline=st.one_of(seconds, st.just(math.inf)),
    urgency=st.integers(0, 2),
    suspend=st.floats(0.0, 20.0),
    resume=st.floats(0.0, 20.0),
)
rules = st.sampled_from(sorted(RULES)).map(RULES.get)
several = st.lists(offers, max_size=5).map(tuple)


@given(rules, st.none() | offers, several, st.floats(500.0, 1000.0))
def test_a_decision_is_for_a_task_that_is_there_and_as_urgent_as_any(rule, running, waiting, now):
    """This holds under every rule; a switch is for a task that waits, and told with a reason."""
    decision = rule(running, waiting, now)
    known = {one.task: one for one in (*waiting, *([running] if running else []))}
    assert (decision is None) == (not known)
    if decision is not None:
        assert known[decision.task].urgency == max(one.urgency for one in known.values())
        assert decision.switch == (running is not None and decision.task != running.task)
        assert decision.why


@given(rules, several, st.floats(500.0, 1000.0))
def test_the_order_has_each_task_once_and_keeps_those_that_come_after_another(rule, waiting, now):
    """Also where deadlines would have it otherwise; the more urgent one goes first all the same."""
    chained = tuple(
        replace(one, after=tuple(two.task for two in waiting[:n])) for n, one in enumerate(waiting)
    )
    order = in_order(chained, now, rule)
    assert sorted(order) == sorted(one.task for one in waiting)
    # a stable sort: in order of arrival otherwise
    by_urgency = sorted(waiting, key=lambda one: -one.urgency)
    assert order == tuple(one.task for one in by_urgency)


def test_a_switch_must_cost_less_than_nine_tenths_of_waiting():
    """A second more of suspension decides; by hand: wait 40 + (40 + 10), switch (s + 10) + (s + 10
    + 40).
    """
    running, short = Offer("pour", 100.0, rest=40.0), Offer("look", 100.0, rest=10.0)
    for suspend, switch in ((10.0, True), (10.25, True), (10.75, False), (14.0, False)):
        decision = by_costs(replace(running, suspend=suspend), (short,), 100.0)
        assert decision.switch is switch
        assert (decision.wait_cost, decision.switch_cost) == (90.0, 60.0 + 2 * suspend)
        assert decision.task == ("look" if switch else "pour")


def test_a_deadline_that_would_pass_is_worth_a_switch():
    """Equally long tasks are not exchanged, unless the one that waits would be late."""
    running = Offer("pour", 0.0, rest=30.0, suspend=5.0, resume=3.0)
    waiting = Offer("take", 0.0, rest=30.0)
    assert not by_costs(running, (waiting,), 0.0).switch
    assert by_costs(running, (replace(waiting, deadline=40.0),), 0.0).switch
    due, later = replace(running, deadline=30.0), replace(waiting, deadline=40.0)
    assert not by_costs(due, (later,), 0.0).switch


def test_what_a_switch_costs_by_hand():
    """Suspension and the other task first, then resumption and the rest; each second counts for
    both.
    """
    running = Offer("pour", 100.0, rest=100.0, suspend=4.0, resume=6.0)
    short = Offer("look", 100.0, rest=10.0)
    decision = by_costs(running, (short,), 100.0)
    assert decision.switch_cost == (4.0 + 10.0) + (4.0 + 10.0 + 6.0 + 100.0)
    assert decision.wait_cost == 100.0 + (100.0 + 10.0)


def test_hands_that_a_task_leaves_full_are_emptied_before_the_other_goes_on():
    """So what is taken meanwhile makes a switch dearer by that time, once: the other one alone
    waits for it.
    """
    running = Offer("pour", 100.0, rest=100.0, suspend=4.0, resume=6.0)
    short = Offer("take", 100.0, rest=10.0)
    offers = [replace(short, clear=clear) for clear in (0.0, 15.0)]
    costs = [by_costs(running, (one,), 100.0).switch_cost for one in offers]
    assert costs[1] - costs[0] == 15.0


def test_what_is_not_said_of_an_offer_costs_nothing():
    """Nor is it urgent; and a decision by urgency alone has no costs."""
    running, waiting = Offer("pour", 0.0), Offer("take", 0.0)
    equal = Decision("pour", fact(Kind.WAIT_COSTS, 0.0, 0.0), rival="take")
    assert by_costs(running, (waiting,), 0.0) == equal
    urgent, other = replace(waiting, urgency=1), replace(waiting, urgency=0)
    switch = Decision("take", fact(Kind.MORE_URGENT), True, 0.0, 0.0, "pour")
    assert first_come(running, (urgent,), 0.0) == switch
    stays = Decision("pour", fact(Kind.RUNS_ALREADY), False, 0.0, 0.0)
    assert first_come(running, (other,), 0.0) == stays
    assert first_come(replace(running, urgency=0), (waiting,), 0.0).task == "pour"


def test_a_second_costs_more_the_longer_a_task_has_waited():
    """Twice as much after ten minutes; nothing less for a task whose arrival lies ahead by another
    clock.
    """
    offer = Offer("pour", 0.0)
    assert [offer.cost(now, now + 30.0) for now in (0.0, 600.0, 1200.0)] == [30.0, 60.0, 90.0]
    assert replace(offer, arrived=50.0).cost(0.0, 30.0) == 30.0


def test_the_deadline_that_comes_first_is_worth_a_switch_and_the_same_one_is_not():
    """By rule `deadline`; a task that comes after the running one waits under every rule."""
    running, due = Offer("pour", 0.0, deadline=90.0), Offer("take", 10.0, deadline=80.0)
    assert by_deadline(running, (due,), 20.0).switch
    assert by_deadline(running, (replace(due, deadline=90.0),), 20.0).task == "pour"
    for rule in RULES.values():
        assert rule(running, (replace(due, after=("pour",)),), 20.0).task == "pour"


def test_the_reason_says_whether_there_was_a_choice():
    """A person reads it."""
    one, other = Offer("pour", 0.0, rest=5.0), Offer("take", 0.0, rest=9.0)
    assert by_costs(None, (one,), 0.0).why.kind is Kind.ONLY_ONE
    assert by_costs(None, (one, other), 0.0).why.kind is Kind.COSTS_LEAST


def test_nobody_waits_for_ever_behind_short_tasks():
    """New short tasks come without end; the long one is done all the same."""
    long, now = Offer("long", 0.0, rest=60.0), 0.0
    for number in range(1000):
        decision = by_costs(None, (long, Offer(f"short {number}", now, rest=10.0)), now)
        if decision.task == "long":
            return
        now += 10.0
    raise AssertionError(f"the long task still waits after {now} s")


def test_rules_differ_where_they_shall():
    """The earliest deadline, the first that came, the least cost."""
    early = Offer("early", 0.0, rest=50.0)
    due = Offer("due", 10.0, rest=50.0, deadline=150.0)
    short = Offer("short", 20.0, rest=5.0)
    rules = (first_come, by_deadline, by_costs)
    found = {rule: rule(None, (early, due, short), 30.0).task for rule in rules}
    assert found == {first_come: "early", by_deadline: "due", by_costs: "short"}


# --- the queue of co ------------------------------------------------------------------------------

commands = st.one_of(
    st.builds(Take, st.sampled_from(("jar", "jar_1", "bowl", "box")), urgency=st.integers(0, 1)),
    st.builds(
        PutDown, st.sampled_from(("jar", "bowl")), deadline=st.sampled_from((0.0, 50.0, 90.0))
    ),
    st.builds(LookAround, deadline=st.sampled_from((0.0, 60.0))),
)


@given(st.lists(commands, max_size=6), st.booleans())
def test_a_queue_loses_nothing_and_interrupts_nothing(said, planning):
    """The running task stays first; of two about the same thing the later one waits, unless it is
    more urgent.
    """
    jobs = ()
    for n, command in enumerate(said):
        stage = Stage.PLANNING if planning and not n else Stage.WAITING
        jobs = queued((*jobs, Job(str(n), command, float(n), stage)), float(n))
    names = [job.conversation for job in jobs]
    assert sorted(names) == sorted(str(n) for n in range(len(said)))
    if planning and said:
        assert names[0] == "0"
    for at, job in enumerate(jobs):
        for before in jobs[:at]:
            same = getattr(job.command, "object", 1) == getattr(before.command, "object", 2)
            later = int(before.conversation) > int(job.conversation)
            assert not (same and later and before.command.urgency <= job.command.urgency)


def test_what_a_task_offers():
    """One that waits is planned first; the costs of its plan count once they are known."""
    waits = Job("take", Take("jar"), 3.0)
    assert offer(waits, (waits,)) == Offer("take", 3.0, rest=PLAN_S, resume=PLAN_S)
    costs, command = ScheduleParameters("grasp", 7.0, 2.0, 4.0), Take("jar", deadline=90.0)
    runs = replace(waits, command=command, stage=Stage.RUNNING, schedule=(costs,), holds=2)
    assert offer(runs, (runs,)) == Offer(
        "take", 3.0, 7.0, 90.0, suspend=2.0, resume=PLAN_S + 4.0, clear=2 * PUT_DOWN_S
    )
    urgent = Job("look", LookAround(urgency=1, after="take"), 5.0)
    offered = offer(urgent, (runs, urgent))
    assert (offered.urgency, offered.after) == (1, ("take",))


waiting_or_not = st.tuples(st.sampled_from(Stage), st.booleans(), st.integers(0, 2))


@given(st.lists(waiting_or_not, min_size=1, max_size=5), st.integers(0, 4))
def test_the_task_for_which_another_one_was_left_comes_first(drawn, number):
    """If it waits, and none that waits is more urgent; the others keep their order."""
    jobs = tuple(
        Job(str(n), LookAround(urgency=urgency), float(n), stage, cancelling=cancelling)
        for n, (stage, cancelling, urgency) in enumerate(drawn)
    )
    after = first_in(jobs, Decision(str(number), fact(Kind.MORE_URGENT), True))
    waiting = {job.conversation: job.command.urgency for job in jobs if job.waits}
    first = waiting.get(str(number), -1) == max(waiting.values(), default=0)
    assert [job for job in after if job.conversation != str(number)] == [
        job for job in jobs if job.conversation != str(number)
    ]
    assert after[0].conversation == str(number) if first else after == jobs
    assert first_in(jobs, None) == jobs


def order_of(*said):
    """The queue's order of tasks that wait, as numbers."""
    jobs = tuple(Job(str(n), command, float(n), Stage.WAITING) for n, command in enumerate(said))
    return [int(job.conversation) for job in queued(jobs, 10.0)]


def test_tasks_wait_in_order_of_their_deadlines_unless_they_are_about_the_same_thing():
    """One without a deadline comes last; jar and jar_1 may be the same one; a look is about nothing
    in particular.
    """
    take, put = Take("jar", deadline=90.0), PutDown("bowl", deadline=50.0)
    assert order_of(LookAround(), take, put) == [2, 1, 0]
    assert order_of(take, PutDown("jar_1", deadline=50.0)) == [0, 1]
    assert order_of(LookAround(deadline=90.0), LookAround(deadline=50.0)) == [1, 0]
    assert order_of(take, PutDown("jar_1", deadline=50.0, urgency=1)) == [1, 0]


def test_tasks_of_one_sentence_keep_their_order():
    """Their order does not depend on subjects or due times."""
    assert order_of(Take("jar"), LookAround(after="0", deadline=20.0)) == [0, 1]
    assert order_of(Take("jar"), LookAround(deadline=20.0)) == [1, 0]


def test_a_table_is_cleared_after_what_was_said_before():
    """Things put there by then belong to it; later commands come after it."""
    assert order_of(PutDown("bowl", "table"), ClearTable(deadline=20.0)) == [0, 1]
    assert order_of(ClearTable(), Take("jar", deadline=20.0)) == [0, 1]


def test_hands_are_swapped_in_the_order_of_what_was_said():
    """Whatever they hold by then; with a name it is about that thing alone."""
    assert order_of(Take("jar"), SwapHands(deadline=20.0)) == [0, 1]
    assert order_of(SwapHands(), Take("bowl", deadline=20.0)) == [0, 1]
    assert order_of(Take("jar"), SwapHands("bowl", deadline=20.0)) == [1, 0]
    assert order_of(ClearTable(), LookAround(deadline=20.0)) == [1, 0]


def test_an_urgent_task_is_planned_before_those_that_wait_and_told_so():
    """co's own steps: the one under way goes on, the urgent one is the next, and hears how many
    come before it.
    """
    scene = Scene()
    tasks = [scene.command(one) for one in (Take("jar"), PutDown("jar"), LookAround(urgency=1))]
    names = [type(job.command).__name__ for job in scene.memory.jobs]
    assert names == ["Take", "LookAround", "PutDown"]
    agreed = [scene.agreed(name) for name in tasks]
    first = fact(Kind.COMES_BEFORE, "take", "jar", fact(Kind.UNDER_WAY))
    waits = (fact(Kind.TASKS_BEFORE, 1, first),)
    assert agreed == [(fact(Kind.IS_NEXT),), waits, waits]
    last = scene.command(PutDown("jar"))
    told = scene.agreed(last)
    urgent = fact(Kind.COMES_BEFORE, "look_around", fact(Kind.MORE_URGENT))
    other = fact(Kind.COMES_BEFORE, "put_down", "jar", fact(Kind.SAID_BEFORE))
    assert told == (fact(Kind.TASKS_BEFORE, 3, first, urgent, other),)


# --- a running task is left for a more urgent one -------------------------------------------------

URGENT = LookAround(urgency=1)


def test_a_running_task_is_left_for_a_more_urgent_one_and_done_afterwards(scene):
    """ta leaves it as after a cancel; the person hears where it stands; it is planned again, and
    ends done.
    """
    pour = scene.running()
    urgent = scene.command(URGENT)
    assert scene.acts("ta").count(P.CANCEL) == 1
    scene.ta(WorkerState.TERMINATING)
    scene.ta(WorkerState.PREEMPTED)
    assert scene.said(pour)[-1] == "inform suspended"
    assert scene.last_why(pour) == (fact(Kind.LEFT_FOR, "look_around", fact(Kind.MORE_URGENT)),)
    scene.carry_out(5.0)
    assert scene.said(urgent)[-1] == "inform done"
    scene.carry_out()
    assert scene.said(pour)[-1] == "inform done"
    assert len(scene.requests("ta")) == 3
    assert scene.at_rest()


def test_a_task_as_urgent_waits(scene):
    """Nobody is asked to leave anything."""
    scene.running(URGENT)
    scene.command(URGENT)
    assert P.CANCEL not in scene.acts("ta")


def test_done_before_it_could_be_left(scene):
    """The end crossed the word; the urgent one is next."""
    pour, _ = scene.running(), scene.command(URGENT)
    scene.succeed()
    assert scene.said(pour)[-1] == "inform done"
    assert len(scene.memory.jobs) == 1


def test_a_task_that_could_not_be_left_safely_fails_with_the_reason(scene):
    """The report names the held thing; the urgent task comes all the same."""
    pour, _ = scene.running(), scene.command(URGENT)
    held = (fact(Kind.STILL_HELD, "jar_1"),)
    scene.ta(WorkerState.FAILED, why=held)
    assert (scene.said(pour)[-1], scene.last_why(pour)) == ("failure failed", held)
    assert scene.state == "compSP"


@pytest.mark.parametrize("when", ["leaving", "aside"])
def test_a_task_is_cancelled_while_it_is_left_or_put_aside(scene, when):
    """One cancel to ta; the urgent task goes on."""
    pour, urgent = scene.running(), scene.command(URGENT)
    if when == "leaving":
        scene.cancel(pour)
    scene.ta(WorkerState.PREEMPTED)
    if when == "aside":
        scene.cancel(pour)
    assert scene.said(pour)[-1] == "inform cancelled"
    assert scene.acts("ta").count(P.CANCEL) == 1
    scene.carry_out(5.0)
    scene.ended(urgent, "inform done")


def test_the_urgent_one_is_cancelled_meanwhile(scene):
    """Then the first one goes on, with a new plan."""
    pour, urgent = scene.running(), scene.command(URGENT)
    scene.cancel(urgent)
    assert scene.said(urgent)[-1] == "inform cancelled"
    scene.ta(WorkerState.PREEMPTED)
    scene.carry_out()
    scene.ended(pour, "inform done")


def test_a_plan_is_not_begun_where_a_more_urgent_task_came_meanwhile(scene):
    """It is planned again afterwards: the world is another one then."""
    pour = scene.command()
    urgent = scene.command(URGENT)
    scene.plan()
    assert not scene.requests("ta")
    assert scene.said(pour)[-1] == "inform suspended"
    assert (scene.state, scene.memory.choice) == ("compSP", Choice.OPEN)
    scene.carry_out(5.0)
    scene.carry_out()
    assert [scene.said(task)[-1] for task in (pour, urgent)] == ["inform done"] * 2
    assert scene.at_rest()


def test_a_robot_that_does_not_leave_a_task_is_late(scene):
    """The person hears it; no second cancel; the urgent task ends too when patience is over."""
    pour, urgent = scene.running(), scene.command(URGENT)
    scene.settle(241.0)
    assert scene.said(pour)[-1] == "failure failed"
    assert scene.acts("ta").count(P.CANCEL) == 1
    scene.settle(61.0)
    assert scene.said(urgent)[-1] == "failure failed"


def test_a_plan_that_waits_for_an_operator_is_not_late_when_he_comes_at_the_last_moment(scene):
    """It has the time of its acts then, beside that of waiting."""
    pour = scene.running()
    scene.ta(WorkerState.WAITING)
    said = scene.said(pour)
    scene.settle(WAIT_S + 50.0)
    assert scene.said(pour) == said
    scene.succeed()
    assert scene.said(pour)[-1] == "inform done"
    assert scene.at_rest()
