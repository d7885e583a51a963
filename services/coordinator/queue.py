"""The queue of co: what its tasks offer to the scheduler, their order, and decisions. Must not
know: messages.
"""

import math
from collections.abc import Iterable

from msgspec.structs import replace

from companion.languages.facts import Fact, Kind, fact
from companion.languages.hfsm import PUT_DOWN_S
from services.coordinator import outgoing_messages as messages
from services.coordinator.memory import Job, Memory, Stage, bound, comes_after
from services.coordinator.scheduling import Decision, Offer, Rule, by_costs, by_deadline, in_order

PLAN_S = 6.0  # [s] of wall time to make a plan, on two cores (measured)


def comparing(rule: Rule, waiting: Iterable[Job]) -> Rule:
    """The rule by which tasks that wait are compared: by costs only where those of all are
    known.
    """
    return by_deadline if rule is by_costs and not all(job.schedule for job in waiting) else rule


def queued(
    jobs: tuple[Job, ...], now: float, rule: Rule = by_costs, speed: float = 1.0
) -> tuple[Job, ...]:
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
    order = in_order(tuple(offer(job, jobs, speed) for job in waiting.values()), now, rule)
    return (*begun, *(waiting[name] for name in order), *early)


def place(jobs: tuple[Job, ...], job: Job, now: float) -> Fact:
    """The place of a task in the queue, and why each one before it comes first [now: unix s]."""
    early_s, before = job.command.start - now, jobs[: jobs.index(job)]
    if early_s > 0.0:
        return fact(Kind.BEGINS_IN, early_s)
    if not before:
        return fact(Kind.IS_NEXT)
    why = (messages.about(Kind.COMES_BEFORE, one, fact(_first_as(one, job))) for one in before)
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


def offer(job: Job, jobs: tuple[Job, ...], speed: float = 1.0) -> Offer:
    """What a task offers, in seconds of wall time; one that waits is planned first."""
    earlier = (one for one in jobs[: jobs.index(job)] if one.stage is not Stage.EARLY)
    after = tuple(one.conversation for one in earlier if comes_after(job, one))
    known, planning = job.parameters, PLAN_S if job.stage is Stage.WAITING else 0.0
    return Offer(
        job.conversation,
        job.arrived,
        rest=planning + (known.rest / speed if known else 0.0),
        deadline=job.command.deadline or math.inf,
        urgency=job.command.urgency,
        after=after,
        suspend=known.suspend / speed if known else 0.0,
        resume=PLAN_S + (known.resume / speed if known else 0.0),
        clear=PUT_DOWN_S * job.holds / speed,
    )


def decided(memory: Memory, now: float, rule: Rule, speed: float) -> Memory:
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
    offers = tuple(offer(job, memory.jobs, speed) for job in rivals)
    decision = rule(offer(running, memory.jobs, speed), offers, now)
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
