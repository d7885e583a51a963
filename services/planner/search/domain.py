"""The planning domain as a hierarchical task network, run by GTPyhop's depth-first search with backtracking.

A state of the search is the id of a hypothetical state at km and the steps so far. If km does not know a fact that a
method or step needs, the branch ends. The pose of what was put down is only predicted, so pouring into it needs a look
and a new plan: the Replan between plan #1 and plan #2 of the paper.
"""

import os
from collections.abc import Callable
from contextlib import redirect_stdout
from functools import wraps
from io import StringIO

from companion.languages.facts import Fact, Kind, fact, fitting
from companion.languages.hfsm import Rejected, TaskName
from companion.languages.values import Side
from services.planner.search.asking import Unanswered
from services.planner.search.assembling import Found
from services.planner.search.facts import Facts
from services.planner.search.inserting import take_to
from services.planner.search.looking import look, look_around
from services.planner.search.methods import Methods, Subtasks
from services.planner.search.opening import open_door
from services.planner.search.pouring import pour
from services.planner.search.putting import home, offer, place
from services.planner.search.steps import Geometry, Step
from services.planner.search.taking import carry, in_the_way, take

os.environ.setdefault("GTPYHOP_QUIET", "true")  # else it prints a greeting when imported
import gtpyhop

A_THING, A_SIDE, A_PLACE = "thing", "side", "place"
TASKS: dict[str, tuple[str, ...]] = {
    TaskName.POUR: (A_THING, A_THING),
    TaskName.TAKE: (A_THING, A_SIDE),
    TaskName.BRING: (A_THING, A_SIDE),
    TaskName.SWAP_HANDS: (A_THING,),
    TaskName.PUT_DOWN: (A_THING,),
    TaskName.PUT_AT: (A_THING, A_PLACE),
    TaskName.CLEAR_TABLE: (),
    TaskName.LOOK_AROUND: (),
}
"""Tasks that can be asked for, with what their arguments are."""
MOST_REJECTED, LARGEST_WHY = 24, 100  # of a search, the first ones; bytes of a reason: 4 kB hold them (estimates)
GRASPS_TRIED = ("1", "2", "3", "4")
"""From which a thing is to be held out, or put there. Estimate: a try takes seconds."""
CLEARED = (1, 2)
"""Ranks of the things beside a wanted one that are put aside, 1 the nearest. Estimate: a try takes seconds."""
DOORS = (1, 2)
"""Ranks of the closed doors before a thing, one of which is opened first: a cabinet has two."""
MOST_STEPS = 200
"""Steps that a search tries, each of which counts its own iterations. Estimate: the tests' searches try 45 at most."""
PREFERRED = (Side.LEFT, Side.RIGHT)  # the paper takes the jar with the left hand


class _State(gtpyhop.State):  # type: ignore[misc]
    """State id at km, steps that led to it, thing to be localized, what is told in the end.

    All parts are immutable, so a copy is cheap."""

    def copy(self, new_name: str | None = None) -> "_State":
        return _State(new_name or self.__name__, km=self.km, steps=self.steps, sought=self.sought, told=self.told)


