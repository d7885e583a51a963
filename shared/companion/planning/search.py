"""The search as one function: from a task network, and a function that asks km, to a plan or the
reason for none.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from functools import cache
from io import StringIO
from typing import Any, TypeVar

from msgspec.structs import replace

from companion.languages import hfsm, wm
from companion.languages.cmd import BACK
from companion.languages.facts import Fact, Kind, fact, fitting
from companion.languages.hfsm import Rejected
from companion.languages.values import Side
from companion.planning import assembling
from companion.planning.assembling import Found
from companion.planning.methods import Asking, Known, StateFacts, Subtasks, Unanswered, away
from companion.planning.registry import Argument, Each, Method, Plan, rows, tasks
from companion.planning.steps import Geometry, Step, confirm, home, look, look_for
from velma.kinematics.robot import Robot

os.environ.setdefault("GTPYHOP_QUIET", "true")  # else it prints a greeting when imported
import gtpyhop

# --- Methods and steps that belong to no task: what others do first, in between, or in the end ----


def localize(known: Known, state: str, name: str) -> Subtasks | None:
    """Look at it; the rest needs a new plan."""
    return [("a_look", name), ("a_replan", name)]


def after_arms_home(known: Known, state: str, task: str, *arguments: str) -> Subtasks | None:
    """Bring empty arms home, then do the task: after an interrupted act one may be in the way, in a
    cabinet say.
    """
    sides = away(known, state)
    if not sides:
        return known.unfit(fact(Kind.ARMS_HOME))
    return [*(("a_home", side) for side in sides), (task, *arguments)]


COMMON = Plan(
    methods={"localize": (localize,)},
    around={"after_arms_home": after_arms_home},
    actions={"a_home": home, "a_look": look, "a_confirm": confirm},
)


# --- The search -----------------------------------------------------------------------------------


# of a search, the first ones; bytes of a reason: 4 kB hold them (estimates)
MOST_REJECTED, LARGEST_WHY = 24, 100
MOST_STEPS = 200
"""Steps that a search tries, each of which counts its own iterations. Estimate: the tests' searches
try 45 at most.
"""
V = TypeVar("V")


def merged(tables: list[dict[str, V]]) -> dict[str, V]:
    """All rows of some tables. Raise ValueError for a name in two of them."""
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
        return _State(
            new_name or self.__name__,
            km=self.km,
            steps=self.steps,
            sought=self.sought,
            told=self.told,
        )


class Search:
    """One search: the domain with the geometry of one request."""

    def __init__(self, geometry: Geometry) -> None:
        self.geometry = geometry
        self.domain = gtpyhop.Domain("robot_companion")
        self._rejected: dict[Rejected, None] = {}
        self._end: _State | None = None
        self._tried = 0

    def run(self, todo: Subtasks, state: str) -> Found | None:
        """What does these tasks in this state at km; None for no plan."""
        try:
            gtpyhop.set_current_domain(self.domain)
            gtpyhop.declare_actions(self.a_replan, self.a_tell, self.a_some_done, self.a_end)
            gtpyhop.declare_actions(
                *(self._action(name, compute) for name, compute in ACTIONS.items())
            )
            gtpyhop.declare_actions(
                *(self._condition(name, holds) for name, holds in CONDITIONS.items())
            )
            for task, methods in METHODS.items():
                gtpyhop.declare_task_methods(
                    task, *(method for one in methods for method in self._methods(task, one))
                )
            start = _State("start", km=state, steps=(), sought="", told=())
            options = {"strategy": "recursive_dfs", "structured_logging": False}
            with (
                redirect_stdout(StringIO()),
                gtpyhop.PlannerSession(domain=self.domain, **options) as session,
            ):
                found = session.find_plan(start, [*todo, ("a_end",)])
        finally:
            # It would keep each domain, and all that its methods know.
            gtpyhop.main.current_domain = None
            gtpyhop.main._domains.remove(self.domain)
        if self._tried > MOST_STEPS:
            self.geometry.failed(fact(Kind.SEARCH_TOO_LONG, MOST_STEPS))
            return None
        if found.error and found.error.startswith("Planning error"):
            raise RuntimeError(found.error)
        if not found.success or self._end is None:
            return None
        return Found(list(self._end.steps), self._end.sought, self._end.told)

    @property
    def rejected(self) -> tuple[Rejected, ...]:
        """Methods that were tried and rejected, in this order."""
        return tuple(self._rejected)

    # --- how methods and actions are bound to GTPyhop ---------------------------------------------

    def _methods(
        self, task: str, declared: Method | Each | str
    ) -> Iterator[Callable[..., Subtasks | None]]:
        """Yield the methods that one entry of a row stands for, with their names as they are
        rejected by.
        """
        if isinstance(declared, str):
            for _, method, values in _each(AROUND[declared]):
                yield self._answered(method.__name__, method, *values, task)
        else:
            for name, method, values in _each(declared):
                yield self._answered(name, method, *values)

    def _answered(self, name: str, method: Method, *first: Any) -> Callable[..., Subtasks | None]:
        """The method with its first arguments, not applicable if km does not know what it asks."""

        def answered(state: _State, *arguments: str) -> Subtasks | None:
            known = self.geometry
            known.not_now, failed = (), len(known.why)
            try:
                found = method(known, state.km, *first, *arguments)
            except Unanswered as unanswered:
                known.failed(*unanswered.why)
                found = None
            if found is None and (
                why := known.why[-1] if len(known.why) > failed else known.not_now
            ):
                self._reject(name, arguments, why)
            return found

        answered.__name__ = name
        return answered

    def _action(
        self, name: str, compute: Callable[..., Step | None]
    ) -> Callable[..., _State | bool]:
        """The action that appends a step and has km make its changes; not applicable if there is no
        step.
        """

        def appended(state: _State, *arguments: str) -> bool:
            step = compute(self.geometry, state.km, *arguments)
            if step is not None:
                state.km = self.geometry.ask.suppose(state.km, step.changes)
                state.steps = (*state.steps, step)
            return step is not None

        return self._attempt(name, appended)

    def _condition(
        self, name: str, holds: Callable[..., bool | None]
    ) -> Callable[..., _State | bool]:
        """The action that only tells whether the search goes on."""
        return self._attempt(
            name, lambda state, *arguments: holds(self.geometry, state.km, *arguments)
        )

    def _attempt(self, name: str, done: Callable[..., bool | None]) -> Callable[..., _State | bool]:
        """What counts as one tried step; the reason is noted where it is not applicable, or km does
        not know.
        """

        def action(state: _State, *arguments: str) -> _State | bool:
            known = self.geometry
            known.not_now = ()
            try:
                self._tried += 1
                if self._tried > MOST_STEPS:  # GTPyhop takes it for the end of the search
                    raise RuntimeError("too many tried steps")
                if done(state, *arguments):
                    return state
            except Unanswered as unanswered:
                known.failed(*unanswered.why)
            self._reject(name.removeprefix("a_"), arguments, known.not_now or known.why[-1])
            return False

        action.__name__ = name
        return action

    def _reject(self, method: str, arguments: tuple[str, ...], why: tuple[Fact, ...]) -> None:
        """Note what was tried and left; the same thing for the same reason once."""
        if len(self._rejected) < MOST_REJECTED:
            of = tuple(filter(None, arguments))
            self._rejected.setdefault(Rejected(method, of, fitting(why, LARGEST_WHY)))

    # --- actions without a step -------------------------------------------------------------------

    def a_replan(self, state: _State, name: str) -> _State:
        """End the plan with the question whether the thing is localized: the rest is planned
        again.
        """
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


# --- The search as one function: from a task network, and a function that asks km, to a plan or the
# reason for none


REFUSED = merged([row.refused for row in ROWS])
# the newest ones that are told, and their bytes: a report has room for no more (estimates)
REASONS, LARGEST = 3, 500


class NotSeen(Unanswered):
    """km knows of no thing for a word."""

    def __init__(self, word: str, why: Unanswered) -> None:
        self.word = word
        super().__init__(why.query, why.why)


class NotATask(Exception):
    """The network names a task that the domain does not have."""

    def __init__(self, why: Fact) -> None:
        self.why = (why,)
        super().__init__(why.kind)


def search(
    network: hfsm.GroundTaskNetwork, ask: Callable[[wm.AnyQuery], wm.AnyAnswer], seed: int
) -> hfsm.HierarchicalPlan | hfsm.NoPlan:
    """A plan, or NoPlan. All facts come through `ask`. Deterministic for a seed: limits count
    iterations.

    Where a thing has not been seen, it is a plan to look for it, and to plan again.
    """
    asking = Asking(ask, network.id)
    geometry = Geometry(asking, _robot(), seed)
    try:
        todo = [_ground(asking, task) for task in network.tasks]
        start = asking.suppose("", ())
        searching = Search(geometry)
        found = searching.run(todo, start)
    except NotSeen as unseen:
        found = _revealed(geometry, unseen.word)
        found = found or assembling.Found(
            [look_for(geometry, "", unseen.word)], unseen.word, (), hfsm.Outcome.FAILED
        )
        name = f"look for {unseen.word}"
        return assembling.plan(
            network.id, name, found, asking.queries, assembling.held_at(asking, "")
        )
    except (Unanswered, NotATask) as refused:
        return hfsm.NoPlan(network.id, refused.why)
    if found is None:
        return hfsm.NoPlan(network.id, _newest(geometry.why), rejected=searching.rejected)
    held = assembling.held_at(asking, start)
    name = "; ".join(" ".join(task) for task in todo)
    plan = assembling.plan(network.id, name, found, asking.queries, held)
    return replace(plan, rejected=searching.rejected)


def _revealed(geometry: Geometry, word: str) -> assembling.Found | None:
    """The first plan that may bring a thing into sight that was never seen; None where there is
    none.

    Whether it is seen then or not, the task is planned again.
    """
    try:
        start = geometry.ask.suppose("", ())
        for todo in (todo for row in ROWS if row.reveals for todo in row.reveals(geometry, start)):
            if found := Search(geometry).run(todo, start):
                return found._replace(sought=word, otherwise=hfsm.Outcome.REPLAN)
    except Unanswered:
        pass  # with what is not known nothing is done
    return None


@cache
def _robot() -> Robot:
    """The robot, read once in a process: that takes 12 ms, with the shapes for its collision
    world.
    """
    return Robot()


def _ground(asking: Asking, task: hfsm.Task) -> tuple[str, ...]:
    """The task with the ids of km in place of words for things: "jar" -> "jar_1"."""
    kinds = tasks().get(task.name)
    if kinds is None or len(kinds) != len(task.arguments):
        raise NotATask(fact(Kind.NOT_A_TASK, task.name))
    named = zip(kinds, task.arguments, strict=True)
    arguments = tuple(_WORDS[kind](asking, word) for kind, word in named)
    if task.name in REFUSED and (why := REFUSED[task.name](*arguments)):
        raise NotATask(why)
    return (task.name, *arguments)


def _first_object(asking: Asking, word: str) -> str:
    """The first thing that km knows by this id or kind; "" stays. Raise NotSeen with km's
    reason.
    """
    if not word:
        return word
    things = asking(wm.ListObjects(), wm.Objects).objects
    for thing in things:
        if word in (thing.id, thing.kind.lower()):
            return thing.id
    try:
        return asking(wm.ObjectPose(object=word), wm.PoseOf).object
    except Unanswered as why:
        raise NotSeen(word, why) from why


def _side(asking: Asking, word: str) -> str:
    """A word for a hand, "" for any."""
    if word not in ("", *Side):
        raise NotATask(fact(Kind.NOT_A_HAND, word))
    return word


def _place(asking: Asking, word: str) -> str:
    """A word for places that km knows; the steps choose one of them."""
    facts = StateFacts(asking)
    if word != BACK and not facts.places("", word):
        seen = sorted(facts.places("", "furniture"))
        others = (fact(Kind.SEEN, *seen),) if seen else ()
        raise Unanswered(wm.StaticObjects(), (fact(Kind.NOT_A_PLACE, word), *others))
    return word


_WORDS: dict[Argument, Callable[[Asking, str], str]] = {
    Argument.THING: _first_object,
    Argument.SIDE: _side,
    Argument.PLACE: _place,
}


def _newest(why: list[tuple[Fact, ...]]) -> tuple[Fact, ...]:
    """The different reasons of the failed attempts, last first."""
    different = list(dict.fromkeys(reversed(why)))[:REASONS]
    return fitting(tuple(one for some in different for one in some), LARGEST) or (
        fact(Kind.NO_METHOD),
    )
