"""From the steps of the search to the HFSM that ta runs: one machine per step, and how to make it safe if cancelled."""

from collections.abc import Iterable
from functools import reduce
from itertools import pairwise
from operator import add
from typing import NamedTuple

import msgspec
from msgspec.structs import replace

from companion.languages import hfsm, rc, wm
from companion.languages.facts import Facts, Kind, fact
from companion.languages.values import Side
from companion.planning.methods import Asking, Unanswered
from companion.planning.situation import SIDES
from companion.planning.steps import Step, approach_points, hand_steps
from velma.kinematics.frames import transform
from velma.kinematics.tasks.placing import backwards

STOP_S = 1.0  # [s] to stop an act, as cancels took (measured)
TAKE_S = 12.0  # [s] to take again what stands on a table (estimate)
AGAIN_S = 30.0  # [s] of the plan that follows one that ends with a look: a pour with its plan (estimate)
PUT_DOWN = hfsm.Step("put-everything-down")
WHATEVER = (hfsm.Outcome.SUCCEEDED, hfsm.Outcome.FAILED, hfsm.Outcome.REPLAN)


class Found(NamedTuple):
    """Result of a search: steps, the thing to be localized before the same task is planned again ("" if the steps do
    the whole task), what is told to the person when they are done, and the outcome if the thing is not localized.
    """

    steps: list[Step]
    sought: str
    told: Facts
    otherwise: hfsm.Outcome = hfsm.Outcome.REPLAN


def plan(request: str, task: str, found: Found, queries: int, held: dict[Side, rc.Release]) -> hfsm.HierarchicalPlan:
    """Return the plan of these steps in order; `held`: the commands that put down what the hands hold at the start."""
    steps, sought, told, otherwise = found
    holding = dict(held)
    states: list[hfsm.State] = []
    names = _names(steps)
    in_hand: list[dict[Side, str]] = []
    for number, (name, step) in enumerate(zip(names, steps, strict=True), start=1):
        _note_held(holding, step)
        in_hand.append({side: release.object for side, release in holding.items()})
        states.append(_machine(request, number, name, step, _safe(request, number, holding)))
        _note_released(holding, step)
    if sought:
        states.append(_localized(sought, otherwise))
        states.append(hfsm.EndState("replan", hfsm.Outcome.REPLAN, (fact(Kind.LOCALIZED, sought),)))
    if not states or told:
        name = "nothing to do" if not states else "tell"
        states.append(hfsm.EndState(name, hfsm.Outcome.SUCCEEDED, told or (fact(Kind.SO_ALREADY),)))
    chained = tuple(_then(state, following.name) for state, following in pairwise(states))
    root = hfsm.Machine(
        name=task, initial=states[0].name, states=(*chained, states[-1]), safe=_safe(request, 0, holding)
    )
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
    """Return a name for each step, none twice, since arcs lead to names: "home right", "home right 2"."""
    names: list[str] = []
    for step in steps:
        times = sum(step.step == other.step for other in steps[: len(names)]) + 1
        name = _name(step.step)
        names.append(name if times == 1 else f"{name} {times}")
    return names


def _name(step: hfsm.Step) -> str:
    """Return a name that an operator knows the step by: take jar_1, home left."""
    return " ".join(filter(None, (step.does.replace("-", " "), *step.things, step.side)))


def schedule(
    names: list[str], steps: list[Step], in_hand: list[dict[Side, str]], *, again: bool
) -> tuple[hfsm.ScheduleParameters, ...]:
    """Return the schedule parameters at each step; `in_hand`: what is held in it; `again`: another plan follows.

    What is held is put down when the task is left, and taken again when it goes on: that takes as long as taking it
    does, or TAKE_S where it was held before.
    """
    taking = {c.object: step.duration for step in steps for c in step.commands if isinstance(c, rc.Grasp)}
    found, rest = [], AGAIN_S if again else 0.0
    for name, step, held in zip(reversed(names), reversed(steps), reversed(in_hand), strict=True):
        rest += step.duration
        resume = _added(taking.get(thing, TAKE_S) for thing in held.values())
        found.append(hfsm.ScheduleParameters(name, rest, STOP_S + hfsm.PUT_DOWN_S * len(held), resume))
    return tuple(reversed(found))


def _added(durations: Iterable[float]) -> float:
    """Return the sum [s]; of none the integer 0, as plans that were recorded have it."""
    return reduce(add, durations, 0)


def _then(state: hfsm.State, following: str, on: tuple[hfsm.Outcome, ...] = (hfsm.Outcome.SUCCEEDED,)) -> hfsm.State:
    if isinstance(state, hfsm.EndState):
        return state
    return msgspec.structs.replace(state, arcs=tuple(hfsm.Arc(outcome, following) for outcome in on))


