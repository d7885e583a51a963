"""The search: GTPyhop's depth-first search with backtracking, over the domain that all tasks declare together.

A state of the search is the id of a hypothetical state at km and the steps so far. If km does not know a fact that a
method or step needs, the branch ends. The pose of what was put down is only predicted, so pouring into it needs a look
and a new plan: the Replan between plan #1 and plan #2 of the paper.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from io import StringIO
from typing import Any, TypeVar

from companion.languages.facts import Fact, Kind, fact, fitting
from companion.languages.hfsm import Rejected
from companion.planning.asking import Unanswered
from companion.planning.assembling import Found
from companion.planning.homing import home
from companion.planning.looking import confirm, look
from companion.planning.methods import Known, Subtasks, away
from companion.planning.registry import Each, Method, Plan, rows
from companion.planning.steps import Geometry, Step

os.environ.setdefault("GTPYHOP_QUIET", "true")  # else it prints a greeting when imported
import gtpyhop

# --- Methods and steps that belong to no task: what others do first, in between, or in the end -----------------------


def localize(known: Known, km: str, name: str) -> Subtasks | None:
    """Look at it; the rest needs a new plan."""
    return [("a_look", name), ("a_replan", name)]


def after_arms_home(known: Known, km: str, task: str, *arguments: str) -> Subtasks | None:
    """Bring empty arms home, then do the task: after an interrupted act one may be in the way, in a cabinet say."""
    sides = away(known, km)
    if not sides:
        return known.unfit(fact(Kind.ARMS_HOME))
    return [*(("a_home", side) for side in sides), (task, *arguments)]


COMMON = Plan(
    methods={"localize": (localize,)},
    around={"after_arms_home": after_arms_home},
    actions={"a_home": home, "a_look": look, "a_confirm": confirm},
)


# --- The search -------------------------------------------------------------------------------------------------------


MOST_REJECTED, LARGEST_WHY = 24, 100  # of a search, the first ones; bytes of a reason: 4 kB hold them (estimates)
MOST_STEPS = 200
"""Steps that a search tries, each of which counts its own iterations. Estimate: the tests' searches try 45 at most."""
V = TypeVar("V")


def merged(tables: list[dict[str, V]]) -> dict[str, V]:
    """Return all rows of some tables. Raise ValueError for a name in two of them."""
    names = [name for table in tables for name in table]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise ValueError(f"declared by two tasks: {', '.join(twice)}")
    return {name: row for table in tables for name, row in table.items()}


ROWS = (COMMON, *rows())
METHODS = merged([row.methods for row in ROWS])
AROUND = merged([row.around for row in ROWS])
ACTIONS = merged([row.actions for row in ROWS])
CONDITIONS = merged([row.conditions for row in ROWS])


class _State(gtpyhop.State):  # type: ignore[misc]
    """State id at km, steps that led to it, thing to be localized, what is told in the end.

    All parts are immutable, so a copy is cheap."""

    def copy(self, new_name: str | None = None) -> "_State":
        return _State(new_name or self.__name__, km=self.km, steps=self.steps, sought=self.sought, told=self.told)


