"""Memory of pl between two steps: the problem being planned, those that wait, the result; the
design's conditions.
"""

import msgspec

from companion.languages import hfsm


class Problem(msgspec.Struct, frozen=True):
    """A task network that is to be planned, and the conversation in which co asked for it."""

    conversation: str
    network: hfsm.GroundTaskNetwork


class Soft(msgspec.Struct, frozen=True):
    """Memory lost with the process: the conversation of the query under way; `lost`: the search
    must start again.
    """

    question: str = ""
    lost: bool = False


class Memory(msgspec.Struct, frozen=True):
    """Problem, waiting problems, result. `attempt` counts all searches, `begun` those of this
    problem.
    """

    seed: int = 1
    problem: Problem | None = None
    waiting: tuple[Problem, ...] = ()
    ready: bool = False
    attempt: int = 0
    begun: int = 0
    result: hfsm.HierarchicalPlan | hfsm.NoPlan | None = None
    cancelled: bool = False
    soft: Soft = Soft()


CONDITIONS = {
    "problem_taken": lambda memory: memory.problem is not None,
    "problem_answered": lambda memory: memory.problem is None,
    "world_known": lambda memory: memory.ready,
    "search_stopped": lambda memory: memory.cancelled or memory.result is not None,
    "search_ended": lambda memory: memory.result is not None or memory.soft.lost,
    "hypothesis_lost": lambda memory: (
        memory.soft.lost and memory.result is None and not memory.cancelled
    ),
}
