"""What a_ta knows between two steps: the plan that runs, where it stands, the act under way, how it is to end."""

import msgspec

from companion.languages import hfsm, rc, sw
from companion.languages.values import Side
from services.task import plan as plans


class Act(msgspec.Struct, frozen=True):
    """An act asked of ex. `agreed`: ex took it; `stopped`: a cancel is on its way."""

    conversation: str
    command: rc.Act
    agreed: bool = False
    stopped: bool = False


class Soft(msgspec.Struct, frozen=True):
    """The conversation of a query under way; a death takes it, and the query is asked again."""

    question: str = ""


class Memory(msgspec.Struct, frozen=True):
    """`conversation`: that with co about `plan`. `safe`: the machine that runs instead once the plan is cancelled.

    `at`: position in the machine that runs. `act`: what ex was asked for and has not ended. `looking`: that act only
    finds out how the world is, since the outcome of the one before is unknown. `secured`: how often it was tried to put
    down what is held. `end`: how the plan ends, once it does; `reason` in words. `hands`: what each hand holds by ex's
    last outcome. `survey`: looks around still to be tried. `acts`: counts what was asked beside plans, for their keys.
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
    reason: str = ""
    reported: bool = False
    hands: dict[Side, str] = {}
    survey: int = 0
    acts: int = 0
    soft: Soft = Soft()

    @property
    def machine(self) -> hfsm.Machine:
        """The machine that runs: the plan's, or the one that makes it safe."""
        assert self.plan is not None
        return self.safe or self.plan.root


def plan_taken(memory: Memory) -> bool:
    """A plan of co waits to be run."""
    return memory.plan is not None


def survey_wanted(memory: Memory) -> bool:
    """Somebody began to observe the world, and it was not looked at yet."""
    return memory.survey > 0


def work_arrived(memory: Memory) -> bool:
    """There is something to do."""
    return plan_taken(memory) or survey_wanted(memory)


def plan_over(memory: Memory) -> bool:
    """Nothing more of the plan will be begun."""
    return memory.end is not None


def act_under_way(memory: Memory) -> bool:
    """ex still has to say how an act ended."""
    return memory.act is not None


def act_settled(memory: Memory) -> bool:
    """ex has said its last word about the act."""
    return memory.act is None


def something_to_secure(memory: Memory) -> bool:
    """The plan was cancelled, a hand holds something, the plan says how to put it down, and that was not tried yet."""
    return memory.cancelled and not memory.secured and bool(memory.hands) and way_to_safety(memory) is not None


def way_to_safety(memory: Memory) -> hfsm.Machine | None:
    """What the plan says for where it stands."""
    if memory.plan is None or not memory.at:
        return None
    return plans.safe(memory.plan.root, memory.at)


CONDITIONS = {
    "work_arrived": work_arrived,
    "plan_taken": plan_taken,
    "survey_wanted": survey_wanted,
    "survey_over": lambda memory: not survey_wanted(memory),
    "plan_over": plan_over,
    "plan_broken": lambda memory: False,
    "act_under_way": act_under_way,
    "act_settled": act_settled,
    "something_to_secure": something_to_secure,
    "safe": plan_over,
    "cannot_make_safe": lambda memory: False,
    "final_report_sent": lambda memory: memory.reported,
    "acknowledged": lambda memory: memory.plan is None,
}
