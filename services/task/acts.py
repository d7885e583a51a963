"""Acts asked of ex: one at a time, each with its key; what its outcome tells goes to km before anything else.

The request is durable and in the same record as the position in the plan. reply-by never ends the wait: it sends a
cancel behind the request, and the act is over with ex's last word (delivery: request with cancel, initiator).
"""

from msgspec.structs import replace

from agent_runtime.core.events import Broken, Late, Received, Woken
from agent_runtime.core.turn import Turn
from companion.languages import rc, wm
from fipa_codec.languages import Reason
from fipa_codec.performatives import Performative
from services.task.memory import Act, Memory
from services.task.observing import observations, subject

OBSERVER, DOER = "km", "ex"
AGREE_WITHIN_S = 60.0  # estimate: ex solves the joints of a skill in seconds; a home-made way may take some more
SLACK, MARGIN_S = 5.0, 10.0  # an act may last 5 x its expected duration + 10 s (ruling with the design)
PATIENCE = "act"
Outcome = rc.Done | rc.NotDone


def begin(memory: Memory, turn: Turn, command: rc.Act) -> Memory:
    """Ask ex for the act."""
    name = turn.open(DOER, "request", Performative.REQUEST, command, reply_by_s=AGREE_WITHIN_S)
    return replace(memory, act=Act(name, command))


def stop(memory: Memory, turn: Turn) -> Memory:
    """Ask ex to stop the act under way, once."""
    act = memory.act
    if act is None or act.stopped:
        return memory
    turn.say(act.conversation, Performative.CANCEL)
    return replace(memory, act=replace(act, stopped=True))


def hear(memory: Memory, turn: Turn) -> tuple[Memory, Outcome | None]:
    """What an event says of the act under way: its outcome when that comes; the act is None after ex's last word."""
    act = memory.act
    if act is None:
        return memory, None
    match turn.event:
        case Received(conversation=name, content=content) as received if name == act.conversation:
            return _told(memory, turn, act, received, content)
        case Broken(conversation=name, reason=reason) if name == act.conversation:
            return _over(memory, turn), rc.NotDone(act.command.key, "interrupted", f"ex: {reason}")
        case _:
            return memory, None


def overdue(memory: Memory, turn: Turn) -> bool:
    """Whether this event says that ex took too long."""
    act = memory.act
    if act is None or act.stopped:
        return False
    match turn.event:
        case Late(conversation=name):
            return name == act.conversation and not act.agreed
        case Woken(name=name):
            return name == PATIENCE
        case _:
            return False


def _told(memory: Memory, turn: Turn, act: Act, received: Received, content: object) -> tuple[Memory, Outcome | None]:
    if isinstance(content, rc.Accepted):
        turn.wake(PATIENCE, turn.now + SLACK * content.duration + MARGIN_S)
        return replace(memory, act=replace(act, agreed=True)), None
    ended = not turn.holds(act.conversation)
    outcome: Outcome | None = None
    if isinstance(content, rc.Done | rc.NotDone):
        outcome = content
        memory = _observed(memory, turn, act.command, outcome)
    elif ended and not act.stopped:
        words = content.text if isinstance(content, Reason) else f"answered {received.communicate.performative}"
        outcome = rc.NotDone(act.command.key, "failed", f"ex: {words}")
    return (_over(memory, turn) if ended else memory), outcome


def _over(memory: Memory, turn: Turn) -> Memory:
    turn.unwake(PATIENCE)
    return replace(memory, act=None)


def _observed(memory: Memory, turn: Turn, command: rc.Act, outcome: Outcome) -> Memory:
    """Owe km what the outcome tells; the posture last, so that who knows it knows the rest of a first look.

    A look that was not done tells nothing: its posture alone would pass for a look at an empty world.
    """
    if outcome.body is None or (isinstance(command, rc.Look) and isinstance(outcome, rc.NotDone)):
        return memory
    news: list[wm.AnySight] = sorted(observations(outcome), key=lambda one: isinstance(one, wm.SeenBody))
    if isinstance(outcome, rc.Done) and isinstance(command, rc.Pour):
        news.insert(0, wm.SeenContent(source=command.source, destination=command.destination))
    for one in news:
        turn.observe(OBSERVER, subject(one), one, last=isinstance(one, wm.SeenBody))
    return replace(memory, hands={side: held[0] for side, held in outcome.held.items()})


def nothing_seen(turn: Turn, reason: str) -> None:
    """Owe km why a look around showed nothing."""
    over = wm.NothingSeen(reason)
    turn.observe(OBSERVER, subject(over), over)


def look_owed(turn: Turn) -> bool:
    """Whether km is still to be told the posture, which ends a look around, so that it needs no other."""
    return (OBSERVER, "body") in turn.due
