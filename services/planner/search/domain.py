"""The planning domain as a hierarchical task network, run by GTPyhop's depth-first search with backtracking.

Tasks and methods follow the published domain of the same group (proghtn-backstream@019fd34: pour, pourAt, takeSd,
place, lookAt), with the source taken first, as in the paper's plan #1. A state of the search is the id of a
hypothetical state at km and the steps so far; all facts are asked, and where km does not know one, the branch ends.
What was put down is known only as predicted, so pouring into it needs a look and a new plan: that is the paper's
Replan between plan #1 and plan #2.
"""

import os
from collections.abc import Callable
from contextlib import redirect_stdout
from functools import wraps
from io import StringIO
from typing import Any

from companion.languages.values import Side
from services.planner.search.asking import Unanswered
from services.planner.search.facts import Facts
from services.planner.search.looking import look, look_around
from services.planner.search.pouring import pour
from services.planner.search.putting import home, place
from services.planner.search.steps import Geometry, Step
from services.planner.search.taking import carry, take

os.environ.setdefault("GTPYHOP_QUIET", "true")  # it greets on standard output when imported
import gtpyhop

TASKS = {"pour": 2, "take": 2, "put_down": 1, "look_around": 0}
"""Tasks that can be asked for, with the number of their arguments."""
OTHER = {Side.LEFT: Side.RIGHT, Side.RIGHT: Side.LEFT}
PREFERRED = (Side.LEFT, Side.RIGHT)  # the paper takes the jar with the left hand

Subtasks = list[tuple[Any, ...]]


class _State(gtpyhop.State):  # type: ignore[misc]
    """km's state id, the steps that led to it, how the plan ends. Copying is cheap: nothing inside changes."""

    def copy(self, new_name: str | None = None) -> "_State":
        return _State(new_name or self.__name__, km=self.km, steps=self.steps, outcome=self.outcome)


