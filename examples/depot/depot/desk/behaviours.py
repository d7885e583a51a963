"""a_desk. Takes orders of people, one after the other, and tells what became of them. Must not
know: the wire.
"""

from agent_runtime.core.agent import Agent
from agent_runtime.core.binding import Transition, bind
from agent_runtime.core.events import Broken, Local, PeerChanged, Received
from agent_runtime.core.turn import Turn
from fipa_codec.performatives import Performative as P
from msgspec.structs import replace

from depot.design import DESIGN
from depot.desk.memory import CONDITIONS, Memory
from depot.desk.people import Wish
from depot.languages.order import Assigned, Carry, Delivered, Figures, NotDelivered, Watch


def listen(memory: Memory, turn: Turn) -> Memory:
    """Behaviour of `listening`: waits for an order of a person."""
    return _hear(memory, turn)


def await_end(memory: Memory, turn: Turn) -> Memory:
    """Behaviour of `waiting`: orders the oldest wish, and waits for its end."""
    match turn.event:
        case None:
            wish = memory.wishes[0]
            name = turn.open("dispatcher", "request", P.REQUEST, Carry(wish.item, wish.source, wish.target))
            return replace(memory, wishes=memory.wishes[1:], order=name)
        case Received(content=Assigned(robot=robot, seconds=seconds)):
            turn.log("assigned", robot=robot, seconds=seconds)
        case Received(content=Delivered(item=item)):
            turn.log("delivered", item=item)
            return replace(memory, order="", ended=memory.ended + 1, delivered=memory.delivered + 1)
        case Received(content=NotDelivered(reason=reason)):
            turn.log("not delivered", level="warning", why=reason)
            return replace(memory, order="", ended=memory.ended + 1)
        case Broken(conversation=name, reason=reason) if name == memory.order:
            turn.log("not delivered", level="warning", why=reason)
            return replace(memory, order="", ended=memory.ended + 1)
    return _hear(memory, turn)


def _hear(memory: Memory, turn: Turn) -> Memory:
    """In both states: new wishes, the figures, and a dispatcher that is there (again) to be
    watched.
    """
    match turn.event:
        case Local(content=Wish() as wish) if wish.number > memory.heard:
            return replace(memory, wishes=(*memory.wishes, wish), heard=wish.number)
        case PeerChanged(agent="dispatcher", incarnation=int() as life):
            if memory.watched == life and turn.holds(memory.watch):
                return memory  # the router was away, not the dispatcher: it knows the subscription
            turn.drop(memory.watch)
            watch = turn.open("dispatcher", "subscribe", P.SUBSCRIBE, Watch())
            return replace(memory, watch=watch, watched=life)
        case Received(content=Figures(delivered=delivered, failed=failed)):
            turn.log("figures", delivered=delivered, failed=failed)
    return memory


BEHAVIOURS: dict[str, Transition[Memory]] = {"listen": listen, "await_end": await_end}


def agent() -> Agent[Memory]:
    """The agent desk."""
    return bind("desk", Memory(), BEHAVIOURS, CONDITIONS, design=DESIGN, local=Wish)
