"""Events of a run, derived from what the agents said: the rows of the paper's Table 7 (section
5.7).

Must not know: the truth of the simulation. "jar grasped" means that ex said so.
"""

from collections.abc import Iterator
from enum import StrEnum
from math import inf

import msgspec

from companion.acts import SHOWN
from companion.languages import cmd, rc, wm
from companion.tools.report.plans import (
    REFUSED,
    ActRecord,
    Made,
    Ran,
    acts,
    asked_of,
    commands,
    made,
    outcome,
    ran,
    reason,
    task_command,
    task_end,
)
from operate.recording.history import History


class Kind(StrEnum):
    """Names of events; a task has its own for what its act has done (companion.tasks, part
    `shown`).
    """

    FIRST_THING = "km-hears-of-the-first-thing"
    SURROUNDINGS = "km-knows-the-surroundings"
    COMMAND = "command-received"
    FINISHED = "finished"
    REFUSED = "refused"
    ENDED = "ended"
    PLAN_REQUESTED = "plan-requested"
    PLAN_RECEIVED = "plan-received"
    NO_PLAN = "no-plan"
    PLAN_BEGINS = "plan-begins"
    PLAN_ENDED = "plan-ended"
    GRASPED = "grasped"
    PULLED_OUT = "pulled-out"
    RELEASED = "put-down"
    LOCALIZED = "localized"


ENDS: dict[str, Kind] = {cmd.TaskState.DONE: Kind.FINISHED, REFUSED: Kind.REFUSED}
"""Kinds of a command's end; any other one has the state."""


class Event(msgspec.Struct, frozen=True):
    """Something that happened: unix time, kind, of which things, numbers or outcomes, the channels
    it was said on, and why, where somebody said so.
    """

    at: float
    kind: str
    of: tuple[str, ...]
    channels: tuple[str, ...]
    text: str = ""

    @property
    def name(self) -> str:
        """Its kind with what it is of, by which a design or an operator names it: `grasped
        jar_1`.
        """
        return " ".join((self.kind, *self.of))


def events(history: History) -> tuple[Event, ...]:
    """All events in the order of time."""
    found = [
        *_knowledge(history),
        *_commands(history),
        *(event for plan in made(history) for event in _planning(plan)),
        *(event for plan in ran(history) for event in _running(plan)),
        *_handling(history),
    ]
    return tuple(sorted(found, key=lambda event: event.at))


def _knowledge(history: History) -> Iterator[Event]:
    """km's first survey: the observations it gets before the first act of a plan (or all, where
    there is none).
    """
    first = min((plan.start for plan in ran(history)), default=float("inf"))
    sights = (one for one in history.said if isinstance(one.content, wm.SeenObject))
    seen = [one.received for one in sights if one.received < first]
    if seen:
        yield Event(seen[0], Kind.FIRST_THING, (), ("C5", "C6"))
        yield Event(seen[-1], Kind.SURROUNDINGS, (), ("C5", "C6"))


def _commands(history: History) -> Iterator[Event]:
    """Yield the commands of people: the report's task as in the paper's table, all others with what
    was asked.
    """
    main = task_command(history)
    for command in commands(history):
        of = () if command is main else asked_of(command)
        yield Event(command.received, Kind.COMMAND, of, ("C2",))
        end = task_end(history, command)
        if end is not None:
            kind = ENDS.get(outcome(end), Kind.ENDED)
            how = (outcome(end),) if kind is Kind.ENDED else ()
            yield Event(end.received, kind, (*how, *of), ("C2",), reason(end))


def _planning(plan: Made) -> Iterator[Event]:
    number = (str(plan.number),)
    yield Event(plan.start, Kind.PLAN_REQUESTED, number, ("C3",))
    if plan.end is not None:
        kind = Kind.PLAN_RECEIVED if plan.outcome == "found" else Kind.NO_PLAN
        yield Event(plan.end, kind, number, ("C3", "C4"), plan.reason)


def _running(plan: Ran) -> Iterator[Event]:
    number = str(plan.number)
    yield Event(plan.start, Kind.PLAN_BEGINS, (number,), ("C1",))
    if plan.end is not None and plan.outcome is not None:
        yield Event(plan.end, Kind.PLAN_ENDED, (number, plan.outcome), ("C1",), plan.reason)


def _handling(history: History) -> Iterator[Event]:
    """What acts did that were done; of a thing that was put down also when it was localized."""
    holding: dict[str, str] = {}  # side -> object that was grasped and not moved yet
    all_acts = acts(history)
    for act in all_acts:
        if not act.done or act.end is None:
            continue
        match act.command:
            case rc.Grasp(side=side, object=object):
                holding[side] = object
                yield Event(act.end, Kind.GRASPED, (object,), ("C5",))
            case rc.MoveCartesian(side=side) if side in holding:
                yield Event(act.end, Kind.PULLED_OUT, (holding.pop(side),), ("C5",))
            case rc.Release(object=object, side=side):
                holding.pop(side, None)
                yield Event(act.end, Kind.RELEASED, (object,), ("C5",))
                yield from _localized(history, all_acts, act, object)
            case command if (row := SHOWN.get(type(command))) and row.event:
                of = tuple(getattr(command, name) for name in row.of)
                yield Event(act.end, row.event, of, ("C5",))


def _localized(
    history: History, all_acts: tuple[ActRecord, ...], release: ActRecord, object: str
) -> Iterator[Event]:
    """The first observation of what was put down, after the first look that followed."""
    assert release.end is not None
    later = (act for act in all_acts if act.done and act.start > release.end)
    looks = (act.end for act in later if isinstance(act.command, rc.Look))
    looked = next((end for end in looks if end is not None), None)
    if looked is None:
        return
    for one in history.during(looked, inf):
        if isinstance(one.content, wm.SeenObject) and one.content.object == object:
            yield Event(one.received, Kind.LOCALIZED, (object,), ("C5", "C6"))
            return