class Search:
    """One search: the domain bound to the geometry of one request. A method answers None where it does not apply."""

    def __init__(self, geometry: Geometry) -> None:
        self.geometry, self.facts = geometry, Facts(geometry.ask)
        self.domain = gtpyhop.Domain("robot_companion")
        self._end: _State | None = None

    def run(self, todo: Subtasks, state: str) -> tuple[list[Step], str] | None:
        """Steps and how the plan ends ("succeeded", "replan"); None where there is no plan."""
        self._declare()
        start = _State("start", km=state, steps=(), outcome="succeeded")
        options = {"strategy": "recursive_dfs", "structured_logging": False}
        with redirect_stdout(StringIO()), gtpyhop.PlannerSession(domain=self.domain, **options) as session:
            found = session.find_plan(start, [*todo, ("a_end",)])
        if found.error and found.error.startswith("Planning error"):
            raise RuntimeError(found.error)
        if not found.success or self._end is None:
            return None
        return list(self._end.steps), self._end.outcome

    def _declare(self) -> None:
        gtpyhop.set_current_domain(self.domain)
        gtpyhop.declare_actions(
            self._action("a_take", lambda s, n, side: take(self.geometry, s.km, n, Side(side))),
            self._action("a_carry", lambda s, side: carry(self.geometry, s.km, Side(side))),
            self._action("a_place", lambda s, side: place(self.geometry, s.km, Side(side))),
            self._action("a_home", lambda s, side: home(self.geometry, s.km, Side(side))),
            self._action("a_look", lambda s, n: look(self.geometry, s.km, n)),
            self._action("a_look_around", lambda s: look_around()),
            self._action("a_pour", lambda s, a, b, side: pour(self.geometry, s.km, a, b, Side(side))),
            self.a_replan,
            self.a_end,
        )
        self._methods("pour", self.pour_held, self.pour_into_held, self.pour_into_unseen)
        self._methods("pour", *(self._with(self.pour_into_standing, side) for side in PREFERRED))
        self._methods("pour", *(self._with(self.pour_taking_both, side) for side in PREFERRED))
        self._methods("take", self.take_nothing, self.take_over, *(self._with(self.take_with, s) for s in PREFERRED))
        self._methods("put_down", self.put_down)
        self._methods("localize", self.localize)
        self._methods("look_around", self.look_around)

    # --- how actions and methods are bound ----------------------------------------------------------------------------

    def _action(self, name: str, compute: Callable[..., Step | None]) -> Callable[..., _State | bool]:
        """The action that appends a step and supposes its changes; not applicable where there is no step."""

        def action(state: _State, *arguments: str) -> _State | bool:
            try:
                step = compute(state, *arguments)
                if step is None:
                    return False
                state.km = self.geometry.ask.suppose(state.km, step.changes)
            except Unanswered as unanswered:
                self.geometry.failed(unanswered.reason)
                return False
            state.steps = (*state.steps, step)
            return state

        action.__name__ = name
        return action

    def _methods(self, task: str, *methods: Callable[..., Subtasks | None]) -> None:
        gtpyhop.declare_task_methods(task, *(self._answered(method) for method in methods))

    def _answered(self, method: Callable[..., Subtasks | None]) -> Callable[..., Subtasks | None]:
        """The method, not applicable where km does not know what it asks."""

        @wraps(method)
        def answered(state: _State, *arguments: str) -> Subtasks | None:
            try:
                return method(state.km, *arguments)
            except Unanswered as unanswered:
                self.geometry.failed(unanswered.reason)
                return None

        return answered

    def _with(self, method: Callable[..., Subtasks | None], side: Side) -> Callable[..., Subtasks | None]:
        """The method with one hand, under a name of its own."""

        def sided(km: str, *arguments: str) -> Subtasks | None:
            return method(km, side, *arguments)

        sided.__name__ = f"{method.__name__}_{side}"
        return sided

    # --- actions without a step ---------------------------------------------------------------------------------------

    def a_replan(self, state: _State) -> _State:
        """What follows has to be planned anew."""
        state.outcome = "replan"
        return state

    def a_end(self, state: _State) -> _State:
        """The end of every plan: here is what was found."""
        self._end = state
        return state

    # --- methods: the state of km they are asked in, then the arguments of the task -----------------------------------

    def pour_held(self, km: str, source: str, destination: str) -> Subtasks | None:
        """The source is in a hand and the destination stands in the open, well known: tilt."""
        side = self.facts.holder(km, source)
        return [("a_pour", source, destination, side)] if side and self._open(km, destination) else None

    def pour_into_standing(self, km: str, side: Side, source: str, destination: str) -> Subtasks | None:
        """The destination stands in the open, well known: take the source and tilt it."""
        if self.facts.holder(km, source) or not self._open(km, destination):
            return None
        return [("take", source, side), ("a_pour", source, destination, side)]

    def pour_into_held(self, km: str, source: str, destination: str) -> Subtasks | None:
        """The destination is in a hand: put it down, look where it is, plan again."""
        held = self.facts.holder(km, destination) is not None
        return [("put_down", destination), ("localize", destination)] if held else None

    def pour_into_unseen(self, km: str, source: str, destination: str) -> Subtasks | None:
        """The destination was put down and not seen since: look where it is, plan again."""
        held = self.facts.holder(km, destination) is not None
        return None if held or self.facts.exact(km, destination) else [("localize", destination)]

    def pour_taking_both(self, km: str, first: Side, source: str, destination: str) -> Subtasks | None:
        """Both out of their places: the source with one hand, the destination with the other, then put it down."""
        if self.facts.holder(km, destination) or not self.facts.inside(km, destination):
            return None
        if self.facts.holder(km, source) not in (None, first):
            return None
        return [
            ("take", source, first),
            ("a_carry", first),
            ("take", destination, OTHER[first]),
            ("put_down", destination),
            ("localize", destination),
        ]

    def _open(self, km: str, name: str) -> bool:
        """Whether the thing stands where it was seen, in the open."""
        if self.facts.holder(km, name) or self.facts.inside(km, name):
            return False
        return self.facts.exact(km, name)

    def take_nothing(self, km: str, name: str, side: str) -> Subtasks | None:
        """It is held already, by the wanted hand."""
        holder = self.facts.holder(km, name)
        return [] if holder is not None and side in ("", holder) else None

    def take_over(self, km: str, name: str, side: str) -> Subtasks | None:
        """The other hand holds it: put it down, look where it is, plan again."""
        holder = self.facts.holder(km, name)
        return None if holder is None or side in ("", holder) else [("put_down", name), ("localize", name)]

    def take_with(self, km: str, hand: Side, name: str, side: str) -> Subtasks | None:
        """With an empty hand, where it is a wanted one."""
        if side not in ("", hand) or self.facts.holder(km, name):
            return None
        if held := self.facts.in_hand(km, hand):
            self.geometry.failed(f"the {hand} hand holds {held}")
            return None
        return [("a_take", name, hand)]

    def put_down(self, km: str, name: str) -> Subtasks | None:
        """Put it down and bring the hand home."""
        side = self.facts.holder(km, name)
        if side is None:
            self.geometry.failed(f"no hand holds {name}")
            return None
        return [("a_place", side), ("a_home", side)]

    def localize(self, km: str, name: str) -> Subtasks | None:
        """Look where it is; what follows needs a new plan."""
        return [("a_look", name), ("a_replan",)]

    def look_around(self, km: str) -> Subtasks | None:
        """It needs nothing, so it can always be done."""
        return [("a_look_around",)]
