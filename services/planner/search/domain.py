"""The planning domain as a hierarchical task network, run by GTPyhop's depth-first search with backtracking.

Tasks and methods follow the published domain of the same group (proghtn-backstream@019fd34: pour, pourAt, takeSd,
place, lookAt), with the source taken first, as in the paper's plan #1. A state of the search is the id of a
hypothetical state at km and the steps so far; all facts are asked. What was put down is known only as predicted, so
pouring into it needs a look and a new plan: that is the paper's Replan between plan #1 and plan #2.
"""

import os
from collections.abc import Callable
from contextlib import redirect_stdout
from io import StringIO
from typing import Any

from companion.languages import wm
from companion.languages.values import Side
from services.planner.search.asking import Unanswered
from services.planner.search.looking import look_around
from services.planner.search.pouring import look, pour
from services.planner.search.putting import home, place
from services.planner.search.steps import Geometry, Step
from services.planner.search.taking import carry, take

os.environ.setdefault("GTPYHOP_QUIET", "true")  # it greets on standard output when imported
import gtpyhop

OTHER = {Side.LEFT: Side.RIGHT, Side.RIGHT: Side.LEFT}
PREFERRED = (Side.LEFT, Side.RIGHT)  # the paper takes the jar with the left hand


class _State(gtpyhop.State):  # type: ignore[misc]
    """km's state id and the steps that led to it. Copying is cheap: nothing inside changes."""

    def copy(self, new_name: str | None = None) -> "_State":
        return _State(new_name or self.__name__, km=self.km, steps=self.steps, outcome=self.outcome)


class Search:
    """One search: the domain bound to the geometry of one request."""

    def __init__(self, geometry: Geometry) -> None:
        self.geometry, self.ask = geometry, geometry.ask
        self.domain = gtpyhop.Domain("robot_companion")

    def run(self, todo: list[tuple[Any, ...]], state: str) -> tuple[list[Step], str] | None:
        """Steps and how the plan ends ("succeeded", "replan"); None where there is no plan."""
        self._declare()
        options = {"strategy": "recursive_dfs", "structured_logging": False}
        with redirect_stdout(StringIO()), gtpyhop.PlannerSession(domain=self.domain, **options) as session:
            found = session.find_plan(_State("start", km=state, steps=(), outcome="succeeded"), todo)
        if found.error and found.error.startswith("Planning error"):
            raise RuntimeError(found.error)
        if not found.success:
            return None
        return list(self._last.steps), self._last.outcome

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
            self._end(),
        )
        gtpyhop.declare_task_methods("pour", self.pour_known, self.pour_held, *self._both_ways())
        gtpyhop.declare_task_methods("take", self.take_nothing, *(self._take_with(s) for s in PREFERRED))
        gtpyhop.declare_task_methods("put_down", self.put_down)
        gtpyhop.declare_task_methods("localize", self.localize)
        gtpyhop.declare_task_methods("look_around", self.look_around)

    # --- actions ------------------------------------------------------------------------------------------------

    def _action(self, name: str, compute: Callable[..., Step | None]) -> Callable[..., Any]:
        def action(state: _State, *arguments: str) -> _State | bool:
            try:
                step = compute(state, *arguments)
            except Unanswered as unanswered:
                self.geometry.failed(unanswered.reason)
                return False
            if step is None:
                return False
            state.km = self.ask.suppose(state.km, step.changes)
            state.steps = (*state.steps, step)
            self._last = state
            return state

        action.__name__ = name
        return action

    def _end(self) -> Callable[..., Any]:
        def a_replan(state: _State) -> _State:
            state.outcome = "replan"
            self._last = state
            return state

        return a_replan

    # --- facts --------------------------------------------------------------------------------------------------

    def _true(self, state: _State, relation: str, subject: str, value: str = "") -> bool:
        query = wm.Holds(state=state.km, relation=relation, subject=subject, value=value)
        return self.ask(query, wm.Truth).value

    def _holder(self, state: _State, name: str) -> Side | None:
        return self.ask(wm.CurrentGrasp(state=state.km, object=name), wm.GraspOf).side

    def _inside(self, state: _State, name: str) -> bool:
        on = self.ask(wm.ObjectPose(state=state.km, object=name), wm.PoseOf).on
        return bool(on) and self._true(state, "isIn", name, on)

    # --- methods ------------------------------------------------------------------------------------------------

    def pour_known(self, state: _State, source: str, destination: str) -> list[Any] | bool:
        """The destination stands where it was seen, in the open: take the source and tilt it."""
        if self._holder(state, destination) or self._inside(state, destination):
            return False
        if not self._true(state, "hasExactPose", destination):
            return False
        side = self._holder(state, source)
        if side is not None:
            return [("a_pour", source, destination, str(side))]
        return [("take", source, "left"), ("a_pour", source, destination, "left")]

    def pour_held(self, state: _State, source: str, destination: str) -> list[Any] | bool:
        """The destination is in a hand: put it down, look where it is, plan again."""
        side = self._holder(state, destination)
        if side is None:
            return False
        return [("put_down", destination), ("localize", destination)]

    def _both_ways(self) -> list[Callable[..., Any]]:
        return [self._take_both(side) for side in PREFERRED]

    def _take_both(self, first: Side) -> Callable[..., Any]:
        def pour_taking_both(state: _State, source: str, destination: str) -> list[Any] | bool:
            """Both out of their places: the source with one hand, the destination with the other, then put it down."""
            if self._holder(state, destination) or not self._inside(state, destination):
                return False
            holder = self._holder(state, source)
            if holder not in (None, first):
                return False
            return [
                ("take", source, str(first)),
                ("a_carry", str(first)),
                ("take", destination, str(OTHER[first])),
                ("put_down", destination),
                ("localize", destination),
            ]

        pour_taking_both.__name__ = f"pour_taking_both_{first}"
        return pour_taking_both

    def take_nothing(self, state: _State, name: str, side: str) -> list[Any] | bool:
        """It is held already."""
        return [] if self._holder(state, name) == (side or self._holder(state, name)) is not None else False

    def _take_with(self, hand: Side) -> Callable[..., Any]:
        def take_with(state: _State, name: str, side: str) -> list[Any] | bool:
            if side and side != hand:
                return False
            if self.ask(wm.GraspAtSide(state=state.km, side=hand), wm.GraspOf).object:
                return False
            return [("a_take", name, str(hand))]

        take_with.__name__ = f"take_with_{hand}"
        return take_with

    def put_down(self, state: _State, name: str) -> list[Any] | bool:
        """Put it down and bring the hand home."""
        side = self._holder(state, name)
        return False if side is None else [("a_place", str(side)), ("a_home", str(side))]

    def look_around(self, state: _State) -> list[Any]:
        """It needs nothing, so it can always be done."""
        return [("a_look_around",)]

    def localize(self, state: _State, name: str) -> list[Any] | bool:
        """Look where it is; what follows needs a new plan."""
        return [("a_look", name), ("a_replan",)]
