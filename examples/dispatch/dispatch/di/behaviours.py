"""di. Puts orders out to tender, one at a time, and awards each to the robot that would have done it soonest; robots do
theirs side by side.

A call has a reply-by: a robot that is silent is passed over, and what it offers later is rejected; until its tender
has ended it is not called again. Where a robot fails in an order, or is not heard of any more, the order goes to the
next best of the others, until none is left. So an order may be done twice: by a robot that was lost after it had done
it. Must not know: clocks, robots.
"""

from agent_runtime.core.agent import Agent
from agent_runtime.core.binding import Transition, bind
from agent_runtime.core.events import Broken, Late, Local, Received, Woken
from agent_runtime.core.turn import Turn
from fipa_codec.performatives import Performative as P
from msgspec.structs import replace

from dispatch.design import DESIGN
from dispatch.di.memory import CONDITIONS, Memory, Order
from dispatch.di.people import Wanted
from dispatch.languages.job import Call, Done, NotDone, NotFree, Offer

ROBOTS = tuple(link.agent for include in DESIGN.file.include for link in include.guest)
REPLY_BY_S = 90.0  # a bidder gives a plan up after less, and answers then (dispatch.bidder.planning)
PAUSE_S = 5.0  # before an order that no robot could do is put out again (estimate)
# beyond ten times what was offered: a robot plans again, waits for people, is slow on a busy machine (estimate)
PATIENCE_S = 600.0
ROUNDS = "rounds"
"""Parameter of the design: so often each robot is called for an order that it does not offer to do."""
AGAIN = "again"


def await_order(memory: Memory, turn: Turn) -> Memory:
    """Behaviour of `idle`: takes the order that a robot may be called for and has refused least often, of these the
    oldest: one that nobody can do now does not hold the others up.
    """
    memory = _hear(memory, turn)
    found: list[tuple[int, int, Order]] = []
    for order in memory.waiting:
        if not _left(order, turn):
            turn.log("given up", level="warning", order=order.number, refused=order.refused, tried=order.tried)
            memory = replace(_without(memory, order), failed=memory.failed + 1)
        elif robots := _callable(memory, order, turn):
            found.append((min(order.refused.get(robot, 0) for robot in robots), order.number, order))
    if found:
        order = min(found, key=lambda one: one[:2])[2]
        return replace(_without(memory, order), order=order)
    later = [at for order in memory.waiting for at in order.not_before.values() if at > turn.now]
    if later:
        turn.wake(AGAIN, min(later))
    return memory


def call_robots(memory: Memory, turn: Turn) -> Memory:
    """Behaviour of `calling`: calls each robot that is free, and waits until all have answered."""
    if turn.event is not None or memory.order is None:
        return _hear(memory, turn)
    called, calls = _callable(memory, memory.order, turn), dict(memory.calls)
    for robot in called:
        job = Call(memory.order.number, memory.order.task)
        calls[robot] = turn.open(robot, "cfp", P.CFP, job, reply_by_s=REPLY_BY_S)
    return replace(memory, calls=calls, pending=called, offers={})


def award(memory: Memory, turn: Turn) -> Memory:
    """Behaviour of `awarding`: the soonest gets the order, the others do not; without an offer it waits."""
    order, offers = memory.order, memory.offers
    if order is None:
        return memory
    if not offers:
        return replace(memory, order=None, waiting=_in_order(memory, order))
    robot = min(offers, key=lambda name: (offers[name], name))
    turn.say(memory.calls[robot], P.ACCEPT_PROPOSAL, reply_by_s=10.0 * offers[robot] + PATIENCE_S)
    for name in offers:
        if name != robot:
            turn.say(memory.calls[name], P.REJECT_PROPOSAL)
    calls = {name: call for name, call in memory.calls.items() if name == robot or name not in offers}
    turn.log("awarded", order=order.number, robot=robot, rest=offers[robot], offers=len(offers))
    return replace(memory, order=None, calls=calls, offers={}, awards=memory.awards | {robot: order})


# --- what is heard in any state -------------------------------------------------------------------


