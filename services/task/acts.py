"""Acts requested of ex: one at a time, each with its key. The observations in an outcome go to km
first.

The request is durable, in the same record as the position in the plan. A late reply does not end
the wait: ta sends a cancel, and the act ends with the last message of ex (delivery: request with
cancel, initiator).
"""

from msgspec.structs import replace

from agent_runtime.core.events import Broken, Late, Received, Woken
from agent_runtime.core.turn import Turn
from companion.acts import ACTS
from companion.design import AgentName
from companion.languages import rc, wm
from companion.languages.facts import Facts, Kind, fact
from fipa_codec.languages import Reason
from fipa_codec.performatives import Performative
from services.task.memory import Memory, RunningAct
from services.task.outgoing_messages import known_after, observations, subject

OBSERVER = AgentName.KM
# estimate: ex computes a skill in seconds; a path that it plans itself takes longer
AGREE_WITHIN_S = 60.0
# an act may last slack x its expected duration + 10 s (ruling with the design)
SLACK, MARGIN_S = "slack", 10.0
PATIENCE = "act"
STOPPED_S = 20.0  # estimate: ex brakes in a second and comes back in seconds
UNANSWERED = (fact(Kind.NOT_ANSWERING, AgentName.EX),)
ActOutcome = rc.Done | rc.NotDone


def begin(memory: Memory, turn: Turn, command: rc.Command) -> Memory:
    """Request an act of ex."""
    for_plan = memory.conversation
    name = turn.open(
        AgentName.EX,
        "request",
        Performative.REQUEST,
        command,
        reply_by_s=AGREE_WITHIN_S,
        parent=for_plan,
    )
    return replace(memory, act=RunningAct(name, command))


def stop(memory: Memory, turn: Turn) -> Memory:
    """Cancel the act under way, once."""
    act = memory.act
    if act is None or act.stopped:
        return memory
    turn.say(act.conversation, Performative.CANCEL, reply_by_s=STOPPED_S)
    return replace(memory, act=replace(act, stopped=True))


def hear(memory: Memory, turn: Turn) -> tuple[Memory, ActOutcome | None]:
    """Take an event of the act under way; its outcome, if it is there. The act is None after its
    end.
    """
    act = memory.act
    if act is None:
        return memory, None
    match turn.event:
        case Received(conversation=name) as received if name == act.conversation:
            return _answered(memory, turn, act, received)
        case Broken(conversation=name) if name == act.conversation:
            why = (fact(Kind.BROKE_OFF, AgentName.EX),)
            return _over(memory, turn), rc.NotDone(act.command.key, rc.NotDoneKind.INTERRUPTED, why)
        case _:
            return memory, None


def overdue(memory: Memory, turn: Turn) -> bool:
    """Whether this event means that ex takes too long."""
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


def unanswered(memory: Memory, turn: Turn) -> bool:
    """Whether this event means that ex does not answer the cancel; its answer is waited for all the
    same.
    """
    act = memory.act
    match turn.event:
        case Late(conversation=name):
            return act is not None and act.stopped and name == act.conversation
        case _:
            return False


def _answered(
    memory: Memory, turn: Turn, act: RunningAct, received: Received
) -> tuple[Memory, ActOutcome | None]:
    content = received.content
    if isinstance(content, rc.Accepted):
        turn.wake(PATIENCE, turn.now + turn.parameter(SLACK, float) * content.duration + MARGIN_S)
        return replace(memory, act=replace(act, agreed=True)), None
    ended = not turn.holds(act.conversation)
    outcome: ActOutcome | None = None
    if isinstance(content, rc.Done | rc.NotDone):
        outcome = content
        memory = _tell_km(memory, turn, act.command, outcome)
    elif ended and not act.stopped:
        turn.log(
            "act refused", level="warning", why=content.text if isinstance(content, Reason) else ""
        )
        understood = received.communicate.performative is not Performative.NOT_UNDERSTOOD
        why = fact(Kind.NO_REASON if understood else Kind.NOT_UNDERSTOOD, AgentName.EX)
        outcome = rc.NotDone(act.command.key, rc.NotDoneKind.FAILED, (why,))
    return (_over(memory, turn) if ended else memory), outcome


def _over(memory: Memory, turn: Turn) -> Memory:
    turn.unwake(PATIENCE)
    return replace(memory, act=None)


def _tell_km(memory: Memory, turn: Turn, command: rc.Command, outcome: ActOutcome) -> Memory:
    """Queue the observations of an outcome for km; the posture last, so that it ends a first look.

    A look that failed gives none: its posture alone would look like an empty world.
    """
    if isinstance(outcome, rc.NotDone) and outcome.kind == rc.NotDoneKind.NEW_WORLD:
        lost = wm.WorldLost(outcome.why)
        turn.observe(OBSERVER, subject(lost), lost)
        return replace(memory, hands={})
    if outcome.body is None or (isinstance(command, rc.Look) and isinstance(outcome, rc.NotDone)):
        return memory
    memory = replace(memory, evidence=known_after(memory.evidence, outcome))
    news: list[wm.AnySight] = sorted(
        observations(outcome, memory.evidence), key=lambda one: isinstance(one, wm.SeenBody)
    )
    if isinstance(outcome, rc.Done):
        news[:0] = ACTS[type(command)].sights(command, outcome)
    for one in news:
        turn.observe(OBSERVER, subject(one), one, last=isinstance(one, wm.SeenBody))
    return replace(memory, hands={side: held[0] for side, held in outcome.held.items()})


def nothing_seen(turn: Turn, why: Facts) -> None:
    """Queue for km why a look around showed nothing."""
    over = wm.NothingSeen(why)
    turn.observe(OBSERVER, subject(over), over)


def look_owed(turn: Turn) -> bool:
    """Whether the posture, which ends a look around, is still queued for km, so that no other look
    is needed.
    """
    return (OBSERVER, "body") in turn.due
