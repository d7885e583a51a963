"""The behaviours of ta outside the plan, bound by name to the states of the design (paper, section
5.5, Tables 3 to 6).

idle -> running (the machine of the plan: running.py) -> closing -> finished -> idle; with waiting
where an act waits for the operator, with stopping and securing before closing if a plan is
cancelled or an act is late. Must not know: pl, geometry.
"""

import msgspec
from msgspec import UNSET
from msgspec.structs import replace

from agent_runtime.core.agent import Agent
from agent_runtime.core.events import Broken, Ordered, Received, Settled, Started, Woken
from agent_runtime.core.turn import Turn
from companion.autonomy import WAIT_S, Verb
from companion.design import AgentName, bind
from companion.languages import evidence, facts, hfsm, rc, sw, wm
from companion.languages.evidence import Claim
from companion.languages.facts import Facts, Kind, fact
from companion.sentences import operator
from fipa_codec.performatives import Performative
from services.task import acts, running
from services.task import plan as plans
from services.task.memory import CONDITIONS, Memory, Pending
from services.task.outgoing_messages import SURVEY

SURVEYS = 3  # tries of a look around; estimate: ex may still be starting at the first
AGAIN_S, AGAIN = 2.0, "survey again"
# estimate: km is restarted within seconds, or it is gone for good
BARRIER_S, BARRIER = 30.0, "barrier"
NOBODY = "nobody came"  # wake-up at the end of the wait for an operator
REASON_BYTES = 200  # with the evidence; a report must stay within its 400 bytes


def agent() -> Agent[Memory]:
    behaviours = {
        "await_plan": await_plan,
        "survey": survey,
        "run_plan": running.run_plan,
        "await_operator": await_operator,
        "stop_act": stop_act,
        "make_safe": running.make_safe,
        "close_plan": close_plan,
        "await_acknowledgement": await_acknowledgement,
    }
    return bind(AgentName.TA, Memory(), behaviours, CONDITIONS)


# --- idle and surveying ---------------------------------------------------------------------------


def await_plan(memory: Memory, turn: Turn) -> Memory:
    """State idle: take or refuse a plan; look around for a new observer of the world."""
    match turn.event:
        case Received(content=hfsm.HierarchicalPlan() as plan) as received:
            return _taken(memory, turn, received.conversation, plan)
        case Received(content=wm.ObserveWorld()) as received:
            turn.say(received.conversation, Performative.AGREE)
            return memory if acts.look_owed(turn) else replace(memory, survey=SURVEYS)
        case _:
            return memory


def _taken(memory: Memory, turn: Turn, conversation: str, plan: hfsm.HierarchicalPlan) -> Memory:
    try:
        plans.check(plan.root)
    except plans.PlanError as error:
        turn.log("wrong plan", level="warning", why=str(error))
        report = sw.Report(sw.WorkerState.FAILED, why=(fact(Kind.WRONG_PLAN),))
        turn.say(conversation, Performative.REFUSE, report)
        return memory
    return replace(_between_plans(memory), conversation=conversation, plan=plan)


def _between_plans(memory: Memory) -> Memory:
    """The memory that is kept from plan to plan; of the evidence, what hands hold, and what nobody
    has checked yet.
    """
    kept = tuple(one for one in memory.evidence if one.claim is Claim.HELD or not one.by)
    return Memory(hands=memory.hands, evidence=kept, acts=memory.acts)


def survey(memory: Memory, turn: Turn) -> Memory:
    """State surveying: look around, a few times if ex cannot do it yet; tell km how it ended."""
    match turn.event:
        case None:
            return _look_around(memory, turn)
        case Woken(name=name) if name == AGAIN:
            return _look_around(memory, turn)
        case Received(content=wm.ObserveWorld()) as received:
            turn.say(received.conversation, Performative.AGREE)
            return memory
    if acts.unanswered(memory, turn):
        acts.nothing_seen(turn, acts.UNANSWERED)
        return memory
    if acts.overdue(memory, turn):
        return acts.stop(memory, turn)
    looked = memory.act is not None
    memory, outcome = acts.hear(memory, turn)
    if memory.act is not None or not (looked or outcome):
        return memory
    if isinstance(outcome, rc.Done):
        return replace(memory, survey=0)
    why = outcome.why if outcome else (fact(Kind.CANCELLED),)
    turn.log("survey failed", level="warning", reason=operator(why))
    if memory.survey > 1:
        turn.wake(AGAIN, turn.now + AGAIN_S)
    else:
        acts.nothing_seen(turn, facts.fitting(why, REASON_BYTES))
    return replace(memory, survey=memory.survey - 1)


