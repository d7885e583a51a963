"""The behaviours of pl, bound by name to the states of the design (paper, section 5.5, Tables 3 to
6).

The agent only forwards: queries of its search to km, answers back, the result to co. So no step
computes for long, and a cancel is taken at once. The problem is in the journal. The search and the
hypothetical states at km are soft: after the death of either, the search starts again. Must not
know: geometry, the domain.
"""

from msgspec.structs import replace

from agent_runtime.core.agent import Agent
from agent_runtime.core.events import Broken, Late, Local, Received, Started
from agent_runtime.core.turn import Turn
from companion.design import AgentName, bind
from companion.languages import hfsm, wm
from companion.languages.facts import Fact, Kind, fact
from fipa_codec.performatives import Performative
from services.planner import outgoing_messages as messages
from services.planner import search
from services.planner.memory import CONDITIONS, Memory, Problem, Soft
from services.planner.search import Answer, Ask, Begin, Died, Found, Stop

ATTEMPTS = "attempts"
"""Parameter of the design: after how many searches that km broke off a problem has no plan."""


def agent(seed: int = 1) -> Agent[Memory]:
    """The agent pl; `seed` of the random numbers in its searches."""
    behaviours = {
        state.__name__: state
        for state in (await_problem, initialize_problem, search_plan, answer_problem)
    }
    return bind(AgentName.PL, Memory(seed=seed), behaviours, CONDITIONS, local=search.Local)


# --- idle -----------------------------------------------------------------------------------------


def await_problem(memory: Memory, turn: Turn) -> Memory:
    """State idle: take the oldest waiting problem."""
    memory = _received(memory, turn)
    if memory.problem is None and memory.waiting:
        return replace(memory, problem=memory.waiting[0], waiting=memory.waiting[1:])
    return memory


def _received(memory: Memory, turn: Turn) -> Memory:
    """Take messages in any state: agree to a request and queue it, answer a cancel at once."""
    match turn.event:
        case Received(content=hfsm.GroundTaskNetwork() as network) as received:
            messages.agree(turn, received.conversation, network)
            return replace(
                memory, waiting=(*memory.waiting, Problem(received.conversation, network))
            )
        case Received(communicate=message, conversation=name) if (
            message.performative is Performative.CANCEL
        ):
            known = (*memory.waiting, *((memory.problem,) if memory.problem else ()))
            network = next(one.network.id for one in known if one.conversation == name)
            messages.cancelled(turn, name, network)
            return _forgotten(memory, name)
        case Broken(conversation=conversation):
            return _forgotten(memory, conversation)
        case _:
            return memory


def _forgotten(memory: Memory, conversation: str) -> Memory:
    """Drop a problem that nobody waits for any more."""
    if memory.problem is not None and memory.problem.conversation == conversation:
        return replace(memory, cancelled=True)
    return replace(
        memory, waiting=tuple(one for one in memory.waiting if one.conversation != conversation)
    )


# --- initialize -----------------------------------------------------------------------------------


def initialize_problem(memory: Memory, turn: Turn) -> Memory:
    """State initialize: drop the hypothetical states of an earlier attempt; this also shows that km
    is there.
    """
    if turn.event is None:
        if memory.begun >= turn.parameter(ATTEMPTS, int):
            return _no_plan(memory, fact(Kind.STATES_LOST))
        return _drop(replace(memory, ready=False, begun=memory.begun + 1, soft=Soft()), turn)
    memory = _received(memory, turn)
    if memory.cancelled:
        return memory
    match turn.event:
        case Received(content=wm.Unknown(later=True, why=why), conversation=name) if (
            name == memory.soft.question
        ):
            return _no_plan(memory, *why, later=True)
        case Received(conversation=name) if name == memory.soft.question:
            return replace(memory, ready=True)
        case Started():
            return _drop(memory, turn)
        case _:
            return _unanswered(memory, turn)


def _drop(memory: Memory, turn: Turn) -> Memory:
    assert memory.problem is not None
    return _ask(memory, turn, messages.drop(memory.problem))


def _ask(memory: Memory, turn: Turn, query: wm.AnyQuery) -> Memory:
    assert memory.problem is not None
    return replace(
        memory, soft=replace(memory.soft, question=messages.ask(turn, memory.problem, query))
    )


def _unanswered(memory: Memory, turn: Turn) -> Memory:
    """Give up if km has not answered in time."""
    match turn.event:
        case Late(conversation=name) if name == memory.soft.question:
            return _no_plan(memory, fact(Kind.NOT_ANSWERED, AgentName.KM))
        case Broken(conversation=name, reason=reason) if name == memory.soft.question:
            turn.log("question broke", reason=reason)
            return _no_plan(memory, fact(Kind.BROKE_OFF, AgentName.KM))
        case _:
            return memory


def _no_plan(memory: Memory, *why: Fact, later: bool = False) -> Memory:
    assert memory.problem is not None
    return replace(memory, result=hfsm.NoPlan(memory.problem.network.id, why, later))


# --- search ---------------------------------------------------------------------------------------


def search_plan(memory: Memory, turn: Turn) -> Memory:
    """State search: pass queries to km and answers back, until the search ends."""
    if turn.event is None:
        assert memory.problem is not None
        attempt = memory.attempt + 1
        turn.tell(Begin(attempt, memory.problem.network, memory.seed))
        return replace(memory, attempt=attempt)
    memory = _received(memory, turn)
    if memory.cancelled:
        return memory
    match turn.event:
        case Local(content=Ask(attempt=attempt, query=query)) if attempt == memory.attempt:
            return _ask(memory, turn, query)
        case Received(content=content, conversation=name) if name == memory.soft.question:
            return _answered(memory, turn, content)
        case Local(content=Found(attempt=attempt, plan=plan)) if attempt == memory.attempt:
            return replace(memory, result=plan)
        case Local(content=Died(reason=reason)):
            turn.log("search ended", reason=reason)
            return _no_plan(memory, fact(Kind.ENDED, "search"))
        case Started():
            return replace(memory, soft=Soft(lost=True))
        case _:
            return _unanswered(memory, turn)


def _answered(memory: Memory, turn: Turn, content: wm.AnyAnswer) -> Memory:
    if isinstance(content, wm.Unknown) and content.later:
        return _no_plan(replace(memory, soft=Soft()), *content.why, later=True)
    if isinstance(content, wm.UnknownState):
        turn.log("hypothesis lost", level="warning", state=content.id)
        return replace(memory, soft=Soft(lost=True))
    turn.tell(Answer(memory.attempt, content))
    return replace(memory, soft=Soft())


# --- finalize -------------------------------------------------------------------------------------


def answer_problem(memory: Memory, turn: Turn) -> Memory:
    """State finalize: end the search, send the result, drop the hypothetical states at km."""
    problem = memory.problem
    assert problem is not None
    if not isinstance(memory.result, hfsm.HierarchicalPlan):
        turn.tell(Stop(memory.attempt))
    if memory.soft.question:
        turn.drop(memory.soft.question)
    if turn.holds(problem.conversation) and memory.result is not None:
        messages.tell(turn, problem, memory.result)
    # later: no state was made, and km is busy
    if not (isinstance(memory.result, hfsm.NoPlan) and memory.result.later):
        messages.ask(turn, problem, messages.drop(problem), messages.DROP_WITHIN_S)
    return Memory(seed=memory.seed, waiting=memory.waiting, attempt=memory.attempt)