def _hear(memory: Memory, turn: Turn) -> Memory:
    match turn.event:
        case Local(content=Wanted(number=number, task=task)) if number > memory.heard:
            return replace(memory, waiting=(*memory.waiting, Order(number, task)), heard=number)
        case Received(content=Offer(rest=rest)) as received:
            return _offered(memory, turn, received, rest)
        case Received(content=NotFree(number=number, why=why), communicate=said):
            turn.log("not free", order=number, robot=said.sender, why=[str(fact.kind) for fact in why])
            return _closed(_refused(memory, turn, said.sender), said.sender)
        case Received(content=Done(number=number), communicate=said):
            return _ended(memory, turn, said.sender, number)
        case Received(content=NotDone(why=why), communicate=said):
            return _failed(_closed(memory, said.sender), turn, said.sender, ", ".join(fact.kind for fact in why))
        case Broken(conversation=name, reason=reason) if robot := _robot(memory, name):
            offers = {one: rest for one, rest in memory.offers.items() if one != robot}
            return _failed(replace(_closed(memory, robot), offers=offers), turn, robot, reason)
        case Late(conversation=name) if robot := _robot(memory, name):
            if robot in memory.pending:
                memory = _refused(memory, turn, robot)
                return replace(memory, pending=tuple(one for one in memory.pending if one != robot))
            return _failed(memory, turn, robot, "it is not heard of any more")
        case Woken(name=name) if name == AGAIN:
            return memory
    return memory


def _offered(memory: Memory, turn: Turn, received: Received, rest: float) -> Memory:
    robot = received.communicate.sender
    if robot not in memory.pending:  # it comes after its reply-by
        turn.say(received.conversation, P.REJECT_PROPOSAL)
        return _closed(memory, robot)
    pending = tuple(one for one in memory.pending if one != robot)
    return replace(memory, pending=pending, offers=memory.offers | {robot: rest})


def _ended(memory: Memory, turn: Turn, robot: str, number: int) -> Memory:
    """An order is done, perhaps by a robot that was not heard of for so long that another one has it, too."""
    turn.log("done", order=number, robot=robot)
    awards = {name: order for name, order in memory.awards.items() if name != robot}
    waiting = tuple(order for order in memory.waiting if order.number != number)
    return _closed(replace(memory, awards=awards, waiting=waiting, done=memory.done + 1), robot)


def _failed(memory: Memory, turn: Turn, robot: str, why: str) -> Memory:
    """The order that a robot had is to be done by another one."""
    order = memory.awards.get(robot)
    if order is None:
        return memory
    turn.log("not done", level="warning", order=order.number, robot=robot, why=why)
    awards = {name: one for name, one in memory.awards.items() if name != robot}
    again = replace(order, tried=(*order.tried, robot))
    return replace(memory, awards=awards, waiting=_in_order(memory, again))


def _refused(memory: Memory, turn: Turn, robot: str) -> Memory:
    """A robot that was called for the order does not offer; late refusals of older calls are of no order."""
    order = memory.order
    if order is None or robot not in memory.pending:
        return memory
    refused = order.refused | {robot: order.refused.get(robot, 0) + 1}
    not_before = order.not_before | {robot: turn.now + PAUSE_S}
    return replace(memory, order=replace(order, refused=refused, not_before=not_before))


def _left(order: Order, turn: Turn) -> tuple[str, ...]:
    """The robots that may still do an order."""
    most = turn.parameter(ROUNDS, int)
    return tuple(robot for robot in ROBOTS if robot not in order.tried and order.refused.get(robot, 0) < most)


def _callable(memory: Memory, order: Order, turn: Turn) -> tuple[str, ...]:
    return tuple(
        robot
        for robot in _left(order, turn)
        if robot not in memory.calls and order.not_before.get(robot, 0.0) <= turn.now
    )


def _in_order(memory: Memory, order: Order) -> tuple[Order, ...]:
    """The waiting orders with this one, in the order in which they were given."""
    return tuple(sorted((*memory.waiting, order), key=lambda one: one.number))


def _robot(memory: Memory, conversation: str) -> str:
    return next((robot for robot, call in memory.calls.items() if call == conversation), "")


def _closed(memory: Memory, robot: str) -> Memory:
    """The tender with this robot is over."""
    calls = {name: call for name, call in memory.calls.items() if name != robot}
    return replace(memory, calls=calls, pending=tuple(one for one in memory.pending if one != robot))


def _without(memory: Memory, order: Order) -> Memory:
    return replace(memory, waiting=tuple(one for one in memory.waiting if one.number != order.number))


BEHAVIOURS: dict[str, Transition[Memory]] = {
    behaviour.__name__: behaviour for behaviour in (await_order, call_robots, award)
}


def agent() -> Agent[Memory]:
    """The agent di."""
    return bind("di", Memory(), BEHAVIOURS, CONDITIONS, design=DESIGN, local=Wanted)
