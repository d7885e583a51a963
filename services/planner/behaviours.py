"""a_pl's behaviours, bound by name to the states of the design (paper, section 5.5, Tables 3 to 6).

The agent only forwards: queries of its search to km, answers back, the result to co; so no step computes long and a
cancel is taken at once. What is being planned is in the journal; the search itself and km's hypothetical states are
soft: after a death of either the search begins anew. Must not know: geometry, the domain.
"""

import msgspec
from msgspec.structs import replace

from agent_runtime.core.agent import Agent
from agent_runtime.core.events import Broken, Late, Local, Received, Started
from agent_runtime.core.turn import Turn
from companion.binding import bind
from companion.languages import hfsm, wm
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from services.planner import search_process
from services.planner.search_process import Answer, Ask, Begin, Died, Found, NotFound, Stop

ANSWER_WITHIN_S = 30.0  # estimate: km holds a question for 5 s, answers in ms, comes back in seconds
DROP_WITHIN_S = 5.0  # hypothetical states nobody drops are km's to forget
MOST_ATTEMPTS = 5  # estimate: km dies less often than that during one search


class Problem(msgspec.Struct, frozen=True):
    """A network to be planned, and the conversation that asked for it."""

    conversation: str
    network: hfsm.GroundTaskNetwork


class Soft(msgspec.Struct, frozen=True):
    """The conversation of the query under way; whether the search has to begin anew."""

    question: str = ""
    lost: bool = False


class Memory(msgspec.Struct, frozen=True):
    """What is planned, what waits, the result. `attempt` counts searches, `begun` those of this problem."""

    seed: int = 1
    problem: Problem | None = None
    waiting: tuple[Problem, ...] = ()
    ready: bool = False
    attempt: int = 0
    begun: int = 0
    result: hfsm.HierarchicalPlan | hfsm.NoPlan | None = None
    cancelled: bool = False
    soft: Soft = Soft()


def agent(seed: int = 1) -> Agent[Memory]:
    """a_pl as the design has it; `seed` of the chance in its searches."""
    return bind(
        "pl",
        Memory(seed=seed),
        {
            "await_problem": await_problem,
            "initialize_problem": initialize_problem,
            "search_plan": search_plan,
            "answer_problem": answer_problem,
        },
        {
            "problem_taken": lambda memory: memory.problem is not None,
            "problem_answered": lambda memory: memory.problem is None,
            "world_known": lambda memory: memory.ready,
            "search_stopped": lambda memory: memory.cancelled or memory.result is not None,
            "search_ended": lambda memory: memory.result is not None or memory.soft.lost,
            "hypothesis_lost": lambda memory: memory.soft.lost and memory.result is None and not memory.cancelled,
        },
        local=search_process.Local,
    )


# --- idle -------------------------------------------------------------------------------------------------------------


def await_problem(memory: Memory, turn: Turn) -> Memory:
    """idle: the oldest problem that waits is taken."""
    memory = _heard(memory, turn)
    if memory.problem is None and memory.waiting:
        return replace(memory, problem=memory.waiting[0], waiting=memory.waiting[1:])
    return memory


def _heard(memory: Memory, turn: Turn) -> Memory:
    """In every state: a request is agreed to and waits for its turn, a cancel is answered at once."""
    match turn.event:
        case Received(content=hfsm.GroundTaskNetwork() as network) as received:
            turn.say(received.conversation, Performative.AGREE, hfsm.Taken(network.id))
            return replace(memory, waiting=(*memory.waiting, Problem(received.conversation, network)))
        case Received(communicate=word) as received if word.performative is Performative.CANCEL:
            return _cancelled(memory, turn, received.conversation)
        case Broken(conversation=conversation):
            return _forgotten(memory, conversation)
        case _:
            return memory


def _cancelled(memory: Memory, turn: Turn, conversation: str) -> Memory:
    known = (*memory.waiting, *((memory.problem,) if memory.problem else ()))
    network = next(one.network.id for one in known if one.conversation == conversation)
    turn.say(conversation, Performative.INFORM, hfsm.NoPlan(network, "cancelled"), kind=Kind.CANCEL)
    return _forgotten(memory, conversation)


def _forgotten(memory: Memory, conversation: str) -> Memory:
    """Nobody waits for this problem any more."""
    if memory.problem is not None and memory.problem.conversation == conversation:
        return replace(memory, cancelled=True)
    return replace(memory, waiting=tuple(one for one in memory.waiting if one.conversation != conversation))


# --- initialize -------------------------------------------------------------------------------------------------------


