"""Scheduling: the rules by which state `schedule` decides (paper, section 5.5; requirements R2b,
R3b).

A rule sees the running task and those that wait, each as an offer with its schedule parameters, and
returns its decision with the numbers and a sentence. Under every rule a more urgent task replaces
the running one at once, and a less urgent one never does; among tasks that are equally urgent the
rules differ. Pure. Must not know: messages, plans.
"""

import math
from collections.abc import Callable, Iterable

import msgspec

from companion.languages.facts import Fact, Kind, fact

BELOW = 0.9
"""A switch must cost less than this part of waiting (TaskER's rule, which its published code
ignores).
"""
LATE = 5.0
"""Cost of a second after the deadline, where a second of waiting costs 1 (estimate: people mind the
first more).
"""
AGEING_S = 600.0
"""After so long a second of waiting costs twice as much, so that no task waits for ever
(estimate).
"""


class Offer(msgspec.Struct, frozen=True):
    """Schedule parameters of a task (TaskER: ScheduleParams). `arrived`, `deadline`: unix time [s],
    inf for none.

    In seconds of robot time: `rest` until it is done, `suspend` until it is safely left, `resume`
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


class Decision(msgspec.Struct, frozen=True, omit_defaults=True):
    """The task that goes on, and whether the running one is left for it; `rival`: the other one,
    where there were two.

    `switch_cost`, `wait_cost`: where they were compared.
    """

    task: str
    why: Fact
    switch: bool = False
    switch_cost: float = 0.0
    wait_cost: float = 0.0
    rival: str = ""


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
