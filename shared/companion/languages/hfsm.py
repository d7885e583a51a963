"""HFSM, the language of tasks and plans on channels C3 and C1 (paper, sections 5.4 and 5.6).

A GroundTaskNetwork asks for a plan; a HierarchicalPlan is the answer, and ta runs it as its
super-state without further knowledge of pl. A plan is a tree: machines contain states, leaves act
(RC) or ask km (WM). Arcs name the outcome that leads on; the target is a sibling state or an
outcome of the machine itself. Names of states are ids among their siblings; what a state does, its
step says.
"""

from collections.abc import Iterator
from enum import StrEnum

import msgspec

from companion.acts import AnyAct
from companion.languages.facts import Facts
from companion.languages.values import Side
from companion.languages.wm import AnyQuery, Holds, Relation


class Outcome(StrEnum):
    """End of a state of a plan."""

    SUCCEEDED = "succeeded"
    FAILED = "failed"
    REPLAN = "replan"
    PREEMPTED = "preempted"


class Task(msgspec.Struct, frozen=True):
    """One ground task: its name in the planning domain, as a task's `plan` declares it, and its
    arguments.
    """

    name: str
    arguments: tuple[str, ...]


class Step(msgspec.Struct, frozen=True, array_like=True, omit_defaults=True):
    """What a part of a plan does: a row of the catalogues' [step] table, with which things, and
    with which hand.
    """

    does: str
    things: tuple[str, ...] = ()
    side: Side | None = None


class Place(msgspec.Struct, frozen=True, array_like=True, omit_defaults=True):
    """A leaf of a plan that is under way, or waits: names of states from below the root to it, the
    step that it is in, the class of its act ("" for none), and the hand that acts.
    """

    path: tuple[str, ...]
    step: Step | None = None
    act: str = ""
    side: Side | None = None

    @property
    def id(self) -> str:
        """The path as one text: what an operator names when the act may begin. No program takes it
        apart.
        """
        return "/".join(self.path)


class GroundTaskNetwork(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True):
    """Tasks to be done in this order. `id` names the request; ids of hypothetical states begin with
    it.
    """

    id: str
    tasks: tuple[Task, ...]


class Arc(msgspec.Struct, frozen=True, array_like=True):
    """On this outcome go to the sibling state `to`; "" ends the machine with the same outcome."""

    on: Outcome
    to: str = ""


class ActState(msgspec.Struct, frozen=True, tag=True):
    """A leaf that asks ex for one act."""

    name: str
    command: AnyAct
    arcs: tuple[Arc, ...] = ()


class AskState(msgspec.Struct, frozen=True, tag=True):
    """A leaf that asks km; it succeeds when the answer equals `expect`, else it ends with
    `otherwise`.
    """

    name: str
    query: AnyQuery
    expect: bool = True
    otherwise: Outcome = Outcome.REPLAN
    arcs: tuple[Arc, ...] = ()


class EndState(msgspec.Struct, frozen=True, tag=True):
    """A leaf that ends its machine with an outcome at once (a plan that knows it must be followed
    by another).
    """

    name: str
    outcome: Outcome
    why: Facts = ()


class Machine(msgspec.Struct, frozen=True, tag=True):
    """A container of states; `initial` is entered first. A missing arc passes the outcome up.

    `safe`: run in place of the rest when the plan is cancelled while this machine is active and
    something is held (put it down); None: the act is stopped and nothing else is needed. `step`:
    what it does; None for a root.
    """

    name: str
    initial: str
    states: tuple["ActState | AskState | EndState | Machine", ...]
    arcs: tuple[Arc, ...] = ()
    safe: "Machine | None" = None
    step: Step | None = None


State = ActState | AskState | EndState | Machine


def acts(machine: Machine) -> Iterator[AnyAct]:
    """Yield the acts of a plan in the order of its states."""
    for state in machine.states:
        if isinstance(state, Machine):
            yield from acts(state)
        elif isinstance(state, ActState):
            yield state.command


def step_of(state: State) -> Step | None:
    """What a state below the root does; None for one that is no step of a plan, such as its end."""
    match state:
        case Machine(step=step):
            return step
        case AskState(query=Holds(relation=Relation.HAS_EXACT_POSE, subject=thing)):
            return Step("localize", (thing,))
    return None


PUT_DOWN_S = 15.0
"""To put one thing down and retreat [s, simulated], as cancels took (measured); for planner and
coordinator.
"""


class ScheduleParameters(msgspec.Struct, frozen=True, array_like=True):
    """Costs of a plan while its state `at` is active, in simulated seconds (TaskER:
    ScheduleParams).

    `rest`: until the task is done. `suspend`: until it is safely left. `resume`: until it is back
    where it was left.
    """

    at: str
    rest: float
    suspend: float = 0.0
    resume: float = 0.0


class Rejected(msgspec.Struct, frozen=True, array_like=True):
    """A method or step that the search tried and left, with its arguments, and why."""

    method: str
    arguments: tuple[str, ...]
    why: Facts


class HierarchicalPlan(
    msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, omit_defaults=True
):
    """A plan. `duration`: expected time of all its acts [s, simulated]; `queries`: how many km
    answered for it.

    `schedule`: for each state of its root, in their order. `holds`: what the hands hold when the
    task is done. `rejected`: what the search tried before, the first of them; co does not pass it
    on.
    """

    id: str
    task: str
    root: Machine
    duration: float
    queries: int
    schedule: tuple[ScheduleParameters, ...] = ()
    holds: dict[Side, str] = {}
    rejected: tuple[Rejected, ...] = ()


class NoPlan(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, omit_defaults=True):
    """The answer without a plan, and why. `later`: ask again, the world is still being looked at.

    `rejected`: as in a plan.
    """

    id: str
    why: Facts
    later: bool = False
    rejected: tuple[Rejected, ...] = ()


class Taken(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True):
    """The request for a plan is taken."""

    id: str


Content = GroundTaskNetwork | HierarchicalPlan | NoPlan | Taken
