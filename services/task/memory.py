"""Memory of ta between two steps: the plan and the position in it, the act under way; conditions of the design."""

import msgspec

from companion.acts import AnyAct
from companion.languages import hfsm, sw
from companion.languages.evidence import Evidence
from companion.languages.facts import Facts
from companion.languages.values import Side
from services.task import plan as plans


class Act(msgspec.Struct, frozen=True):
    """An act requested of ex. `agreed`: ex agreed; `stopped`: a cancel was sent."""

    conversation: str
    command: AnyAct
    agreed: bool = False
    stopped: bool = False


class Pending(msgspec.Struct, frozen=True):
    """The position that waits for the operator, or that the operator has `let` begin."""

    position: plans.Position
    let: bool = False


class Soft(msgspec.Struct, frozen=True):
    """Memory that is lost with the process: the conversation of the query under way; the query is asked again."""

    question: str = ""


class Memory(msgspec.Struct, frozen=True):
    """`conversation`: with co, about `plan`. `safe`: the machine that runs instead after the plan is cancelled.

    `at`: position in the running machine. `act`: the act under way. `looking`: that act is a look, because the outcome
    of the act before is unknown. `secured`: number of tries to put down what is held. `end`: how the plan ends, None
    before, and `why`. `hands`: what each hand holds by the last outcome. `survey`: tries left of a look around.
    `evidence`: what the acts of the plan made true, and which senses told. `told`: what acts before the present one are
    to tell the person at the end, UNSET if nothing.
    `acts`: counts the acts outside plans, for their keys. `pending`: UNSET unless an operator is asked.
    """

    conversation: str = ""
    plan: hfsm.HierarchicalPlan | None = None
    safe: hfsm.Machine | None = None
    at: plans.Position = ()
    act: Act | None = None
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
        return self.pending.position if isinstance(self.pending, Pending) and not self.pending.let else ()

    @property
    def let(self) -> plans.Position:
        """The position that the operator has let begin; () where there is none."""
        return self.pending.position if isinstance(self.pending, Pending) and self.pending.let else ()


def plan_taken(memory: Memory) -> bool:
    """Whether there is a plan to run."""
    return memory.plan is not None


def survey_wanted(memory: Memory) -> bool:
    """Whether a new observer waits for a look around."""
    return memory.survey > 0


def work_arrived(memory: Memory) -> bool:
    """Whether there is something to do."""
    return plan_taken(memory) or survey_wanted(memory)


def plan_over(memory: Memory) -> bool:
    """Whether no further state of the plan will be entered."""
    return memory.end is not None


def plan_stands(memory: Memory) -> bool:
    """Whether the plan is over, or waits for the operator."""
    return plan_over(memory) or bool(memory.asked)


def operator_decided(memory: Memory) -> bool:
    """Whether nothing waits for the operator any more."""
    return not memory.asked


def act_under_way(memory: Memory) -> bool:
    """Whether an act is under way."""
    return memory.act is not None


def act_settled(memory: Memory) -> bool:
    """Whether no act is under way."""
    return memory.act is None


def something_to_secure(memory: Memory) -> bool:
    """Whether a cancelled plan left something in a hand, knows how to put it down, and has not tried yet."""
    return memory.cancelled and not memory.secured and bool(memory.hands) and way_to_safety(memory) is not None


def way_to_safety(memory: Memory) -> hfsm.Machine | None:
    """Return the machine that makes the plan safe at its position, None if there is none."""
    if memory.plan is None or not memory.at:
        return None
    return plans.safe(memory.plan.root, memory.at)


CONDITIONS = {
    "work_arrived": work_arrived,
    "plan_taken": plan_taken,
    "survey_wanted": survey_wanted,
    "survey_over": lambda memory: not survey_wanted(memory),
    "plan_over": plan_over,
    "plan_stands": plan_stands,
    "operator_asked": lambda memory: bool(memory.asked),
    "operator_decided": operator_decided,
    "plan_broken": lambda memory: False,
    "act_under_way": act_under_way,
    "act_settled": act_settled,
    "something_to_secure": something_to_secure,
    "safe": plan_over,
    "cannot_make_safe": lambda memory: False,
    "final_report_sent": lambda memory: memory.reported,
    "acknowledged": lambda memory: memory.plan is None,
}