def _machine(request: str, number: int, name: str, step: Step, safe: hfsm.Machine | None) -> hfsm.Machine:
    """Return one step as a machine; its states are the commands, each with its key."""
    leaves: list[hfsm.State] = [
        hfsm.ActState(_verb(command), msgspec.structs.replace(command, key=f"{request}/{number}.{index}"))
        for index, command in enumerate(step.commands, start=1)
    ]
    chained = tuple(_then(state, following.name) for state, following in pairwise(leaves))
    otherwise = _instead(request, number, step)
    last = _then(leaves[-1], otherwise[0].name, (hfsm.Outcome.FAILED,)) if otherwise else leaves[-1]
    states = (*chained, last, *otherwise)
    return hfsm.Machine(name=name, initial=leaves[0].name, states=states, safe=safe, step=step.step)


def _instead(request: str, number: int, step: Step) -> tuple[hfsm.State, ...]:
    """Return the states of what is done instead where the last command fails, with the failure at their end."""
    if not step.instead:
        return ()
    leaves: list[hfsm.State] = [
        hfsm.ActState(f"{_verb(one)} instead {index}", replace(one, key=f"{request}/{number}.instead{index}"))
        for index, one in enumerate(step.instead, start=1)
    ]
    leaves.append(hfsm.EndState("failed", hfsm.Outcome.FAILED, step.why))
    return (*(_then(state, following.name) for state, following in pairwise(leaves)), leaves[-1])


def _verb(command: rc.Command) -> str:
    """Return the class of a command in small letters with hyphens: move-joint, grasp, pour."""
    name = type(command).__name__
    return "".join(f"-{c.lower()}" if c.isupper() else c for c in name).lstrip("-")


def _safe(request: str, number: int, holding: dict[Side, rc.Release]) -> hfsm.Machine | None:
    """Return the machine that puts down all that may be held, last taken first; an empty hand's release does nothing.

    Arms go home when all stands. It goes on if an act fails: what could not be put down for the other arm is put down
    when ta tries all of it again, with the arms at home.
    """
    if not holding:
        return None
    releases: list[hfsm.State] = []
    homes: list[hfsm.State] = []
    for index, (side, release) in enumerate(reversed(holding.items()), start=1):
        key = f"{request}/{number}.safe{index}"
        releases.append(hfsm.ActState(f"put down {release.object}", msgspec.structs.replace(release, key=key)))
        homes.append(hfsm.ActState(f"home {side}", rc.Home(key=f"{key}.home", side=side)))
    leaves = [*releases, *homes]
    chained = tuple(_then(state, following.name, WHATEVER) for state, following in pairwise(leaves))
    return hfsm.Machine(name=_name(PUT_DOWN), initial=leaves[0].name, states=(*chained, leaves[-1]), step=PUT_DOWN)


def _note_held(holding: dict[Side, rc.Release], step: Step) -> None:
    for command in step.commands:
        if isinstance(command, rc.Grasp):
            retreat = approach_points(backwards([(transform(p.at), p.fingers) for p in command.approach]))
            holding[command.side] = rc.Release("", command.side, command.object, "", None, retreat)


def _note_released(holding: dict[Side, rc.Release], step: Step) -> None:
    for change in step.changes:
        if isinstance(change, wm.Released):
            holding.pop(change.side, None)


def _localized(name: str, otherwise: hfsm.Outcome) -> hfsm.AskState:
    """Return the state that asks km whether the thing has been seen where it stands."""
    query = wm.Holds(relation=wm.Relation.HAS_EXACT_POSE, subject=name)
    return hfsm.AskState(f"localize {name}", query, otherwise=otherwise)


# --- what the hands hold when the plan begins -------------------------------------------------------------------------


def held_at(asking: Asking, state: str) -> dict[Side, rc.Release]:
    """Return a release for each hand that holds something in `state`; ex chooses the place."""
    found = {}
    for side in SIDES:
        try:
            held = asking(wm.GraspAtSide(state=state, side=side), wm.GraspOf)
            if held.object:
                found[side] = _release(asking, state, side, held)
        except Unanswered:
            continue  # nothing is known of this hand
    return found


def _release(asking: Asking, state: str, side: Side, held: wm.GraspOf) -> rc.Release:
    query = wm.GraspDefinition(state=state, object=held.object, grasp=held.grasp)
    retreat = approach_points(backwards(hand_steps(asking(query, wm.Grasps).grasps[0])))
    return rc.Release("", side, held.object, "", None, retreat)
