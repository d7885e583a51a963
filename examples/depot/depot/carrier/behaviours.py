"""The behaviours of a robot that carries: it offers, drives three trips (fetch, deliver, home), and
asks for the aisle.

Must not know: clocks, the wire, which of the two robots it is.
"""

from agent_runtime.core.agent import Agent
from agent_runtime.core.binding import Transition, bind
from agent_runtime.core.events import Broken, Local, Received, Started
from agent_runtime.core.turn import Turn
from fipa_codec.performatives import Performative as P
from msgspec.structs import replace

from depot.carrier.memory import CONDITIONS, Job, Memory
from depot.carrier.wheels import Arrived, At, Drive, Sensed
from depot.design import DESIGN
from depot.languages.job import Call, Carried, NotFree, Offer
from depot.languages.way import Enter, Left
from depot.world import STATIONS, crosses, duration


def await_call(memory: Memory, turn: Turn) -> Memory:
    """Behaviour of `idle`: offers how soon it could have carried; the offer binds it."""
    match turn.event:
        case None:
            return replace(memory, job=None, awarded=False, at_goal=False)
        case Received(content=Call() as call) as received if {call.source, call.target} <= STATIONS.keys():
            seconds = duration(memory.here, (call.source, call.target), memory.speed)
            turn.say(received.conversation, P.PROPOSE, Offer(round(seconds, 1)))
            return replace(memory, job=Job(received.conversation, call.item, call.source, call.target))
        case Received(content=Call()) as received:
            turn.say(received.conversation, P.REFUSE, NotFree(f"stations are {', '.join(STATIONS)}"))
    return memory


def await_award(memory: Memory, turn: Turn) -> Memory:
    """Behaviour of `offering`: waits for the answer to its offer."""
    if isinstance(turn.event, Broken):
        return replace(memory, job=None)
    if not isinstance(turn.event, Received) or memory.job is None:
        return memory
    if turn.event.communicate.performative is P.ACCEPT_PROPOSAL:
        return replace(memory, awarded=True, trips=(memory.job.source, memory.job.target, memory.home))
    return replace(memory, job=None)


def drive(memory: Memory, turn: Turn) -> Memory:
    """Behaviour of `fetching`, `delivering` and `returning`: one trip, through the aisle only when
    it is let in.
    """
    match turn.event:
        case None:
            return _set_out(replace(memory, at_goal=False), turn)
        case Received(content=Call()) as received:
            turn.say(received.conversation, P.REFUSE, NotFree("on the way home"))
        case Received(communicate=said) if said.performative is P.AGREE:
            return _go(memory, turn)
        case Broken(conversation=name) if name == memory.way and not memory.driving:
            return _set_out(memory, turn)
        case Started(first=False) if memory.driving:
            return _go(memory, turn)
        case Local(content=At(here=here)):
            return replace(memory, here=here)
        case Local(content=Arrived(station=station)) if memory.driving and station == memory.trips[0]:
            return _arrived(memory, turn, station)
    return memory


def _set_out(memory: Memory, turn: Turn) -> Memory:
    goal = memory.trips[0]
    if not crosses(memory.here, goal):
        return _go(memory, turn)
    job = memory.job.conversation if memory.job else ""
    return replace(memory, way=turn.open("traffic", "passage", P.REQUEST, Enter(goal), parent=job))


def _go(memory: Memory, turn: Turn) -> Memory:
    turn.tell(Drive(memory.here, memory.trips[0], memory.speed))
    return replace(memory, driving=True)


def _arrived(memory: Memory, turn: Turn, station: str) -> Memory:
    """Give the aisle back; where the thing was wanted, say so."""
    if memory.way:
        turn.say(memory.way, P.INFORM, Left())
    if memory.job is not None and len(memory.trips) == 2:
        turn.say(memory.job.conversation, P.INFORM, Carried(memory.job.item))
    return replace(memory, here=STATIONS[station], trips=memory.trips[1:], way="", driving=False, at_goal=True)


BEHAVIOURS: dict[str, Transition[Memory]] = {"await_call": await_call, "await_award": await_award, "drive": drive}


def carrier(name: str, first: Memory) -> Agent[Memory]:
    """The agent of this name, which begins with this memory."""
    return bind(name, first, BEHAVIOURS, CONDITIONS, design=DESIGN, local=Sensed)
