"""a_dispatcher. Puts each order out to tender among the robots, awards it to the one that has
delivered soonest.

A call has a reply-by: a robot that does not answer in time is passed over, and what it offers later
is rejected. Until its tender has ended it is not called again, so there is one open tender for each
robot at most. A robot that has the job and is not heard of any more fails the order, and its last
word is noted when it comes. Must not know: clocks.
"""

from agent_runtime.core.agent import Agent
from agent_runtime.core.binding import Transition, bind
from agent_runtime.core.events import Broken, Late, Received, Woken
from agent_runtime.core.turn import Turn
from fipa_codec.performatives import Performative as P
from msgspec.structs import replace

from depot.design import DESIGN
from depot.dispatcher.memory import CONDITIONS, Memory, Order
from depot.languages.job import Call, Carried, Offer
from depot.languages.order import Assigned, Carry, Delivered, Figures, NotDelivered, Watch
from depot.world import STATIONS

ROBOTS = ("mule", "ox")
REPLY_BY_S = 2.0  # a robot that is there answers within milliseconds (estimate)
PATIENCE_S = 10.0  # with a robot that has the job, beyond five times what it offered (estimate)
PAUSE_S = 1.0  # before robots are called again (estimate)
ROUNDS = "rounds"
"""Parameter of the design: calls of one order before it is given up."""
PAUSE = "pause"


def await_order(memory: Memory, turn: Turn) -> Memory:
    """Behaviour of `idle`: agrees to an order between stations, refuses any other."""
    match turn.event:
        case Received(content=Carry() as wanted) as received:
            if {wanted.source, wanted.target} <= STATIONS.keys() and wanted.source != wanted.target:
                turn.say(received.conversation, P.AGREE)
                order = Order(received.conversation, wanted.item, wanted.source, wanted.target)
                return replace(memory, order=order, rounds=0)
            why = f"from {wanted.source!r} to {wanted.target!r}; two of {', '.join(STATIONS)} are wanted"
            turn.say(received.conversation, P.REFUSE, NotDelivered(why))
    return _hear(memory, turn)


def call_robots(memory: Memory, turn: Turn) -> Memory:
    """Behaviour of `calling`: calls each robot that owes no answer to an older call, and waits
    until all have answered.
    """
    if turn.event is not None or memory.order is None:
        return _hear(memory, turn)
    order, calls = memory.order, dict(memory.calls)
    called = tuple(robot for robot in ROBOTS if robot not in calls)
    for robot in called:
        job = Call(order.item, order.source, order.target)
        calls[robot] = turn.open(robot, "cfp", P.CFP, job, reply_by_s=REPLY_BY_S, parent=order.conversation)
    return replace(memory, calls=calls, pending=called, rounds=memory.rounds + 1, waited=False)


def award(memory: Memory, turn: Turn) -> Memory:
    """Behaviour of `awarding`: the soonest has the job, the other does not."""
    if memory.order is None or not memory.offers:
        return memory
    robot = min(memory.offers, key=lambda name: (memory.offers[name], name))
    turn.say(memory.calls[robot], P.ACCEPT_PROPOSAL, reply_by_s=5.0 * memory.offers[robot] + PATIENCE_S)
    calls = {robot: memory.calls[robot]}
    for name, call in memory.calls.items():
        if name in memory.offers and name != robot:
            turn.say(call, P.REJECT_PROPOSAL)
        else:
            calls[name] = call
    turn.say(memory.order.conversation, P.INFORM, Assigned(robot, memory.offers[robot]))
    return replace(memory, calls=calls, offers={}, robot=robot)


def await_delivery(memory: Memory, turn: Turn) -> Memory:
    """Behaviour of `carrying`: passes the robot's last word on, or says that it is not heard of any
    more.
    """
    order, robot = memory.order, memory.robot
    match turn.event:
        case Received(content=Carried(item=item), communicate=said) if said.sender == robot and order is not None:
            turn.say(order.conversation, P.INFORM, Delivered(item))
            return _ended(replace(_closed(memory, robot), delivered=memory.delivered + 1), turn)
        case Late(conversation=name) if name == memory.calls[robot] and order is not None:
            turn.say(order.conversation, P.FAILURE, NotDelivered(f"{robot} is not heard of any more"))
            return _ended(replace(memory, failed=memory.failed + 1), turn)
        case Broken(conversation=name, reason=reason) if name == memory.calls[robot] and order is not None:
            turn.say(order.conversation, P.FAILURE, NotDelivered(reason))
            return _ended(replace(_closed(memory, robot), failed=memory.failed + 1), turn)
    return _hear(memory, turn)


def pause(memory: Memory, turn: Turn) -> Memory:
    """Behaviour of `pausing`: waits, then lets the robots be called again, or gives the order
    up.
    """
    match turn.event:
        case None:
            turn.wake(PAUSE, turn.now + PAUSE_S)
        case Woken(name=name) if name == PAUSE and memory.order is not None:
            if memory.rounds < turn.parameter(ROUNDS, int):
                return replace(memory, waited=True)
            why = f"no robot was free in {memory.rounds} calls"
            turn.say(memory.order.conversation, P.FAILURE, NotDelivered(why))
            return _ended(replace(memory, failed=memory.failed + 1), turn)
    return _hear(memory, turn)


# --- what is heard in any state -------------------------------------------------------------------


def _hear(memory: Memory, turn: Turn) -> Memory:
    match turn.event:
        case Received(content=Watch()) as received:
            turn.say(received.conversation, P.AGREE)
        case Received(content=Offer(seconds=seconds)) as received:
            return _offered(memory, turn, received, seconds)
        case Received(communicate=said) if said.protocol == "cfp":
            return _closed(memory, said.sender)
        case Broken(conversation=name):
            gone = next((robot for robot, call in memory.calls.items() if call == name), "")
            offers = {robot: seconds for robot, seconds in memory.offers.items() if robot != gone}
            return replace(_closed(memory, gone), offers=offers)
        case Late(conversation=name):
            silent = tuple(robot for robot in memory.pending if memory.calls[robot] == name)
            return replace(memory, pending=tuple(robot for robot in memory.pending if robot not in silent))
    return memory


def _offered(memory: Memory, turn: Turn, received: Received, seconds: float) -> Memory:
    robot = received.communicate.sender
    if robot not in memory.pending:  # it comes after its reply-by
        turn.say(received.conversation, P.REJECT_PROPOSAL)
        return _closed(memory, robot)
    pending = tuple(one for one in memory.pending if one != robot)
    return replace(memory, pending=pending, offers=memory.offers | {robot: seconds})


def _closed(memory: Memory, robot: str) -> Memory:
    """The tender with this robot is over."""
    calls = {name: call for name, call in memory.calls.items() if name != robot}
    return replace(memory, calls=calls, pending=tuple(one for one in memory.pending if one != robot))


def _ended(memory: Memory, turn: Turn) -> Memory:
    """The order is over; whoever watches learns the new figures."""
    turn.observe("desk", "figures", Figures(memory.delivered, memory.failed))
    return replace(memory, order=None, robot="")


BEHAVIOURS: dict[str, Transition[Memory]] = {
    behaviour.__name__: behaviour for behaviour in (await_order, call_robots, award, await_delivery, pause)
}


def agent() -> Agent[Memory]:
    """The agent dispatcher."""
    return bind("dispatcher", Memory(), BEHAVIOURS, CONDITIONS, design=DESIGN)