def initialize_problem(memory: Memory, turn: Turn) -> Memory:
    """initialize: hypothetical states of an earlier attempt are dropped, and km is there."""
    if turn.event is None:
        return _begin_anew(memory, turn)
    memory = _heard(memory, turn)
    if memory.cancelled:
        return memory
    match turn.event:
        case Received(content=wm.Unknown(later=True, reason=reason), conversation=name) if name == memory.soft.question:
            return _no_plan(replace(memory, soft=Soft()), reason, later=True)
        case Received(conversation=name) if name == memory.soft.question:
            return replace(memory, ready=True, soft=Soft())
        case Started():
            return _ask(memory, turn, _drop(memory))
        case _:
            return _unanswered(memory, turn)


def _begin_anew(memory: Memory, turn: Turn) -> Memory:
    if memory.begun >= MOST_ATTEMPTS:
        return _no_plan(memory, f"km lost the hypothetical states of {memory.begun} searches")
    return _ask(replace(memory, ready=False, begun=memory.begun + 1, soft=Soft()), turn, _drop(memory))


def _drop(memory: Memory) -> wm.DropStates:
    assert memory.problem is not None
    return wm.DropStates(prefix=f"{memory.problem.network.id}/")


def _ask(memory: Memory, turn: Turn, query: wm.AnyQuery) -> Memory:
    name = turn.open("km", "query", Performative.QUERY_REF, query, reply_by_s=ANSWER_WITHIN_S)
    return replace(memory, soft=replace(memory.soft, question=name))


def _unanswered(memory: Memory, turn: Turn) -> Memory:
    """The wait for km is over without an answer."""
    match turn.event:
        case Late(conversation=name) if name == memory.soft.question:
            return _no_plan(memory, f"km does not answer (waited {ANSWER_WITHIN_S:g} s)")
        case Broken(conversation=name, reason=reason) if name == memory.soft.question:
            return _no_plan(memory, f"km cannot be asked: {reason}")
        case _:
            return memory


def _no_plan(memory: Memory, reason: str, *, later: bool = False) -> Memory:
    assert memory.problem is not None
    return replace(memory, result=hfsm.NoPlan(memory.problem.network.id, reason, later))


# --- search -----------------------------------------------------------------------------------------------------------


def search_plan(memory: Memory, turn: Turn) -> Memory:
    """search: queries of the search go to km and the answers back, until it has found a plan or none."""
    if turn.event is None:
        return _searching(memory, turn)
    memory = _heard(memory, turn)
    if memory.cancelled:
        return memory
    match turn.event:
        case Local(content=Ask(attempt=attempt, query=query)) if attempt == memory.attempt:
            return _ask(memory, turn, query)
        case Received(content=content, conversation=name) if name == memory.soft.question:
            return _answered(memory, turn, content)
        case Local(content=Found(attempt=attempt, plan=plan)) if attempt == memory.attempt:
            return replace(memory, result=plan)
        case Local(content=NotFound(attempt=attempt, reason=reason)) if attempt == memory.attempt:
            return _no_plan(memory, reason)
        case Local(content=Died(code=code)):
            return _no_plan(memory, f"the search ended unexpectedly (exit status {code})")
        case Started():
            return replace(memory, soft=Soft(lost=True))
        case _:
            return _unanswered(memory, turn)


def _searching(memory: Memory, turn: Turn) -> Memory:
    assert memory.problem is not None
    attempt = memory.attempt + 1
    turn.tell(Begin(attempt, memory.problem.network, memory.seed))
    return replace(memory, attempt=attempt)


def _answered(memory: Memory, turn: Turn, content: wm.AnyAnswer) -> Memory:
    if isinstance(content, wm.Unknown) and content.later:
        return _no_plan(replace(memory, soft=Soft()), content.reason, later=True)
    if isinstance(content, wm.UnknownState):
        turn.log("hypothesis lost", level="warning", state=content.id)
        return replace(memory, soft=Soft(lost=True))
    turn.tell(Answer(memory.attempt, content))
    return replace(memory, soft=Soft())


# --- finalize ---------------------------------------------------------------------------------------------------------


def answer_problem(memory: Memory, turn: Turn) -> Memory:
    """finalize: the search is ended, the result told, km's hypothetical states dropped."""
    problem = memory.problem
    assert problem is not None
    if not isinstance(memory.result, hfsm.HierarchicalPlan):
        turn.tell(Stop(memory.attempt))
    if memory.soft.question:
        turn.drop(memory.soft.question)
    if turn.holds(problem.conversation) and memory.result is not None:
        plan = isinstance(memory.result, hfsm.HierarchicalPlan)
        turn.say(problem.conversation, Performative.INFORM if plan else Performative.FAILURE, memory.result)
    if not (isinstance(memory.result, hfsm.NoPlan) and memory.result.later):  # put off: nothing was made, km is busy
        turn.open("km", "query", Performative.QUERY_REF, _drop(memory), reply_by_s=DROP_WITHIN_S)
    return Memory(seed=memory.seed, waiting=memory.waiting, attempt=memory.attempt)
