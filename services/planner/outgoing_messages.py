"""Messages of pl: to co on a problem, to km in queries."""

from agent_runtime.core.turn import Turn
from companion.design import AgentName
from companion.languages import facts, hfsm, wm
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from services.planner.memory import Problem

# estimate: km holds a question for 5 s, answers in ms, comes back in seconds
ANSWER_WITHIN_S = 30.0
DROP_WITHIN_S = 5.0  # if the drop is lost, km forgets the oldest states by itself


# --- to co ----------------------------------------------------------------------------------------


def agree(turn: Turn, conversation: str, network: hfsm.GroundTaskNetwork) -> None:
    turn.say(conversation, Performative.AGREE, hfsm.Taken(network.id))


def tell(turn: Turn, problem: Problem, result: hfsm.HierarchicalPlan | hfsm.NoPlan) -> None:
    """Send the plan, or why there is none."""
    found = isinstance(result, hfsm.HierarchicalPlan)
    turn.say(problem.conversation, Performative.INFORM if found else Performative.FAILURE, result)


def cancelled(turn: Turn, conversation: str, network: str) -> None:
    """Answer a cancel; the conversation ends."""
    why = (facts.fact(facts.Kind.CANCELLED),)
    turn.say(conversation, Performative.INFORM, hfsm.NoPlan(network, why), kind=Kind.CANCEL)


# --- to km ----------------------------------------------------------------------------------------


def ask(turn: Turn, problem: Problem, query: wm.AnyQuery, within_s: float = ANSWER_WITHIN_S) -> str:
    """Ask km for a problem; the conversation in which the answer comes, if it does within
    `within_s` [s].
    """
    asked = Performative.QUERY_REF
    return turn.open(
        AgentName.KM, "query", asked, query, reply_by_s=within_s, parent=problem.conversation
    )


def drop(problem: Problem) -> wm.DropStates:
    """The query that drops all hypothetical states of a problem."""
    return wm.DropStates(prefix=f"{problem.network.id}/")
