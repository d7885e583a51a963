"""a_km's behaviours, bound by name to the states of the design (paper, section 5.5, Tables 3 to 6).

The journal is the one truth: the observed scene is the agent's memory, written with the versions of its observations in
the record of the step that took them. The triple store is told of each new scene and only mirrors it, for SPARQL and
export. Hypothetical states are soft: a death takes them, and pl begins anew. Must not know: stores, who plans what.
"""

from typing import get_args

import msgspec
from msgspec.structs import replace

from agent_runtime.agent import Agent, Taken
from agent_runtime.events import Broken, PeerChanged, Received, Started, Woken
from agent_runtime.streams import parse_observation
from agent_runtime.turn import Turn
from companion.binding import bind
from companion.languages import wm
from fipa_codec.performatives import Performative
from services.knowledge.answers import ask
from services.knowledge.observe import observed
from services.knowledge.overlays import Overlays
from services.knowledge.scene import Scene

OBSERVER = "ta"
PATIENCE_S = 20.0  # estimate: a look around takes 5 s, the robot some seconds more to come up
AGAIN_S = 1.0  # after a subscription was declined; estimate
FIRST_LOOK, SUBSCRIBE_AGAIN = "first look", "subscribe again"
QUERIES, OBSERVATIONS = get_args(wm.AnyQuery), get_args(wm.AnyObservation)


class Question(msgspec.Struct, frozen=True):
    """A query with the conversation it came in."""

    conversation: str
    query: wm.AnyQuery


class News(msgspec.Struct, frozen=True):
    """An observation with its version and the time it came [unix s]."""

    observation: wm.AnyObservation
    version: tuple[int, int]
    at: float


class Soft(msgspec.Struct, frozen=True):
    """Hypothetical states, the subscription with the observer's incarnation it is for, what was just taken."""

    overlays: Overlays = Overlays()
    subscription: str = ""
    incarnation: int = 0
    question: Question | None = None
    news: News | None = None


class Memory(msgspec.Struct, frozen=True):
    """What was observed. `patient`: questions wait, since the first look around may still come."""

    scene: Scene = Scene()
    patient: bool = True
    soft: Soft = Soft()


class Mirror(msgspec.Struct, frozen=True):
    """To the triple store: this is the observed scene now."""

    scene: Scene


def agent() -> Agent[Memory]:
    """a_km as the design has it."""
    return bind(
        "km",
        Memory(),
        {"await_message": await_message, "answer_question": answer_question, "save_knowledge": save_knowledge},
        {
            "message_taken": lambda memory: memory.soft.question is not None or memory.soft.news is not None,
            "question_waits": lambda memory: memory.soft.question is not None,
            "observation_waits": lambda memory: memory.soft.news is not None,
            "question_answered": lambda memory: memory.soft.question is None,
            "knowledge_saved": lambda memory: memory.soft.news is None,
        },
        takes={"await_message": takes},
    )


def takes(memory: Memory, event: Taken) -> bool:
    """A question of facts waits until the world was looked at once, but not for ever.

    The posture is what an observer tells last of a look: once it is known, the rest is.
    """
    if not memory.patient or "torso" in memory.scene.joints:
        return True
    return not (isinstance(event, Received) and isinstance(event.content, QUERIES))


def await_message(memory: Memory, turn: Turn) -> Memory:
    """idle: keeps the subscription alive; notes a query or an observation for the state that deals with it."""
    match turn.event:
        case Received(content=content) as received if isinstance(content, QUERIES):
            return _soft(memory, question=Question(received.conversation, content))
        case Received(content=content) as received if isinstance(content, OBSERVATIONS):
            return _noted(memory, turn, received, content)
        case PeerChanged(agent=agent, incarnation=int(incarnation)) if agent == OBSERVER:
            return _subscribed(memory, turn, incarnation)
        case Received(communicate=word) as received if received.conversation == memory.soft.subscription:
            return _declined(memory, turn) if word.performative is not Performative.AGREE else memory
        case Broken(conversation=conversation) if conversation == memory.soft.subscription:
            return _declined(memory, turn)
        case Woken(name=name) if name == FIRST_LOOK:
            return replace(memory, patient=False)
        case Woken(name=name) if name == SUBSCRIBE_AGAIN and OBSERVER in turn.peers:
            return _subscribed(memory, turn, turn.peers[OBSERVER])
        case Started():
            return _started(memory, turn)
        case _:
            return memory


def _started(memory: Memory, turn: Turn) -> Memory:
    turn.tell(Mirror(memory.scene))
    if memory.patient:
        turn.wake(FIRST_LOOK, turn.now + PATIENCE_S)
    return memory


def _subscribed(memory: Memory, turn: Turn, incarnation: int) -> Memory:
    """Subscribe, unless this life of the observer is subscribed to already."""
    if memory.soft.subscription and memory.soft.incarnation == incarnation:
        return memory
    if memory.soft.subscription:
        turn.drop(memory.soft.subscription)
    if memory.patient:
        turn.wake(FIRST_LOOK, turn.now + PATIENCE_S)
    name = turn.open(OBSERVER, "subscribe", Performative.SUBSCRIBE, wm.ObserveWorld())
    return _soft(memory, subscription=name, incarnation=incarnation)


def _declined(memory: Memory, turn: Turn) -> Memory:
    turn.wake(SUBSCRIBE_AGAIN, turn.now + AGAIN_S)
    return _soft(memory, subscription="", incarnation=0)


def _noted(memory: Memory, turn: Turn, received: Received, content: wm.AnyObservation) -> Memory:
    parsed = parse_observation(received.communicate.id)
    if parsed is None:
        turn.log("observation without a version", level="warning", id=received.communicate.id)
        return memory
    return _soft(memory, news=News(content, parsed[1], turn.now))


def answer_question(memory: Memory, turn: Turn) -> Memory:
    """questionAnswering: a pure function of the scene, the hypothetical states and the query."""
    question = memory.soft.question
    assert question is not None
    overlays, answer = ask(memory.scene, memory.soft.overlays, question.query)
    unknown = isinstance(answer, wm.Unknown | wm.UnknownState)
    turn.say(question.conversation, Performative.FAILURE if unknown else Performative.INFORM_REF, answer)
    return _soft(memory, overlays=overlays, question=None)


def save_knowledge(memory: Memory, turn: Turn) -> Memory:
    """knowledgeSaving: the newest observation of a subject is the true one."""
    news = memory.soft.news
    assert news is not None
    scene = observed(memory.scene, news.observation, news.version, news.at)
    if scene is not memory.scene:
        turn.tell(Mirror(scene))
    return _soft(replace(memory, scene=scene), news=None)


def _soft(memory: Memory, **changes: object) -> Memory:
    return replace(memory, soft=replace(memory.soft, **changes))