def _look_around(memory: Memory, turn: Turn) -> Memory:
    if memory.act is not None:
        return memory
    number = memory.acts + 1
    return acts.begin(
        replace(memory, acts=number), turn, replace(SURVEY, key=f"{SURVEY.key}-{number}")
    )


# --- waiting --------------------------------------------------------------------------------------


def await_operator(memory: Memory, turn: Turn) -> Memory:
    """State waiting: tell co what waits; go on when the operator says so, end where nobody does or
    the plan is cancelled.

    ta waits between two leaves, with no act under way. Putting down what a cancelled plan holds
    waits for nobody.
    """
    if turn.event is None:
        turn.wake(NOBODY, turn.now + WAIT_S)
        running.tell(memory, turn, sw.WorkerState.WAITING)
        return memory
    memory = _answered(running.take_in_any_state(memory, turn), turn)
    if not memory.asked:
        turn.unwake(NOBODY)
    return memory


def _answered(memory: Memory, turn: Turn) -> Memory:
    match turn.event:
        case Received(communicate=message, conversation=name) if name == memory.conversation:
            cancelled = message.performative is Performative.CANCEL
            return running.preempted(memory, turn, ()) if cancelled else memory
        case Woken(name=name) if name == NOBODY:
            held = (fact(Kind.HOLDING, *memory.hands.values()),) if memory.hands else ()
            why = (fact(Kind.NOBODY_CAME, WAIT_S / 60.0), *held)
            return replace(memory, end=sw.WorkerState.FAILED, why=why, pending=UNSET)
        case Ordered():
            return _ordered(memory, turn)
    return memory


def _ordered(memory: Memory, turn: Turn) -> Memory:
    """Take an order about the leaf that waits, or a level at which it need not wait."""
    verb = running.verb_about(turn, running.place(memory))
    if verb is Verb.REPLAN:
        following = plans.after(memory.machine, memory.asked, hfsm.Outcome.REPLAN)
        if isinstance(following, hfsm.Outcome):
            return replace(memory, end=running.ENDS[following], why=running.WANTED, pending=UNSET)
        return replace(memory, pending=Pending(following, let=True))
    free = verb is Verb.GO or not running.asks(
        memory, turn, plans.leaf(memory.machine, memory.asked)
    )
    return replace(memory, pending=Pending(memory.asked, let=True)) if free else memory


# --- stopping -------------------------------------------------------------------------------------


def stop_act(memory: Memory, turn: Turn) -> Memory:
    """State stopping: wait for the last message of ex after a cancel; take what crossed it; tell co
    where it is late.

    The wait goes on, since before its end nobody knows what the robot did. co gives the plan up at
    its reply-by.
    """
    memory = running.take_in_any_state(memory, turn)
    if acts.unanswered(memory, turn):
        running.tell(memory, turn, sw.WorkerState.TERMINATING, acts.UNANSWERED)
    memory, _ = acts.hear(memory, turn)
    return memory


# --- closing and finished -------------------------------------------------------------------------


def close_plan(memory: Memory, turn: Turn) -> Memory:
    """State closing: send the final report when km has all observations it depends on (the
    barrier).
    """
    memory = running.take_in_any_state(memory, turn)
    assert memory.end is not None
    pending = any(peer == acts.OBSERVER for peer, _ in turn.due)
    match turn.event:
        case Woken(name=name) if name == BARRIER and pending:
            return _report(memory, turn, (*memory.why, fact(Kind.NOT_OBSERVED_YET)))
        case None | Settled() | Started() | Woken() if not pending:
            return _report(memory, turn, memory.why)
        case None:
            turn.wake(BARRIER, turn.now + BARRIER_S)
    return memory


def _report(memory: Memory, turn: Turn, why: Facts) -> Memory:
    assert memory.end is not None
    turn.unwake(BARRIER)
    if turn.holds(memory.conversation):
        told = facts.fitting(facts.different(why), REASON_BYTES)
        room = REASON_BYTES - len(msgspec.msgpack.encode(told))
        known = evidence.fitting(memory.evidence, room)
        report = sw.Report(memory.end, why=told, evidence=known, hands=memory.hands)
        turn.say(memory.conversation, Performative.INFORM, report)
    return replace(memory, reported=True)


def await_acknowledgement(memory: Memory, turn: Turn) -> Memory:
    """State finished: wait until co has confirmed the final report, which ends the conversation."""
    running.refuse_look(turn)
    match turn.event:
        case Broken() | Received() | None if not turn.holds(memory.conversation):
            return _between_plans(memory)
    return memory
