"""Scheduling: the rules by which state `schedule` decides (paper, section 5.5; requirements R2b,
R3b).

A rule sees the running task and those that wait, each as an offer with its schedule parameters, and
returns its decision with the numbers and a fact that says why. Under every rule a more urgent task
replaces the running one at once, and a less urgent one never does; among tasks that are equally
urgent the rules differ. The queue: what the tasks offer to a rule, their order, and decisions.
Pure. Must not know: states of co.
"""

import math
from collections.abc import Callable, Iterable

import msgspec
from msgspec.structs import replace

from companion.languages.facts import Fact, Kind, fact
from companion.languages.hfsm import PUT_DOWN_S
from services.coordinator.memory import Decision, Job, Memory, Stage, about, bound, comes_after

BELOW = 0.9
"""A switch must cost less than this part of waiting (TaskER's rule, which its published code
ignores).
"""
LATE = 5.0
"""Cost that a second after the deadline adds to that of waiting, which is 1 (estimate: people mind
lateness more).
"""
AGEING_S = 600.0
"""After so long a second of waiting costs twice as much, so that no task waits for ever
(estimate).
"""


class Offer(msgspec.Struct, frozen=True):
    """Schedule parameters of a task (TaskER: ScheduleParams). `arrived`, `deadline`: unix time [s],
    inf for none.

    In seconds of wall time: `rest` until it is done, `suspend` until it is safely left, `resume`
    until it is taken up again where it was left, `clear` until the hands are empty that it leaves
    full. `after`: tasks that end before it, unless this one is more urgent.
    """

    task: str
    arrived: float
    rest: float = 0.0
    deadline: float = math.inf
    urgency: int = 0
    after: tuple[str, ...] = ()
    suspend: float = 0.0
    resume: float = 0.0
    clear: float = 0.0

    def cost(self, now: float, ended: float) -> float:
        """The cost of the time from now until its end, both unix time [s]."""
        per_s = 1.0 + max(0.0, now - self.arrived) / AGEING_S
        return per_s * (ended - now) + LATE * max(0.0, ended - max(now, self.deadline))


Rule = Callable[[Offer | None, tuple[Offer, ...], float], Decision | None]
"""Decide between the running task, if one runs, and those that wait, at a time [unix s]; None
without any task.
"""


def by_costs(running: Offer | None, waiting: tuple[Offer, ...], now: float) -> Decision | None:
    """Decide as TaskER does: switch where that costs less than BELOW of waiting."""
    settled = _by_urgency(running, waiting)
    if isinstance(settled, Decision) or settled is None:
        return settled
    first = min(settled, key=lambda one: _cost_first(one, settled, now))
    if running is None:
        return Decision(first.task, fact(Kind.COSTS_LEAST if len(settled) > 1 else Kind.ONLY_ONE))
    left = now + running.suspend + first.rest
    switch = first.cost(now, left) + running.cost(
        now, left + first.clear + running.resume + running.rest
    )
    wait = running.cost(now, now + running.rest) + first.cost(now, now + running.rest + first.rest)
    if switch < BELOW * wait:
        return Decision(
            first.task, fact(Kind.SWITCH_COSTS, switch, wait), True, switch, wait, running.task
        )
    return Decision(
        running.task, fact(Kind.WAIT_COSTS, wait, switch), False, switch, wait, first.task
    )


def by_deadline(running: Offer | None, waiting: tuple[Offer, ...], now: float) -> Decision | None:
    """Decide for the earliest deadline; of two with the same, or none, for the one that runs or
    came first.
    """
    settled = _by_urgency(running, waiting)
    if isinstance(settled, Decision) or settled is None:
        return settled
    first = min(settled, key=lambda one: (one.deadline, one.arrived))
    if running is not None and running.deadline <= first.deadline:
        return Decision(running.task, fact(Kind.NO_EARLIER_DEADLINE), rival=first.task)
    if math.isinf(first.deadline):
        return Decision(first.task, fact(Kind.CAME_FIRST))
    why, rival = fact(Kind.EARLIEST_DEADLINE, first.deadline - now), running.task if running else ""
    return Decision(first.task, why, running is not None, rival=rival)


def first_come(running: Offer | None, waiting: tuple[Offer, ...], now: float) -> Decision | None:
    """Decide for the running task, else for the one that came first."""
    settled = _by_urgency(running, waiting)
    if isinstance(settled, Decision) or settled is None:
        return settled
    if running is not None:
        return Decision(running.task, fact(Kind.RUNS_ALREADY))
    return Decision(min(settled, key=lambda one: one.arrived).task, fact(Kind.CAME_FIRST))


def in_order(offers: tuple[Offer, ...], now: float, rule: Rule) -> tuple[str, ...]:
    """The tasks in the order in which a rule takes them up, as things are now."""
    names: list[str] = []
    while (decision := rule(None, offers, now)) is not None:
        names.append(decision.task)
        offers = tuple(one for one in offers if one.task != decision.task)
    return tuple(names)


RULES: dict[str, Rule] = {"costs": by_costs, "deadline": by_deadline, "first-come": first_come}


