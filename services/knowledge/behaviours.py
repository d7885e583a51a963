"""The behaviours of km, bound by name to the states of the design (paper, section 5.5, Tables 3 to
6).

The journal is the only source of truth: the observed scene is the memory of the agent, written with
the versions of its observations in the record of the step that took them. The triple store is told
of each new scene; it is a copy for SPARQL and export. Hypothetical states are soft: a death loses
them, and pl starts its search again. Must not know: stores, who plans what.
"""

from msgspec.structs import replace

from agent_runtime.core.agent import Agent, Taken
from agent_runtime.core.events import Broken, PeerChanged, Received, Started, Woken
from agent_runtime.core.streams import parse_observation
from agent_runtime.core.turn import Turn
from companion import sentences
from companion.design import AgentName, bind
from companion.languages import wm
from companion.languages.facts import Facts, Kind, fact, fitting
from companion.world.observe import forgotten, observed
from fipa_codec.performatives import Performative
from services.knowledge import outgoing_messages
from services.knowledge.answers import LARGEST_WHY, ask
from services.knowledge.memory import CONDITIONS, Memory, Mirror, News, Overlays, Question
from services.knowledge.outgoing_messages import OBSERVATIONS, OBSERVER, QUERIES

HELD_S = 5.0  # estimate: a look around takes 5 s, so that most questions are put off once at most
ALONE_S = 20.0  # estimate: an observer that died is restarted within seconds
AGAIN_S = 1.0  # after a subscription was declined; estimate
LONGEST = 500  # characters of a query in the log; estimate: the changes of a step are longer
HELD, ALONE, SUBSCRIBE_AGAIN = "held", "alone", "subscribe again"


def agent() -> Agent[Memory]:
    """Return the agent km."""
    behaviours = {
        "await_message": await_message,
        "answer_question": answer_question,
        "save_knowledge": save_knowledge,
    }
    return bind(AgentName.KM, Memory(), behaviours, CONDITIONS, takes={"await_message": takes})


def takes(memory: Memory, event: Taken) -> bool:
    """Whether an event is taken now. A question waits for the end of the look around, for a
    while.
    """
    if not memory.patient or memory.soft.held:
        return True
    return not (isinstance(event, Received) and isinstance(event.content, QUERIES))


def await_message(memory: Memory, turn: Turn) -> Memory:
    """State idle: keep the subscription alive; note a query or an observation for the next
    state.
    """
    match turn.event:
        case Received(content=content) as received if isinstance(content, QUERIES):
            return _soft(memory, question=Question(received.conversation, content))
        case Received(content=content) as received if isinstance(content, OBSERVATIONS):
            if (parsed := parse_observation(received.communicate.id)) is not None:
                return _soft(memory, news=News(content, parsed[1], turn.now))
            turn.log("observation without a version", level="warning", id=received.communicate.id)
            return memory
        case PeerChanged(agent=agent, incarnation=incarnation) if agent == OBSERVER:
            return _alone(memory, turn) if incarnation is None else _met(memory, turn, incarnation)
        case Received(communicate=message) as received if (
            received.conversation == memory.soft.subscription
        ):
            return (_agreed if message.performative is Performative.AGREE else _declined)(
                memory, turn
            )
        case Broken(conversation=conversation) if conversation == memory.soft.subscription:
            return _declined(memory, turn)
        case Woken(name=name):
            return _woken(memory, turn, name)
        case Started():
            turn.tell(Mirror(memory.scene))
            return _hopeful(memory, turn) if memory.patient else memory
        case _:
            return memory


# --- the observer ---------------------------------------------------------------------------------


def _woken(memory: Memory, turn: Turn, name: str) -> Memory:
    if name == SUBSCRIBE_AGAIN and OBSERVER in turn.peers:
        return _subscribed(memory, turn, turn.peers[OBSERVER])
    if name == HELD and memory.patient:
        return _soft(memory, held=True)
    if name == ALONE and memory.patient:
        return replace(memory, patient=False, blind=(fact(Kind.OBSERVER_AWAY),))
    return memory


def _hopeful(memory: Memory, turn: Turn) -> Memory:
    """Wait for a look around: until its end, or for a while without an observer."""
    turn.wake(HELD, turn.now + HELD_S)
    turn.wake(ALONE, turn.now + ALONE_S)
    return replace(memory, patient=True, blind=())