class Search:
    """One search: the domain with the geometry of one request."""

    def __init__(self, geometry: Geometry) -> None:
        self.geometry = geometry
        self.domain = gtpyhop.Domain("robot_companion")
        self._rejected: dict[Rejected, None] = {}
        self._end: _State | None = None
        self._tried = 0

    def run(self, todo: Subtasks, state: str) -> Found | None:
        """Return what does these tasks in this state at km; None for no plan."""
        try:
            self._declare()
            return self._planned(todo, state)
        finally:
            # It would keep each domain, and all that its methods know.
            gtpyhop.main.current_domain = None
            gtpyhop.main._domains.remove(self.domain)

    @property
    def rejected(self) -> tuple[Rejected, ...]:
        """Methods that were tried and rejected, in this order."""
        return tuple(self._rejected)

    def _planned(self, todo: Subtasks, state: str) -> Found | None:
        start = _State("start", km=state, steps=(), sought="", told=())
        options = {"strategy": "recursive_dfs", "structured_logging": False}
        with redirect_stdout(StringIO()), gtpyhop.PlannerSession(domain=self.domain, **options) as session:
            found = session.find_plan(start, [*todo, ("a_end",)])
        if self._tried > MOST_STEPS:
            self.geometry.failed(fact(Kind.SEARCH_TOO_LONG, MOST_STEPS))
            return None
        if found.error and found.error.startswith("Planning error"):
            raise RuntimeError(found.error)
        if not found.success or self._end is None:
            return None
        return Found(list(self._end.steps), self._end.sought, self._end.told)

    def _declare(self) -> None:
        """Declare to GTPyhop what the tasks declare."""
        gtpyhop.set_current_domain(self.domain)
        gtpyhop.declare_actions(self.a_replan, self.a_tell, self.a_some_done, self.a_end)
        gtpyhop.declare_actions(*(self._action(name, compute) for name, compute in ACTIONS.items()))
        gtpyhop.declare_actions(*(self._condition(name, holds) for name, holds in CONDITIONS.items()))
        for task, methods in METHODS.items():
            gtpyhop.declare_task_methods(task, *(method for one in methods for method in self._methods(task, one)))

    # --- how methods and actions are bound to GTPyhop -----------------------------------------------------------------

    def _methods(self, task: str, declared: Method | Each | str) -> Iterator[Callable[..., Subtasks | None]]:
        """Yield the methods that one entry of a row stands for, with their names as they are rejected by."""
        if isinstance(declared, str):
            for _, method, values in _each(AROUND[declared]):
                yield self._answered(method.__name__, method, *values, task)
        else:
            for name, method, values in _each(declared):
                yield self._answered(name, method, *values)

    def _answered(self, name: str, method: Method, *first: Any) -> Callable[..., Subtasks | None]:
        """Return the method with its first arguments, not applicable if km does not know what it asks."""

        def answered(state: _State, *arguments: str) -> Subtasks | None:
            known = self.geometry
            known.not_now, failed = (), len(known.why)
            try:
                found = method(known, state.km, *first, *arguments)
            except Unanswered as unanswered:
                known.failed(*unanswered.why)
                found = None
            if found is None and (why := known.why[-1] if len(known.why) > failed else known.not_now):
                self._reject(name, arguments, why)
            return found

        answered.__name__ = name
        return answered

    def _action(self, name: str, compute: Callable[..., Step | None]) -> Callable[..., _State | bool]:
        """Return the action that appends a step and has km make its changes; not applicable if there is no step."""

        def appended(state: _State, *arguments: str) -> bool:
            step = compute(self.geometry, state.km, *arguments)
            if step is not None:
                state.km = self.geometry.ask.suppose(state.km, step.changes)
                state.steps = (*state.steps, step)
            return step is not None

        return self._attempt(name, appended)

    def _condition(self, name: str, holds: Callable[..., bool | None]) -> Callable[..., _State | bool]:
        """Return the action that only tells whether the search goes on."""
        return self._attempt(name, lambda state, *arguments: holds(self.geometry, state.km, *arguments))

    def _attempt(self, name: str, done: Callable[..., bool | None]) -> Callable[..., _State | bool]:
        """Return what counts as one tried step; the reason is noted where it is not applicable, or km does not know."""

        def action(state: _State, *arguments: str) -> _State | bool:
            known = self.geometry
            known.not_now = ()
            try:
                self._count()
                if done(state, *arguments):
                    return state
            except Unanswered as unanswered:
                known.failed(*unanswered.why)
            self._reject(name.removeprefix("a_"), arguments, known.not_now or known.why[-1])
            return False

        action.__name__ = name
        return action

    def _count(self) -> None:
        """Count a step that is tried. Raise where it is one too many: GTPyhop takes it for the end of the search."""
        self._tried += 1
        if self._tried > MOST_STEPS:
            raise RuntimeError("too many tried steps")

    def _reject(self, method: str, arguments: tuple[str, ...], why: tuple[Fact, ...]) -> None:
        """Note what was tried and left; the same thing for the same reason once."""
        if len(self._rejected) < MOST_REJECTED:
            self._rejected.setdefault(Rejected(method, tuple(filter(None, arguments)), fitting(why, LARGEST_WHY)))

    # --- actions without a step ---------------------------------------------------------------------------------------

    def a_replan(self, state: _State, name: str) -> _State:
        """End the plan with the question whether the thing is localized: the rest is planned again."""
        state.sought = name
        return state

    def a_tell(self, state: _State, told: Fact) -> _State:
        """Note what the person is told at the end."""
        state.told = (*state.told, told)
        return state

    def a_some_done(self, state: _State) -> _State | bool:
        """Return False, not applicable, if nothing was done at all: then the reasons are told."""
        return state if state.steps else False

    def a_end(self, state: _State) -> _State:
        """Keep the state at the end of every plan."""
        self._end = state
        return state


def _each(declared: Method | Each) -> Iterator[tuple[str, Method, tuple[Any, ...]]]:
    """Yield name, method and first arguments of an entry: for each of its values, or once."""
    if not isinstance(declared, Each):
        yield declared.__name__, declared, ()
        return
    for value in declared.values:
        yield f"{declared.method.__name__}_{value}", declared.method, (value,)
