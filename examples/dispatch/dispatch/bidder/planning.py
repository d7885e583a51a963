"""What a task would take, from a plan that the planner's search makes of what the robot's km knows. The bidder asks km
as a guest, and nothing of the robot has to wait for it.

The search is the planner's own, in a child process. A robot whose km does not answer has no plan: nothing is guessed.
"""

import threading
import time
from functools import partial
from queue import Empty
from typing import Any, NamedTuple

import msgspec
import zenoh
from agent_runtime.io.devices import Post
from agent_runtime.io.guests import Answer as Heard
from agent_runtime.io.inbox import OneReaderQueue
from agent_runtime.io.visiting import Visiting
from companion.design import AgentName, AnyCommand
from companion.languages import hfsm, wm
from companion.languages.facts import Facts, Kind, fact
from fipa_codec.errors import FipaError
from fipa_codec.performatives import Performative as P
from services.planner.search import Answer, Ask, Begin, Died, Found, SearchDevice, Stop

USE = "estimate"
"""The guest's use by which a robot's km is asked."""
ANSWER_S = 10.0  # until km answers the first question; estimate: it takes milliseconds
WITHIN_S = 60.0  # a plan takes seconds, on a busy machine half a minute (measured)
SEED = 1


class Plan(msgspec.Struct, frozen=True, tag=True):
    """To the device: what would this task take? `call`: the tender."""

    call: str
    task: AnyCommand


class Planned(msgspec.Struct, frozen=True, tag=True):
    """From it: this."""

    call: str
    parameters: hfsm.ScheduleParameters


class NotPlanned(msgspec.Struct, frozen=True, tag=True):
    """From it: there is no plan, and why; `log`: more for who operates it."""

    call: str
    why: Facts
    log: str = ""


class Said(NamedTuple):
    """An answer of km, in the attempt at a plan in which it was asked."""

    attempt: int
    answer: Heard


class Planning:
    """The device; one task at a time, of which the newest counts. `visiting`: the robot.

    All events come to one thread: the search's, km's answers, and that a time is over.
    """

    def __init__(self, post: Post, visiting: Visiting) -> None:
        self._post, self._visiting = post, visiting
        self._events = OneReaderQueue[Any]()
        self._plan: Plan | None = None
        self._attempt, self._searches = 0, False
        self._until: float | None = None
        self._search = SearchDevice(self._events.put)  # type: ignore[arg-type]  # it posts, and nothing else
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def tell(self, plan: Plan) -> None:
        """Begin."""
        self._events.put(plan)

    def close(self) -> None:
        """End the child."""
        self._events.put(None)
        self._thread.join()
        self._search.close()

    def _run(self) -> None:
        while True:
            left = None if self._until is None else max(0.0, self._until - time.monotonic())
            try:
                event = self._events.get(left)
            except Empty:
                self._silent("it takes too long")
                continue
            if event is None:
                return
            self._take(event)

    def _take(self, event: Any) -> None:
        match event:
            case Plan():
                self._begin(event)
            case Said(attempt=attempt, answer=answer) if attempt == self._attempt and self._plan is not None:
                self._answered(answer)
            case Ask(attempt=attempt, query=query) if attempt == self._attempt:
                self._ask(query)
            case Found(attempt=attempt, plan=plan) if attempt == self._attempt:
                self._found(plan)
            case Died():
                self._not_planned((fact(Kind.ENDED, "search"),))

    def _begin(self, plan: Plan) -> None:
        if self._plan is not None:
            self._search.tell(Stop(self._attempt))
        self._plan = plan
        self._attempt, self._searches = self._attempt + 1, False
        self._until = time.monotonic() + ANSWER_S
        # all that earlier plans made; km keeps what guests make apart from the planner's
        self._ask(wm.DropStates(prefix=""))

    def _answered(self, answer: Heard) -> None:
        assert self._plan is not None
        match answer.content:
            case wm.UnknownState():
                self._not_planned((fact(Kind.STATES_LOST),))
            case wm.Unknown(later=True, why=why):
                self._not_planned(why)
            case content if content is None or answer.performative not in (P.INFORM_REF, P.FAILURE):
                self._silent(str(content))  # the door's refusal, in words
            case content if self._searches:
                self._search.tell(Answer(self._attempt, content))
            case _:
                self._searches, self._until = True, time.monotonic() + WITHIN_S
                network = hfsm.GroundTaskNetwork(f"{self._plan.call}-{self._attempt}", (self._plan.task.task,))
                self._search.tell(Begin(self._attempt, network, SEED))

    def _found(self, plan: hfsm.HierarchicalPlan | hfsm.NoPlan) -> None:
        if isinstance(plan, hfsm.NoPlan):
            self._not_planned(plan.why)
        elif self._plan is not None:
            whole = hfsm.ScheduleParameters("", plan.duration)
            self._end(Planned(self._plan.call, next(iter(plan.schedule), whole)))

    def _ask(self, query: wm.AnyQuery) -> None:
        heard = partial(Said, self._attempt)
        try:
            self._visiting.visit().ask(USE, P.QUERY_REF, query, lambda answer: self._events.put(heard(answer)))
        except (OSError, FipaError, zenoh.ZError) as error:
            self._silent(str(error))

    def _silent(self, log: str) -> None:
        """The robot does not answer: perhaps it runs elsewhere by now."""
        self._visiting.renew()
        self._not_planned((fact(Kind.NOT_ANSWERING, AgentName.KM),), log)

    def _not_planned(self, why: Facts, log: str = "") -> None:
        if self._plan is not None:
            self._end(NotPlanned(self._plan.call, why, log))

    def _end(self, content: Planned | NotPlanned) -> None:
        self._search.tell(Stop(self._attempt))
        self._plan, self._until = None, None
        self._post(content)
