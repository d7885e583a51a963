"""What the tasks of co offer to its scheduler, and the queue that comes of it. Must not know: messages."""

import math

from companion.languages import cmd
from services.coordinator.memory import Job
from services.coordinator.scheduling import Decision, Offer, by_deadline, in_order


def queued(jobs: tuple[Job, ...], now: float) -> tuple[Job, ...]:
    """Return the tasks in the order in which they are done: what has begun, then by urgency and deadline [now: unix s].

    Two that name the same thing keep their order of arrival, unless the later one is more urgent.
    """
    begun = tuple(job for job in jobs if job.begun)
    waiting = {job.conversation: job for job in jobs if not job.begun}
    order = in_order(tuple(_offer(job, jobs) for job in waiting.values()), now, by_deadline)
    return (*begun, *(waiting[name] for name in order))


def overtaking(jobs: tuple[Job, ...], now: float) -> Decision | None:
    """Return the decision between the first task and those behind it."""
    first, *rest = (_offer(job, jobs) for job in jobs)
    return by_deadline(first, tuple(rest), now)


def place(jobs: tuple[Job, ...], job: Job) -> str:
    """Return the place of a task in the queue, in words, and why each one before it comes first."""
    before = jobs[: jobs.index(job)]
    if not before:
        return "it is the next one"
    count = "one task comes" if len(before) == 1 else f"{len(before)} tasks come"
    return f"{count} before it: {', '.join(f'{one.conversation} ({_first_as(one, job)})' for one in before)}"


def _first_as(one: Job, job: Job) -> str:
    if one.begun:
        return "under way"
    mine, other = job.command, one.command
    if other.urgency > mine.urgency:
        return f"more urgent, {other.urgency} above {mine.urgency}"
    if other.deadline and other.deadline < (mine.deadline or math.inf):
        return "due earlier"
    return "said before"


def _offer(job: Job, jobs: tuple[Job, ...]) -> Offer:
    earlier = jobs[: jobs.index(job)]
    things = _things(job.command)
    after = tuple(one.conversation for one in earlier if things & _things(one.command))
    deadline = job.command.deadline or math.inf
    return Offer(job.conversation, job.arrived, deadline=deadline, urgency=job.command.urgency, after=after)


def _things(command: cmd.Task) -> frozenset[str]:
    """The kinds of things that a command names: jar and jar_1 may be the same one."""
    named = (getattr(command, field, "") for field in ("source", "destination", "object"))
    return frozenset(name.partition("_")[0] for name in named if name)