class Search:
    """One search: the domain with the geometry of one request."""

    def __init__(self, geometry: Geometry) -> None:
        self.geometry, self.methods = geometry, Methods(Facts(geometry.ask), geometry.failed)
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
        gtpyhop.set_current_domain(self.domain)
        gtpyhop.declare_actions(
            self._action("a_take", lambda s, n, side, *number: take(self.geometry, s.km, n, Side(side), *number)),
            self._action("a_carry", lambda s, side: carry(self.geometry, s.km, Side(side))),
            self._action("a_take_to", lambda s, n, side, *to: take_to(self.geometry, s.km, n, Side(side), *to)),
            self._action("a_place", lambda s, side, *where: place(self.geometry, s.km, Side(side), *where)),
            self._action("a_offer", lambda s, side: offer(self.geometry, s.km, Side(side))),
            self._action("a_home", lambda s, side: home(self.geometry, s.km, Side(side))),
            self._action("a_look", lambda s, n: look(self.geometry, s.km, n)),
            self._action("a_look_around", lambda s: look_around()),
            self._action("a_open", lambda s, n, body, side: open_door(self.geometry, s.km, n, body, Side(side))),
            self._action("a_pour", lambda s, a, b, side: pour(self.geometry, s.km, a, b, Side(side))),
            self.a_in_the_way,
            self.a_replan,
            self.a_tell,
            self.a_stays,
            self.a_some_done,
            self.a_end,
        )
        methods, both = self.methods, self._with
        for behind in (TaskName.POUR, TaskName.TAKE, TaskName.BRING, TaskName.PUT_AT):
            self._bind(behind, *(self._after_first(methods.after_opening, behind, number) for number in DOORS))
        self._bind("open_door", *both(methods.open_door_with))
        self._bind(TaskName.POUR, methods.pour_held, methods.pour_into_held, methods.pour_into_unseen)
        self._bind(TaskName.POUR, *both(methods.pour_into_standing), *both(methods.pour_taking_both))
        self._bind(TaskName.POUR, *both(methods.pour_taken_again))
        self._bind(TaskName.TAKE, methods.take_nothing, methods.take_over, *both(methods.take_with))
        self._bind(TaskName.BRING, *both(methods.bring_with))
        self._bind("hold_out", *(self._numbered(methods.hold_out_at_try, number) for number in GRASPS_TRIED))
        self._bind(TaskName.SWAP_HANDS, methods.swap_hands)
        self._bind(TaskName.PUT_DOWN, methods.put_down, *both(methods.put_down_lying_with))
        self._bind("set_down", methods.set_down)
        self._bind(TaskName.PUT_AT, methods.put_at_nothing, methods.put_at_held, *both(methods.put_at_with))
        self._bind("set_at", *(self._numbered(methods.set_at_try, number) for number in GRASPS_TRIED))
        self._bind(TaskName.CLEAR_TABLE, methods.clear_nothing, methods.clear_things)
        self._bind("clear_away", methods.clear_into_cabinet, methods.clear_not)
        self._bind("put_aside", *both(methods.put_aside_with))
        for task in (TaskName.TAKE, TaskName.BRING, TaskName.PUT_AT, "put_aside"):
            self._bind(task, *(self._after_first(methods.after_clearing, task, number) for number in CLEARED))
        for task in (TaskName.POUR, TaskName.TAKE, TaskName.PUT_DOWN, TaskName.PUT_AT, "open_door"):
            self._bind(task, self._after_arms_home(task))
        self._bind("localize", methods.localize)
        self._bind(TaskName.LOOK_AROUND, methods.look_around)

    # --- how actions and methods are bound to GTPyhop -----------------------------------------------------------------

    def _action(self, name: str, compute: Callable[..., Step | None]) -> Callable[..., _State | bool]:
        """Return the action that appends a step and has km make its changes; not applicable if there is no step."""

        def action(state: _State, *arguments: str) -> _State | bool:
            try:
                self._count()
                step = compute(state, *arguments)
                if step is not None:
                    state.km = self.geometry.ask.suppose(state.km, step.changes)
            except Unanswered as unanswered:
                self.geometry.failed(*unanswered.why)
                step = None
            if step is None:
                self._reject(name.removeprefix("a_"), arguments, self.geometry.why[-1])
                return False
            state.steps = (*state.steps, step)
            return state

        action.__name__ = name
        return action

    def _count(self) -> None:
        """Count a step that is tried. Raise where it is one too many: GTPyhop takes it for the end of the search."""
        self._tried += 1
        if self._tried > MOST_STEPS:
            raise RuntimeError("too many tried steps")

    def _bind(self, task: str, *methods: Callable[..., Subtasks | None]) -> None:
        gtpyhop.declare_task_methods(task, *(self._answered(method) for method in methods))

    def _answered(self, method: Callable[..., Subtasks | None]) -> Callable[..., Subtasks | None]:
        """Return the method, not applicable if km does not know what it asks."""

        @wraps(method)
        def answered(state: _State, *arguments: str) -> Subtasks | None:
            self.methods.unfit, failed = (), len(self.geometry.why)
            try:
                found = method(state.km, *arguments)
            except Unanswered as unanswered:
                self.geometry.failed(*unanswered.why)
                found = None
            if found is None:
                why = self.geometry.why[-1] if len(self.geometry.why) > failed else self.methods.unfit
                if why:
                    self._reject(method.__name__, arguments, why)
            return found

        return answered

    def _after_arms_home(self, task: str) -> Callable[..., Subtasks | None]:
        """Return the last method of a task: it is tried where none of the others gave a plan."""

        def after_arms_home(km: str, *arguments: str) -> Subtasks | None:
            return self.methods.after_arms_home(km, task, arguments)

        return after_arms_home

    def _after_first(
        self, method: Callable[..., Subtasks | None], task: str, number: int
    ) -> Callable[..., Subtasks | None]:
        """Return the method of a task that does something with the n-th of what is in its way first."""

        def after(km: str, *arguments: str) -> Subtasks | None:
            return method(km, number, task, arguments)

        after.__name__ = method.__name__
        return after

    def _reject(self, method: str, arguments: tuple[str, ...], why: tuple[Fact, ...]) -> None:
        """Note what was tried and left; the same thing for the same reason once."""
        if len(self._rejected) < MOST_REJECTED:
            self._rejected.setdefault(Rejected(method, tuple(filter(None, arguments)), fitting(why, LARGEST_WHY)))

    @property
    def rejected(self) -> tuple[Rejected, ...]:
        """Methods that were tried and rejected, in this order."""
        return tuple(self._rejected)

    def _with(self, method: Callable[..., Subtasks | None]) -> list[Callable[..., Subtasks | None]]:
        """Return the method for each hand, the preferred one first, each with its own name."""
        return [self._sided(method, side) for side in PREFERRED]

    def _sided(self, method: Callable[..., Subtasks | None], side: Side) -> Callable[..., Subtasks | None]:
        def sided(km: str, *arguments: str) -> Subtasks | None:
            return method(km, side, *arguments)

        sided.__name__ = f"{method.__name__}_{side}"
        return sided

    def _numbered(self, method: Callable[..., Subtasks | None], number: str) -> Callable[..., Subtasks | None]:
        def numbered(km: str, *arguments: str) -> Subtasks | None:
            return method(km, number, *arguments)

        numbered.__name__ = f"{method.__name__}_{number}"
        return numbered

    # --- actions without a step ---------------------------------------------------------------------------------------

    def a_in_the_way(self, state: _State, name: str, *others: str) -> _State | bool:
        """Return False, not applicable, if a hand reaches the thing beside the others, or not even without them."""
        why: tuple[Fact, ...] = (fact(Kind.NOT_IN_THE_WAY),)
        try:
            self._count()
            if in_the_way(self.geometry, state.km, name, others):
                return state
        except Unanswered as unanswered:
            self.geometry.failed(*(why := unanswered.why))
        self._reject("in_the_way", (name, *others), why)
        return False

    def a_replan(self, state: _State, name: str) -> _State:
        """Return the rest has to be planned again when the thing is localized."""
        state.sought = name
        return state

    def a_tell(self, state: _State, told: Fact) -> _State:
        """Note what the person is told at the end."""
        state.told = (*state.told, told)
        return state

    def a_stays(self, state: _State, name: str) -> _State:
        """Leave a thing where it is, and tell the reason that was noted last."""
        return self.a_tell(state, fact(Kind.STAYS, name, self.geometry.why[-1]))

    def a_some_done(self, state: _State) -> _State | bool:
        """Return False, not applicable, if nothing was done at all: then the reasons are told."""
        return state if state.steps else False

    def a_end(self, state: _State) -> _State:
        """Return the end of every plan: keep its state."""
        self._end = state
        return state
