"""a_traffic. Lets one robot at a time into the aisle, in the order in which they asked."""

from agent_runtime.core.agent import Agent
from agent_runtime.core.binding import Transition, bind
from agent_runtime.core.events import Broken, Received
from agent_runtime.core.turn import Turn
from fipa_codec.performatives import Performative as P

from depot.design import DESIGN
from depot.languages.way import Enter, Left
from depot.traffic.memory import CONDITIONS, Memory


def await_robot(memory: Memory, turn: Turn) -> Memory:
    """Behaviour of `free`: the first that asks is let in."""
    if isinstance(turn.event, Received) and isinstance(turn.event.content, Enter):
        return _let_in(turn, turn.event.conversation, ())
    return memory


def await_exit(memory: Memory, turn: Turn) -> Memory:
    """Behaviour of `taken`: others wait; when the aisle is left, the next is let in."""
    match turn.event:
        case Received(content=Enter()) as received:
            return Memory(memory.inside, (*memory.waiting, received.conversation))
        case Broken(conversation=name) if name in memory.waiting:
            return Memory(memory.inside, tuple(one for one in memory.waiting if one != name))
        case Received(content=Left()) | Broken():
            return _let_in(turn, memory.waiting[0], memory.waiting[1:]) if memory.waiting else Memory()
    return memory


def _let_in(turn: Turn, conversation: str, waiting: tuple[str, ...]) -> Memory:
    turn.say(conversation, P.AGREE)
    return Memory(conversation, waiting)


BEHAVIOURS: dict[str, Transition[Memory]] = {"await_robot": await_robot, "await_exit": await_exit}


def agent() -> Agent[Memory]:
    """The agent traffic."""
    return bind("traffic", Memory(), BEHAVIOURS, CONDITIONS, design=DESIGN)