def _met(memory: Memory, turn: Turn, incarnation: int) -> Memory:
    """Note that the observer is there. Each incarnation looks around for a new subscriber, or says
    why not.
    """
    if memory.soft.subscription and memory.soft.incarnation == incarnation:
        return _agreed(memory, turn) if memory.soft.agreed else memory
    if memory.patient or memory.blind:
        memory = _hopeful(memory, turn)
    return _subscribed(memory, turn, incarnation)


def _subscribed(memory: Memory, turn: Turn, incarnation: int) -> Memory:
    """Subscribe; this replaces an older subscription."""
    if memory.soft.subscription:
        turn.drop(memory.soft.subscription)
    new = outgoing_messages.subscribe(turn)
    return _soft(memory, subscription=new, incarnation=incarnation, agreed=False)


def _agreed(memory: Memory, turn: Turn) -> Memory:
    turn.unwake(ALONE)
    return _soft(memory, agreed=True)


def _alone(memory: Memory, turn: Turn) -> Memory:
    """Note that there is no observer now."""
    if memory.patient and memory.soft.agreed:
        turn.wake(ALONE, turn.now + ALONE_S)
    return memory


def _declined(memory: Memory, turn: Turn) -> Memory:
    turn.wake(SUBSCRIBE_AGAIN, turn.now + AGAIN_S)
    return _soft(_alone(memory, turn), subscription="", incarnation=0, agreed=False)


# --- what was taken -------------------------------------------------------------------------------


def answer_question(memory: Memory, turn: Turn) -> Memory:
    """State questionAnswering: answer from the scene and the hypothetical states, or "later"."""
    question = memory.soft.question
    assert question is not None
    overlays, said = answer(memory, question.query)
    if memory.patient:
        turn.wake(HELD, turn.now + HELD_S)
    if isinstance(said, wm.UnknownState):
        turn.log("no such hypothetical state", conversation=question.conversation, state=said.id)
    elif isinstance(said, wm.Unknown) and not said.later:
        asked = str(question.query)[:LONGEST]
        why = sentences.operator(said.why)
        turn.log("not known", conversation=question.conversation, asked=asked, why=why)
    outgoing_messages.answer(turn, question, said)
    return _soft(memory, overlays=overlays, question=None, held=False)


def answer(memory: Memory, query: wm.AnyQuery) -> tuple[Overlays, wm.AnyAnswer]:
    """The hypothetical states after the query, and the answer; why, if nothing was seen."""
    if memory.patient:
        return memory.soft.overlays, outgoing_messages.NOT_YET
    if memory.blind and not memory.scene.things and isinstance(query, wm.ListObjects):
        why = fact(Kind.NOT_LOOKED_AROUND, fitting(memory.blind, LARGEST_WHY))
        return memory.soft.overlays, wm.Unknown((why,))
    return ask(memory.scene, memory.soft.overlays, query)


def save_knowledge(memory: Memory, turn: Turn) -> Memory:
    """State knowledgeSaving: the newest observation of a subject counts."""
    news = memory.soft.news
    assert news is not None
    if isinstance(news.observation, wm.NothingSeen):
        return _soft(_looked_around(memory, turn, news.observation.why), news=None)
    if isinstance(news.observation, wm.WorldLost):
        return _soft(_forgotten(memory, turn, news), news=None)
    if isinstance(news.observation, wm.SeenBody):  # the last observation of a look
        memory = _looked_around(memory, turn)
    scene = observed(memory.scene, news.observation, news.version, news.at)
    if scene is not memory.scene:
        turn.tell(Mirror(scene))
    return _soft(replace(memory, scene=scene), news=None)


def _forgotten(memory: Memory, turn: Turn, news: News) -> Memory:
    """Drop everything that was observed before, and wait for a look around."""
    scene = forgotten(memory.scene, news.version)
    if scene is memory.scene:
        return memory
    turn.tell(Mirror(scene))
    return _hopeful(_soft(replace(memory, scene=scene), overlays=Overlays()), turn)


def _looked_around(memory: Memory, turn: Turn, failed: Facts = ()) -> Memory:
    """End the wait for a look around; a failure after a success changes nothing."""
    turn.unwake(HELD)
    turn.unwake(ALONE)
    if not failed:
        return replace(memory, patient=False, blind=())
    return replace(memory, patient=False, blind=failed) if memory.patient else memory


def _soft(memory: Memory, **changes: object) -> Memory:
    return replace(memory, soft=replace(memory.soft, **changes))
