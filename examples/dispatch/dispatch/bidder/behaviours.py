"""A bidder offers what a plan of its robot says, and has the robot do what it won. It bids while its robot has nothing
of it to do: a plan for a world that is not there yet would say nothing.

Must not know: clocks, the wire, how a plan is made.
"""

from agent_runtime.core.agent import Agent
from agent_runtime.core.binding import Transition, bind
from agent_runtime.core.events import Broken, Local, Received, Started
from agent_runtime.core.outside import GuestHears, GuestLeaves, GuestLost, GuestSays
from agent_runtime.core.turn import Turn
from companion.design import AgentName
from companion.languages.cmd import TaskReport
from companion.languages.facts import Facts, Kind, fact
from fipa_codec.languages import Kind as Guard
from fipa_codec.performatives import Performative as P
from msgspec import ValidationError, convert
from msgspec.structs import replace

from dispatch.bidder.memory import CONDITIONS, Memory
from dispatch.bidder.planning import NotPlanned, Plan, Planned
from dispatch.design import DESIGN
from dispatch.languages.job import Call, Done, NotDone, NotFree, Offer

USE = "job"
"""The guest's use by which a robot is asked for a task."""
UNKNOWN: Facts = (fact(Kind.NO_REASON, AgentName.HI),)
SILENT: Facts = (fact(Kind.NOT_ANSWERING, AgentName.HI),)


def await_call(memory: Memory, turn: Turn) -> Memory:
    """Behaviour of `idle`."""
    match turn.event:
        case Received(content=Call(number=number, task=task)) as received:
            return replace(memory, call=received.conversation, number=number, task=task)
    return memory


def await_plan(memory: Memory, turn: Turn) -> Memory:
    """Behaviour of `planning`: offers what the plan says, once; or refuses."""
    match turn.event:
        case None | Started():
            assert memory.task is not None
            turn.tell(Plan(memory.call, memory.task))
        case Local(content=Planned(call=call, parameters=known)) if call == memory.call:
            offer = Offer(memory.number, known.rest, known.suspend, known.resume)
            turn.say(call, P.PROPOSE, offer)
            return replace(memory, offered=True)
        case Local(content=NotPlanned(call=call, why=why, log=log)) if call == memory.call:
            turn.log("no plan", why=[one.kind for one in why], log=log)
            turn.say(call, P.REFUSE, NotFree(memory.number, why))
            return Memory(memory.robot)
        case Broken(conversation=call) if call == memory.call:
            return Memory(memory.robot)
    return memory


def await_award(memory: Memory, turn: Turn) -> Memory:
    """Behaviour of `offering`."""
    match turn.event:
        case Received(communicate=said) if said.performative is P.ACCEPT_PROPOSAL:
            return replace(memory, awarded=True)
        case Received() | Broken():
            return Memory(memory.robot)
    return memory


def await_end(memory: Memory, turn: Turn) -> Memory:
    """Behaviour of `doing`: asks the robot, and passes its last word on."""
    use = f"{memory.robot}.{USE}"
    match turn.event:
        case None:
            # the robot knows no two conversations of this name, whoever dies
            asked = f"{memory.call}-{turn.now * 1000:.0f}"
            turn.tell(GuestSays(use, asked, P.REQUEST, memory.task))
            return replace(memory, asked=asked)
        case Local(content=GuestHears(conversation=name, act=act, kind=kind, content=said)) if name == memory.asked:
            if act is P.INFORM and kind is Guard.PLAIN:
                return _over(memory, turn, P.INFORM, Done(memory.number))
            if act in (P.FAILURE, P.REFUSE):
                return _over(memory, turn, P.FAILURE, NotDone(memory.number, _why(said)))
        case Local(content=GuestLost(conversation=name, why=why)) if name == memory.asked:
            turn.log("lost", level="warning", why=why)
            return _over(memory, turn, P.FAILURE, NotDone(memory.number, SILENT))
        case Started():  # what the robot said meanwhile, nobody has heard
            turn.tell(GuestLeaves(use, memory.asked))
            return _over(memory, turn, P.FAILURE, NotDone(memory.number, SILENT))
        case Broken():  # di has forgotten the tender
            turn.tell(GuestLeaves(use, memory.asked))
            return Memory(memory.robot)
    return memory


def _over(memory: Memory, turn: Turn, act: P, said: Done | NotDone) -> Memory:
    turn.say(memory.call, act, said)
    return Memory(memory.robot)


def _why(said: object) -> Facts:
    """The reasons in a robot's last word."""
    try:
        return convert(said, TaskReport).why or UNKNOWN
    except ValidationError:  # a Reason in words, which the step log has
        return UNKNOWN


BEHAVIOURS: dict[str, Transition[Memory]] = {
    behaviour.__name__: behaviour for behaviour in (await_call, await_plan, await_award, await_end)
}
Heard = Planned | NotPlanned | GuestHears | GuestLost


def bidder(name: str, robot: str) -> Agent[Memory]:
    """The agent of this name, which bids for this robot."""
    return bind(name, Memory(robot), BEHAVIOURS, CONDITIONS, design=DESIGN, local=Heard)
