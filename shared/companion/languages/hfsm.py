"""HFSM, the language of tasks and plans on channels C3 and C1 (paper, sections 5.4 and 5.6).

A GroundTaskNetwork asks for a plan; a HierarchicalPlan is the answer, and ta runs it as its super-state without further
knowledge of pl. A plan is a tree: machines contain states, leaves act (RC) or ask km (WM). Arcs name the outcome that
leads on; the target is a sibling state or an outcome of the machine itself.
"""

from enum import StrEnum

import msgspec

from companion.languages.facts import Facts
from companion.languages.rc import Act as RobotCommand
from companion.languages.values import Side
from companion.languages.wm import AnyQuery


class Outcome(StrEnum):
    """End of a state of a plan."""

    SUCCEEDED = "succeeded"
    FAILED = "failed"
    REPLAN = "replan"
    PREEMPTED = "preempted"


class TaskName(StrEnum):
    """The tasks that pl can be asked for. On the wire a name is a str: pl answers one that it does not know."""

    POUR = "pour"
    TAKE = "take"
    BRING = "bring"
    SWAP_HANDS = "swap_hands"
    PUT_DOWN = "put_down"
    PUT_AT = "put_at"
    CLEAR_TABLE = "clear_table"
    LOOK_AROUND = "look_around"


class Task(msgspec.Struct, frozen=True):
    """One ground task: its name in the planning domain (a TaskName) and its arguments."""

    name: str
    arguments: tuple[str, ...]


class GroundTaskNetwork(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True):
    """Tasks to be done in this order. `id` names the request; ids of hypothetical states begin with it."""

    id: str
    tasks: tuple[Task, ...]


class Arc(msgspec.Struct, frozen=True, array_like=True):
    """On this outcome go to the sibling state `to`; "" ends the machine with the same outcome."""

    on: Outcome
    to: str = ""


class ActState(msgspec.Struct, frozen=True, tag=True):
    """A leaf that asks ex for one act."""

    name: str
    command: RobotCommand
    arcs: tuple[Arc, ...] = ()


class AskState(msgspec.Struct, frozen=True, tag=True):
    """A leaf that asks km; it succeeds when the answer equals `expect`, else it ends with `otherwise`."""

    name: str
    query: AnyQuery
    expect: bool = True
    otherwise: Outcome = Outcome.REPLAN
    arcs: tuple[Arc, ...] = ()


class EndState(msgspec.Struct, frozen=True, tag=True):
    """A leaf that ends its machine with an outcome at once (a plan that knows it must be followed by another)."""

    name: str
    outcome: Outcome
    why: Facts = ()


class Machine(msgspec.Struct, frozen=True, tag=True):
    """A container of states; `initial` is entered first. A missing arc passes the outcome up.

    `safe`: run in place of the rest when the plan is cancelled while this machine is active and something is held
    (put it down); None: the act is stopped and nothing else is needed.
    """

    name: str
    initial: str
    states: tuple["ActState | AskState | EndState | Machine", ...]
    arcs: tuple[Arc, ...] = ()
    safe: "Machine | None" = None


State = ActState | AskState | EndState | Machine


PUT_DOWN_S = 15.0
"""To put one thing down and retreat [s, simulated], as cancels took (measured); for planner and coordinator."""


class ScheduleParameters(msgspec.Struct, frozen=True, array_like=True):
    """Costs of a plan while its state `at` is active, in simulated seconds (TaskER: ScheduleParams).

    `rest`: until the task is done. `suspend`: until it is safely left. `resume`: until it is back where it was left.
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


class HierarchicalPlan(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, omit_defaults=True):
    """A plan. `duration`: expected time of all its acts [s, simulated]; `queries`: how many km answered for it.

    `schedule`: for each state of its root, in their order. `holds`: what the hands hold when the task is done.
    `rejected`: what the search tried before, the first of them; co does not pass it on.
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
