"""Memory of ta between two steps: the plan and the position in it, the act under way; conditions of
the design.
"""

from collections.abc import Callable

import msgspec

from companion.acts import AnyAct
from companion.languages import hfsm, sw
from companion.languages.evidence import Evidence
from companion.languages.facts import Facts
from companion.languages.values import Side
from services.task import plan as plans


class RunningAct(msgspec.Struct, frozen=True):
    """An act requested of ex. `agreed`: ex agreed; `stopped`: a cancel was sent."""

    conversation: str
    command: AnyAct
    agreed: bool = False
    stopped: bool = False


class Pending(msgspec.Struct, frozen=True):
    """The position that waits for the operator, or that the operator has let begin (`let`)."""

    position: plans.Position
    let: bool = False


class Soft(msgspec.Struct, frozen=True):
    """Memory that is lost with the process: the conversation of the query under way; the query is
    asked again.
    """

    question: str = ""


class Memory(msgspec.Struct, frozen=True):
    """`conversation`: with co, about `plan`. `safe`: the machine that runs instead after the plan
    is cancelled.

    `at`: position in the running machine. `act`: the act under way. `looking`: that act is a look,
    because the outcome of the act before is unknown. `secured`: number of tries to put down what is
    held. `end`: how the plan ends, None before, and `why`. `hands`: what each hand holds by the
    last outcome. `survey`: tries left of a look around. `evidence`: what the acts of the plan made
    true, and which senses told. `told`: what acts before the present one are to tell the person at
    the end, UNSET if nothing. `acts`: counts the acts outside plans, for their keys. `pending`:
    UNSET unless an operator is asked.
    """

    conversation: str = ""
    plan: hfsm.HierarchicalPlan | None = None
    safe: hfsm.Machine | None = None
    at: plans.Position = ()
    act: RunningAct | None = None
    looking: bool = False
    cancelled: bool = False
    secured: int = 0
    end: sw.WorkerState | None = None
    why: Facts = ()
    reported: bool = False
    hands: dict[Side, str] = {}
    evidence: tuple[Evidence, ...] = ()
    survey: int = 0
    acts: int = 0
    pending: Pending | msgspec.UnsetType = msgspec.UNSET
    told: Facts | msgspec.UnsetType = msgspec.UNSET
    soft: Soft = Soft()

    @property
    def machine(self) -> hfsm.Machine:
        """The running machine: that of the plan, or the one that makes it safe."""
        assert self.plan is not None
        return self.safe or self.plan.root

    @property
    def asked(self) -> plans.Position:
        """The position that waits for the operator; () where none does."""
        if not isinstance(self.pending, Pending) or self.pending.let:
            return ()
        return self.pending.position

    @property
    def let(self) -> plans.Position:
        """The position that the operator has let begin; () where there is none."""
        return (
            self.pending.position if isinstance(self.pending, Pending) and self.pending.let else ()
        )


def something_to_secure(memory: Memory) -> bool:
    """Whether a cancelled plan left something in a hand, knows how to put it down, and has not
    tried yet.
    """
    full = memory.cancelled and not memory.secured and bool(memory.hands)
    return full and way_to_safety(memory) is not None


def way_to_safety(memory: Memory) -> hfsm.Machine | None:
    """The machine that makes the plan safe at its position, None if there is none."""
    if memory.plan is None or not memory.at:
        return None
    return plans.safe(memory.plan.root, memory.at)


CONDITIONS: dict[str, Callable[[Memory], bool]] = {
    "work_arrived": lambda memory: memory.plan is not None or memory.survey > 0,
    "plan_taken": lambda memory: memory.plan is not None,
    "survey_wanted": lambda memory: memory.survey > 0,
    "survey_over": lambda memory: memory.survey <= 0,
    "plan_over": lambda memory: memory.end is not None,
    "plan_stands": lambda memory: memory.end is not None or bool(memory.asked),
    "operator_asked": lambda memory: bool(memory.asked),
    "operator_decided": lambda memory: not memory.asked,
    "plan_broken": lambda memory: False,
    "act_under_way": lambda memory: memory.act is not None,
    "act_settled": lambda memory: memory.act is None,
    "something_to_secure": something_to_secure,
    "safe": lambda memory: memory.end is not None,
    "cannot_make_safe": lambda memory: False,
    "final_report_sent": lambda memory: memory.reported,
    "acknowledged": lambda memory: memory.plan is None,
}