def _by_urgency(
    running: Offer | None, waiting: tuple[Offer, ...]
) -> Decision | tuple[Offer, ...] | None:
    """The decision where urgency settles it, else those that wait and are as urgent as any; None
    for no task.
    """
    if not waiting:
        return None if running is None else Decision(running.task, fact(Kind.NOTHING_ELSE_WAITS))
    most = max(one.urgency for one in waiting)
    known = {
        one.task for one in (*waiting, *((running,) if running else ())) if one.urgency >= most
    }
    urgent = tuple(one for one in waiting if one.urgency == most and known.isdisjoint(one.after))
    if not urgent:
        return None if running is None else Decision(running.task, fact(Kind.THE_REST_FOLLOWS))
    if running is None or running.urgency == most:
        return urgent
    if running.urgency > most:
        return Decision(running.task, fact(Kind.LESS_URGENT))
    first = min(urgent, key=lambda one: (one.deadline, one.arrived))
    return Decision(first.task, fact(Kind.MORE_URGENT), True, rival=running.task)


def _cost_first(first: Offer, offers: Iterable[Offer], now: float) -> float:
    """The cost of all where this one is done first and each other one right after it."""
    # added one by one: sum() of floats gives other last digits since Python 3.12, and co's log
    # replays
    others = 0.0
    for one in offers:
        if one.task != first.task:
            others += one.cost(now, now + first.rest + one.rest)
    return first.cost(now, now + first.rest) + others


# --- The queue ------------------------------------------------------------------------------------

PLAN_S = 6.0  # [s] of wall time to make a plan, on two cores (measured)


def comparing(rule: Rule, waiting: Iterable[Job]) -> Rule:
    """The rule by which tasks that wait are compared: by costs only where those of all are
    known.
    """
    return by_deadline if rule is by_costs and not all(job.schedule for job in waiting) else rule


def queued(jobs: tuple[Job, ...], now: float, rule: Rule = by_costs) -> tuple[Job, ...]:
    """The tasks in the order in which they are done: what has begun, then by the rule [now: unix
    s], then those whose time to start has not come.

    Two that name the same object, or were said in one sentence, keep their order, unless the later
    one is more urgent.
    """
    begun = tuple(job for job in jobs if job.begun)
    later = (job for job in jobs if job.stage is Stage.EARLY)
    early = sorted(later, key=lambda job: job.command.start)
    ready = (job for job in jobs if not job.begun and job.stage is not Stage.EARLY)
    waiting = {job.conversation: job for job in ready}
    rule = comparing(rule, waiting.values())
    order = in_order(tuple(offer(job, jobs) for job in waiting.values()), now, rule)
    return (*begun, *(waiting[name] for name in order), *early)


def place(jobs: tuple[Job, ...], job: Job, now: float) -> Fact:
    """The place of a task in the queue, and why each one before it comes first [now: unix s]."""
    early_s, before = job.command.start - now, jobs[: jobs.index(job)]
    if early_s > 0.0:
        return fact(Kind.BEGINS_IN, early_s)
    if not before:
        return fact(Kind.IS_NEXT)
    why = (about(Kind.COMES_BEFORE, one, fact(_first_as(one, job))) for one in before)
    return fact(Kind.TASKS_BEFORE, len(before), *why)


def _first_as(one: Job, job: Job) -> Kind:
    """Why a task comes before another one."""
    if one.begun:
        return Kind.UNDER_WAY
    if one.command.urgency > job.command.urgency:
        return Kind.MORE_URGENT
    if one.command.deadline and one.command.deadline < (job.command.deadline or math.inf):
        return Kind.DUE_EARLIER
    return Kind.SAID_BEFORE if one.arrived <= job.arrived else Kind.COSTS_LESS


def offer(job: Job, jobs: tuple[Job, ...]) -> Offer:
    """What a task offers, in seconds of wall time; one that waits is planned first."""
    earlier = (one for one in jobs[: jobs.index(job)] if one.stage is not Stage.EARLY)
    after = tuple(one.conversation for one in earlier if comes_after(job, one))
    known, planning = job.parameters, PLAN_S if job.stage is Stage.WAITING else 0.0
    return Offer(
        job.conversation,
        job.arrived,
        rest=planning + (known.rest if known else 0.0),
        deadline=job.command.deadline or math.inf,
        urgency=job.command.urgency,
        after=after,
        suspend=known.suspend if known else 0.0,
        resume=PLAN_S + (known.resume if known else 0.0),
        clear=PUT_DOWN_S * job.holds,
    )


def decided(memory: Memory, now: float, rule: Rule) -> Memory:
    """The memory with the decision between the task that runs, or could, and those that wait.

    One whose parameters are not known is weighed only where it is more urgent.
    """
    running = memory.first
    assert running is not None
    runs = running.stage is not Stage.PLANNED
    urgency = running.command.urgency
    waits = [(n, one) for n, one in enumerate(memory.jobs) if one.waits]
    weighs = {n for n, one in waits if runs and one.schedule and not bound(memory.jobs, n)}
    rivals = [one for n, one in waits if one.command.urgency > urgency or n in weighs]
    offers = tuple(offer(job, memory.jobs) for job in rivals)
    decision = rule(offer(running, memory.jobs), offers, now)
    jobs = tuple(
        replace(job, weighed=job.weighed or (job.waits and bool(job.schedule)))
        for job in memory.jobs
    )
    return replace(memory, jobs=jobs, decision=decision if rivals else None)


def first_in(jobs: tuple[Job, ...], decision: Decision | None) -> tuple[Job, ...]:
    """The queue with the task first for which another one was left, unless a more urgent one waits
    meanwhile.
    """
    waiting = [job for job in jobs if job.waits]
    chosen = decision.task if decision is not None else None
    rival = next((job for job in waiting if job.conversation == chosen), None)
    if rival is None or any(one.command.urgency > rival.command.urgency for one in waiting):
        return jobs
    return (rival, *(job for job in jobs if job is not rival))
