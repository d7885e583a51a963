"""From the steps of the search to the HFSM that ta runs: one machine per step, and how to make it
safe if cancelled.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from functools import reduce
from itertools import pairwise
from operator import add
from typing import NamedTuple

from msgspec.structs import replace

from companion.languages import hfsm, rc, wm
from companion.languages.facts import Facts, Kind, fact
from companion.languages.values import Side
from companion.planning.methods import Asking, Unanswered
from companion.planning.steps import SIDES, Step, approach_points, hand_steps
from velma.kinematics.frames import transform
from velma.kinematics.tasks.placing import backwards

STOP_S = 1.0  # [s] to stop an act, as cancels took (measured)
TAKE_S = 12.0  # [s] to take again what stands on a table (estimate)
# [s] of the plan that follows one that ends with a look: a pour with its plan (estimate)
AGAIN_S = 30.0
PUT_DOWN = hfsm.Step("put-everything-down")
WHATEVER = (hfsm.Outcome.SUCCEEDED, hfsm.Outcome.FAILED, hfsm.Outcome.REPLAN)


class Found(NamedTuple):
    """Result of a search: steps, the thing to be localized before the same task is planned again
    ("" if the steps do the whole task), what is told to the person when they are done, and the
    outcome if the thing is not localized.
    """

    steps: list[Step]
    sought: str
    told: Facts
    otherwise: hfsm.Outcome = hfsm.Outcome.REPLAN


def plan(
    request: str, task: str, found: Found, queries: int, held: dict[Side, rc.Release]
) -> hfsm.HierarchicalPlan:
    """The plan of these steps in order; `held`: the commands that put down what the hands hold at
    the start.
    """
    steps, sought, told, otherwise = found
    holding = dict(held)
    states: list[hfsm.State] = []
    names = _names(steps)
    in_hand: list[dict[Side, str]] = []
    for number, (name, step) in enumerate(zip(names, steps, strict=True), start=1):
        for grasp in step.commands:
            if isinstance(grasp, rc.Grasp):
                retreat = approach_points(
                    backwards([(transform(p.at), p.fingers) for p in grasp.approach])
                )
                holding[grasp.side] = rc.Release("", grasp.side, grasp.object, "", None, retreat)
        in_hand.append({side: release.object for side, release in holding.items()})
        states.append(_machine(request, number, name, step, _safe(request, number, holding)))
        for change in step.changes:
            if isinstance(change, wm.Released):
                holding.pop(change.side, None)
    if sought:
        seen = wm.Holds(relation=wm.Relation.HAS_EXACT_POSE, subject=sought)
        states.append(hfsm.AskState(f"localize {sought}", seen, otherwise=otherwise))
        states.append(hfsm.EndState("replan", hfsm.Outcome.REPLAN, (fact(Kind.LOCALIZED, sought),)))
    if not states or told:
        name = "nothing to do" if not states else "tell"
        states.append(hfsm.EndState(name, hfsm.Outcome.SUCCEEDED, told or (fact(Kind.SO_ALREADY),)))
    root = hfsm.Machine(task, states[0].name, _chained(states), safe=_safe(request, 0, holding))
    return hfsm.HierarchicalPlan(
        id=request,
        task=task,
        root=root,
        duration=_added(step.duration for step in steps),
        queries=queries,
        schedule=schedule(names, steps, in_hand, again=bool(sought)),
        holds={side: release.object for side, release in holding.items()},
    )


def _names(steps: list[Step]) -> list[str]:
    """A name for each step, none twice, since arcs lead to names: "home right", "home right 2"."""
    times: Counter[hfsm.Step] = Counter()
    names = []
    for step in steps:
        times[step.step] += 1
        names.append(_name(step.step) + (f" {times[step.step]}" if times[step.step] > 1 else ""))
    return names


def _name(step: hfsm.Step) -> str:
    """A name that an operator knows the step by: take jar_1, home left."""
    return " ".join(filter(None, (step.does.replace("-", " "), *step.things, step.side)))


def schedule(
    names: list[str], steps: list[Step], in_hand: list[dict[Side, str]], *, again: bool
) -> tuple[hfsm.ScheduleParameters, ...]:
    """The schedule parameters at each step; `in_hand`: what is held in it; `again`: another plan
    follows.

    What is held is put down when the task is left, and taken again when it goes on: that takes as
    long as taking it does, or TAKE_S where it was held before.
    """
    taking = {
        c.object: step.duration for step in steps for c in step.commands if isinstance(c, rc.Grasp)
    }
    found, rest = [], AGAIN_S if again else 0.0
    for name, step, held in zip(reversed(names), reversed(steps), reversed(in_hand), strict=True):
        rest += step.duration
        resume = _added(taking.get(thing, TAKE_S) for thing in held.values())
        suspend = STOP_S + hfsm.PUT_DOWN_S * len(held)
        found.append(hfsm.ScheduleParameters(name, rest, suspend, resume))
    return tuple(reversed(found))


def _added(durations: Iterable[float]) -> float:
    """The sum [s]; of none the integer 0, as plans that were recorded have it."""
    return reduce(add, durations, 0)


def _chained(
    states: Sequence[hfsm.State], on: tuple[hfsm.Outcome, ...] = (hfsm.Outcome.SUCCEEDED,)
) -> tuple[hfsm.State, ...]:
    """The states, each with arcs to the following one on these outcomes; an end has none."""
    return (
        *(_then(state, following.name, on) for state, following in pairwise(states)),
        *states[-1:],
    )


def _then(state: hfsm.State, following: str, on: tuple[hfsm.Outcome, ...]) -> hfsm.State:
    if isinstance(state, hfsm.EndState):
        return state
    return replace(state, arcs=tuple(hfsm.Arc(outcome, following) for outcome in on))


def _machine(
    request: str, number: int, name: str, step: Step, safe: hfsm.Machine | None
) -> hfsm.Machine:
    """One step as a machine; its states are the commands, each with its key.

    Behind them is what is done instead where the last command fails, with the failure at its end.
    """
    leaves: list[hfsm.State] = [
        hfsm.ActState(_verb(command), replace(command, key=f"{request}/{number}.{index}"))
        for index, command in enumerate(step.commands, start=1)
    ]
    instead = enumerate(step.instead, start=1)
    otherwise: list[hfsm.State] = [
        hfsm.ActState(
            f"{_verb(one)} instead {k}", replace(one, key=f"{request}/{number}.instead{k}")
        )
        for k, one in instead
    ]
    *states, last = _chained(leaves)
    if otherwise:
        otherwise.append(hfsm.EndState("failed", hfsm.Outcome.FAILED, step.why))
        last = _then(last, otherwise[0].name, (hfsm.Outcome.FAILED,))
    return hfsm.Machine(
        name, leaves[0].name, (*states, last, *_chained(otherwise)), safe=safe, step=step.step
    )


def _verb(command: rc.Command) -> str:
    """The class of a command in small letters with hyphens: move-joint, grasp, pour."""
    name = type(command).__name__
    return "".join(f"-{c.lower()}" if c.isupper() else c for c in name).lstrip("-")


def _safe(request: str, number: int, holding: dict[Side, rc.Release]) -> hfsm.Machine | None:
    """The machine that puts down all that may be held, last taken first; an empty hand's release
    does nothing.

    Arms go home when all stands. It goes on if an act fails: what could not be put down for the
    other arm is put down when ta tries all of it again, with the arms at home.
    """
    if not holding:
        return None
    releases: list[hfsm.State] = []
    homes: list[hfsm.State] = []
    for index, (side, release) in enumerate(reversed(holding.items()), start=1):
        key = f"{request}/{number}.safe{index}"
        releases.append(hfsm.ActState(f"put down {release.object}", replace(release, key=key)))
        homes.append(hfsm.ActState(f"home {side}", rc.Home(key=f"{key}.home", side=side)))
    states = _chained([*releases, *homes], WHATEVER)
    return hfsm.Machine(_name(PUT_DOWN), states[0].name, states, step=PUT_DOWN)


# --- what the hands hold when the plan begins -----------------------------------------------------


def held_at(asking: Asking, state: str) -> dict[Side, rc.Release]:
    """A release for each hand that holds something in `state`; ex chooses the place."""
    found = {}
    for side in SIDES:
        try:
            held = asking(wm.GraspAtSide(state=state, side=side), wm.GraspOf)
            if held.object:
                query = wm.GraspDefinition(state=state, object=held.object, grasp=held.grasp)
                retreat = approach_points(backwards(hand_steps(asking(query, wm.Grasps).grasps[0])))
                found[side] = rc.Release("", side, held.object, "", None, retreat)
        except Unanswered:
            continue  # nothing is known of this hand
    return found
