"""Events of a run, derived from what the agents said: the rows of the paper's Table 7 (section 5.7).

Must not know: the truth of the simulation. "jar grasped" means that ex said so.
"""

from collections.abc import Iterator

import msgspec

from companion.languages import cmd, rc, wm
from companion.tools.report.plans import (
    REFUSED,
    Act,
    Made,
    Ran,
    acts,
    asked,
    commands,
    made,
    outcome,
    ran,
    reason,
    task_command,
    task_end,
)
from operate.recording.history import History

ENDS = {cmd.TaskState.DONE: "finished", REFUSED: REFUSED}
"""Names of a command's end where its state alone is not clear."""


class Event(msgspec.Struct, frozen=True):
    """Something that happened: unix time, name, the channels it was said on, and why, where somebody said so."""

    at: float
    name: str
    channels: tuple[str, ...]
    text: str = ""


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


def word(object: str) -> str:
    """An object's id in a word: jar_1 is the jar."""
    return object.rstrip("0123456789").rstrip("_") or object


def _knowledge(history: History) -> Iterator[Event]:
    """km's first survey: the observations it gets before the first act of a plan (or all, where there is none)."""
    first = min((plan.start for plan in ran(history)), default=float("inf"))
    seen = [o.received for o in history.said if isinstance(o.content, wm.SeenObject) and o.received < first]
    if seen:
        yield Event(seen[0], "km hears of the first thing", ("C5", "C6"))
        yield Event(seen[-1], "km knows the surroundings", ("C5", "C6"))


def _commands(history: History) -> Iterator[Event]:
    """Yield the commands of people: the report's task by the names of the paper's table, all others by their words."""
    main = task_command(history)
    for command in commands(history):
        of = "" if command is main else f": {asked(command)}"
        yield Event(command.received, f"command received{of}", ("C2",))
        end = task_end(history, command)
        if end is not None:
            name = ENDS.get(outcome(end)) or f"ended, {outcome(end)}"
            yield Event(end.received, f"{name}{of}", ("C2",), reason(end))


def _planning(plan: Made) -> Iterator[Event]:
    yield Event(plan.start, f"plan {plan.number} requested", ("C3",))
    if plan.end is not None:
        name = f"plan {plan.number} received" if plan.outcome == "found" else f"no plan {plan.number}"
        yield Event(plan.end, name, ("C3", "C4"), plan.reason)


def _running(plan: Ran) -> Iterator[Event]:
    yield Event(plan.start, f"plan {plan.number} begins", ("C1",))
    if plan.end is not None and plan.outcome is not None:
        yield Event(plan.end, f"plan {plan.number} ended: {plan.outcome}", ("C1",), plan.reason)


def _handling(history: History) -> Iterator[Event]:
    """Grasped, pulled out, put down, localized, poured."""
    holding: dict[str, str] = {}  # side -> object that was grasped and not moved yet
    all_acts = acts(history)
    for act in all_acts:
        if not act.done or act.end is None:
            continue
        match act.command:
            case rc.Grasp(side=side, object=object):
                holding[side] = object
                yield Event(act.end, f"{word(object)} grasped", ("C5",))
            case rc.MoveCartesian(side=side) if side in holding:
                yield Event(act.end, f"{word(holding.pop(side))} pulled out", ("C5",))
            case rc.Release(object=object, side=side):
                holding.pop(side, None)
                yield Event(act.end, f"{word(object)} put down", ("C5",))
                yield from _localized(history, all_acts, act, object)
            case rc.Pour():
                yield Event(act.end, "content poured", ("C5",))
            case rc.OpenDoor(door=door):
                yield Event(act.end, f"{word(door)} opened", ("C5",))


def _localized(history: History, all_acts: tuple[Act, ...], release: Act, object: str) -> Iterator[Event]:
    """The first observation of what was put down, after the first look that followed."""
    assert release.end is not None
    looks = (act.end for act in all_acts if isinstance(act.command, rc.Look) and act.done and act.start > release.end)
    looked = next((end for end in looks if end is not None), None)
    if looked is None:
        return
    for one in history.said:
        if isinstance(one.content, wm.SeenObject) and one.content.object == object and one.received >= looked:
            yield Event(one.received, f"{word(object)} localized", ("C5", "C6"))
            return
