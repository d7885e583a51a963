"""Messages of km: queries and observations, answers, its subscription to the observer."""

from typing import get_args

from agent_runtime.core.turn import Turn
from companion.design import AgentName
from companion.languages import wm
from companion.languages.facts import Kind, fact
from fipa_codec.performatives import Performative
from services.knowledge.memory import Question

OBSERVER = AgentName.TA
QUERIES, OBSERVATIONS = get_args(wm.AnyQuery), get_args(wm.AnyObservation)
NOT_YET = wm.Unknown((fact(Kind.LOOK_NOT_OVER),), later=True)


def answer(turn: Turn, question: Question, said: wm.AnyAnswer) -> None:
    """Answer a question; what is not known is a failure."""
    unknown = isinstance(said, wm.Unknown | wm.UnknownState)
    turn.say(
        question.conversation, Performative.FAILURE if unknown else Performative.INFORM_REF, said
    )


def subscribe(turn: Turn) -> str:
    """Subscribe to what the observer sees; return the conversation."""
    return turn.open(OBSERVER, "subscribe", Performative.SUBSCRIBE, wm.ObserveWorld())
