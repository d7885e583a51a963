"""The super-state of ta: the state machine of the plan, or the one that makes a cancelled plan safe
(paper, Table 6).

Only the position in the plan is kept; plan.py says where an outcome leads. Every change of state is
reported to co, which confirms it; ta waits only for the last confirm.
"""

from collections.abc import Callable

import msgspec
from msgspec import UNSET
from msgspec.structs import replace

from agent_runtime.core.control import SetParameter
from agent_runtime.core.events import Broken, Late, Ordered, Received, Started
from agent_runtime.core.turn import Turn
from companion import autonomy
from companion.acts import ACTS, needed
from companion.autonomy import LEVEL, Verb
from companion.design import AgentName
from companion.languages import hfsm, rc, sw, wm
from companion.languages.facts import Facts, Kind, fact, fitting
from companion.languages.hfsm import Place
from companion.sentences import operator
from fipa_codec.performatives import Performative
from services.task import acts
from services.task import plan as plans
from services.task.memory import Memory, Pending, Soft, way_to_safety
from services.task.outgoing_messages import SURVEY, ill, not_checked

ASK_WITHIN_S = 20.0  # estimate: km answers in ms and comes back in seconds
WHY_BYTES = 200  # of a report on the way, which must stay within its 400 bytes with its place
# to put down what is held: the second one starts elsewhere, with newer observations (estimate)
ATTEMPTS = 2
Outcome = hfsm.Outcome

ENDS = {
    Outcome.SUCCEEDED: sw.WorkerState.SUCCEEDED,
    Outcome.FAILED: sw.WorkerState.FAILED,
    Outcome.REPLAN: sw.WorkerState.REPLAN,
    Outcome.PREEMPTED: sw.WorkerState.PREEMPTED,
}
LOOK_FIRST = (
    rc.NotDoneKind.UNKNOWN,
    rc.NotDoneKind.NEW_WORLD,
    rc.NotDoneKind.LOST,
    rc.NotDoneKind.EMPTY,
    rc.NotDoneKind.MISSING,
    rc.NotDoneKind.BLOCKED,
)
PLAN_AGAIN = (
    rc.NotDoneKind.REPLAN,
    rc.NotDoneKind.SLIPPED,
    rc.NotDoneKind.BUSY,
    rc.NotDoneKind.INTERRUPTED,
    *LOOK_FIRST,
)
"""Kinds of NotDone after which a new plan may succeed: the world is not as planned, or the machine
failed.
"""


def take_in_any_state(memory: Memory, turn: Turn) -> Memory:
    """Take what may come in every state of a plan: a new observer, the end of the conversation with
    co.
    """
    refuse_look(turn)
    match turn.event:
        case Broken(conversation=name) if name == memory.conversation and memory.end is None:
            return preempted(memory, turn, (fact(Kind.BROKE_OFF, AgentName.CO),))
    return memory


def refuse_look(turn: Turn) -> None:
    """Tell an observer that comes during a plan that no look around is made for it."""
    match turn.event:
        case Received(content=wm.ObserveWorld()) as received:
            turn.say(received.conversation, Performative.AGREE)
            acts.nothing_seen(turn, (fact(Kind.NO_LOOK_IN_A_PLAN),))


# --- running --------------------------------------------------------------------------------------


def run_plan(memory: Memory, turn: Turn) -> Memory:
    """State running: run the states of the plan, until it ends, is cancelled, or an act is late."""
    if turn.event is None:
        assert memory.plan is not None
        let, position = bool(memory.let), memory.let or plans.first(memory.plan.root)
        return enter(replace(memory, pending=UNSET), turn, position, let=let)
    memory = take_in_any_state(memory, turn)
    if memory.end is not None:
        return memory
    match turn.event:
        case Received(communicate=message, conversation=name) if name == memory.conversation:
            cancelled = message.performative is Performative.CANCEL
            return preempted(memory, turn, ()) if cancelled else memory
        case Ordered() if replan_wanted(memory, turn):
            return replace(acts.stop(memory, turn), end=sw.WorkerState.REPLAN, why=WANTED)
        case _:
            return _go_on(memory, turn, _finish)


def preempted(memory: Memory, turn: Turn, why: Facts) -> Memory:
    """End a cancelled plan: stop the act, drop the query; what is held is put down afterwards."""
    if memory.soft.question:
        turn.drop(memory.soft.question)
    memory = replace(acts.stop(memory, turn), pending=UNSET)
    tell(memory, turn, sw.WorkerState.TERMINATING)
    return replace(memory, cancelled=True, end=sw.WorkerState.PREEMPTED, why=why, soft=Soft())


def _finish(memory: Memory, outcome: Outcome, why: Facts) -> Memory:
    """End the plan. If no other follows, say what nobody has checked: an object may stand though no
    look shows it.
    """
    if outcome is Outcome.REPLAN:
        return replace(memory, end=ENDS[outcome], why=why)
    return replace(
        memory, end=ENDS[outcome], why=(*(memory.told or ()), *why, *not_checked(memory.evidence))
    )


# --- securing -------------------------------------------------------------------------------------


def make_safe(memory: Memory, turn: Turn) -> Memory:
    """State securing: put down what is held as the plan says, with two tries; a second cancel
    changes nothing.
    """
    if turn.event is None:
        safe = way_to_safety(memory)
        assert safe is not None
        return enter(
            replace(memory, safe=safe, secured=1, end=None), turn, plans.first(safe), _secured
        )
    memory = _go_on(take_in_any_state(memory, turn), turn, _secured)
    if memory.end is not None and memory.hands and memory.secured < ATTEMPTS:
        memory = replace(memory, secured=memory.secured + 1, end=None, why=())
        return enter(memory, turn, plans.first(memory.machine), _secured)
    return memory


def _secured(memory: Memory, outcome: Outcome, why: Facts) -> Memory:
    """End the plan: Preempted if nothing is held, else Failed."""
    why = memory.why or why
    if not memory.hands:
        return replace(memory, end=sw.WorkerState.PREEMPTED, why=why)
    held = fact(Kind.STILL_HELD, *memory.hands.values(), *why)
    return replace(memory, end=sw.WorkerState.FAILED, why=(held,))


# --- both -----------------------------------------------------------------------------------------

Finish = Callable[[Memory, Outcome, Facts], Memory]


def enter(
    memory: Memory,
    turn: Turn,
    position: plans.Position,
    finish: Finish | None = None,
    *,
    let: bool = False,
) -> Memory:
    """Enter the leaf at `position`: report it, and start its act or query; or have it wait for the
    operator.

    `let`: the operator let it begin.
    """
    leaf = plans.leaf(memory.machine, position)
    if not let and asks(memory, turn, leaf):
        return replace(memory, at=memory.at or position, pending=Pending(position))
    memory = replace(memory, at=position)
    tell(memory, turn, sw.WorkerState.RUNNING)
    if isinstance(leaf, hfsm.ActState):
        # a new key if it is requested again
        again = f".{memory.secured}" if memory.secured > 1 else ""
        return acts.begin(memory, turn, replace(leaf.command, key=f"{leaf.command.key}{again}"))
    if isinstance(leaf, hfsm.AskState):
        return _ask(memory, turn, leaf)
    return leave(memory, turn, leaf.outcome, leaf.why, finish or _finish)


def leave(memory: Memory, turn: Turn, outcome: Outcome, why: Facts, finish: Finish) -> Memory:
    """Leave the leaf with an outcome: enter the next one, or finish the machine."""
    following = plans.after(memory.machine, memory.at, outcome)
    if isinstance(following, Outcome):
        return finish(memory, following, why)
    return enter(memory, turn, following, finish)


def _go_on(memory: Memory, turn: Turn, finish: Finish) -> Memory:
    """Take an event that the present leaf waits for."""
    if acts.overdue(memory, turn):
        end = sw.WorkerState.FAILED if memory.cancelled else sw.WorkerState.REPLAN
        return replace(
            acts.stop(memory, turn), end=end, why=(fact(Kind.TOOK_TOO_LONG, AgentName.EX),)
        )
    if memory.soft.question or isinstance(turn.event, Started):
        return _answered(memory, turn, finish)
    memory, outcome = acts.hear(memory, turn)
    if outcome is None or memory.act is not None:
        return memory
    return _acted(memory, turn, outcome, finish)


def _acted(memory: Memory, turn: Turn, outcome: acts.ActOutcome, finish: Finish) -> Memory:
    """Leave the leaf by the outcome of its act. After a look, plan again. Where the world is
    unknown (LOOK_FIRST) or an object is missing, look first. Where a new plan may succeed
    (PLAN_AGAIN), end with Replan, else fail. While a cancelled plan is made safe, no look is made.
    """
    if memory.looking:
        return finish(replace(memory, looking=False), Outcome.REPLAN, (*memory.why, *ill(outcome)))
    if isinstance(outcome, rc.Done):
        if outcome.missing and outcome.arrived is None and memory.safe is None:
            missing = tuple(fact(Kind.NOT_WHERE_IT_WAS, one) for one in outcome.missing)
            return _look(memory, turn, outcome.key, missing)
        return _done(memory, turn, outcome, finish)
    reason = operator(outcome.why)
    turn.log("act not done", level="warning", key=outcome.key, kind=outcome.kind, reason=reason)
    if memory.safe is not None:
        memory = replace(memory, why=memory.why or outcome.why)
    if outcome.kind in LOOK_FIRST and memory.safe is None:
        return _look(memory, turn, outcome.key, outcome.why)
    why = (*outcome.why, *ill(outcome))
    return leave(
        memory, turn, Outcome.REPLAN if outcome.kind in PLAN_AGAIN else Outcome.FAILED, why, finish
    )


def _look(memory: Memory, turn: Turn, key: str, why: Facts) -> Memory:
    """Look around after an act that left the world unknown, without moving an arm; then plan again.
    Say why at once.
    """
    memory = replace(memory, looking=True, why=why)
    tell(memory, turn, sw.WorkerState.ERROR, fitting(why, WHY_BYTES))
    return acts.begin(memory, turn, replace(SURVEY, key=f"{key}.look"))


def _done(memory: Memory, turn: Turn, done: rc.Done, finish: Finish) -> Memory:
    """Leave the leaf whose act is done. It failed if it did not do what it is for, or if no sense
    told a claim that it needs; an ex of another version tells of less.
    """
    leaf = plans.leaf(memory.machine, memory.at)
    assert isinstance(leaf, hfsm.ActState)
    row, needs = ACTS[type(leaf.command)], needed(type(leaf.command))
    lacking = tuple(one for one in done.evidence if not one.by and one.claim in needs)
    end = Outcome.SUCCEEDED if row.fulfilled(leaf.command, done) and not lacking else Outcome.FAILED
    told = row.outcome_facts(leaf.command, done)
    if row.remembered and not isinstance(plans.after(memory.machine, memory.at, end), Outcome):
        memory = replace(memory, told=(*(memory.told or ()), *told))
    return leave(memory, turn, end, (*(told or not_checked(lacking)), *ill(done)), finish)


# --- questions ------------------------------------------------------------------------------------


def _ask(memory: Memory, turn: Turn, leaf: hfsm.AskState) -> Memory:
    query, plan = Performative.QUERY_REF, memory.conversation
    name = turn.open(
        acts.OBSERVER, "query", query, leaf.query, reply_by_s=ASK_WITHIN_S, parent=plan
    )
    return replace(memory, soft=Soft(name))


def _answered(memory: Memory, turn: Turn, finish: Finish) -> Memory:
    leaf = plans.leaf(memory.machine, memory.at)
    if not isinstance(leaf, hfsm.AskState):
        return memory
    match turn.event:
        case Started():
            return _ask(memory, turn, leaf)
        case Received(conversation=name, content=content) if name == memory.soft.question:
            memory = replace(memory, soft=Soft())
            if isinstance(content, wm.Truth) and content.value is leaf.expect:
                return leave(memory, turn, Outcome.SUCCEEDED, (), finish)
            return leave(memory, turn, leaf.otherwise, _why_not(leaf, content), finish)
        case Late(conversation=name) | Broken(conversation=name) if name == memory.soft.question:
            why = (fact(Kind.NOT_ANSWERING, AgentName.KM),)
            return leave(replace(memory, soft=Soft()), turn, Outcome.FAILED, why, finish)
        case _:
            return memory


def _why_not(leaf: hfsm.AskState, content: object) -> Facts:
    """Why km does not answer as the plan expects."""
    if isinstance(content, wm.Unknown):
        return content.why
    match leaf.query:
        case wm.Holds(relation=wm.Relation.HAS_EXACT_POSE, subject=name):
            return (fact(Kind.NOT_LOCALIZED, name),)
    return (fact(Kind.NEW_PLAN_WANTED),)


def tell(memory: Memory, turn: Turn, state: sw.WorkerState, why: Facts = ()) -> None:
    """Report the position in the plan to co."""
    if not turn.holds(memory.conversation) or memory.plan is None:
        return
    report = sw.Report(state, place(memory), why, hands=memory.hands)
    turn.say(memory.conversation, Performative.INFORM, report)


# --- orders of the operator: which acts wait for one, what an order says (companion.autonomy) -----

# of a place: the ends of names, no longer step; a report must stay within 400 bytes
NAME_CHARS, STEP_BYTES = 40, 60
WANTED = (fact(Kind.OPERATOR_WANTS_A_PLAN),)


def asks(memory: Memory, turn: Turn, leaf: plans.Leaf) -> bool:
    """Whether a leaf waits for the operator at the present level; what makes a cancelled plan safe
    never does.
    """
    if memory.safe is not None or not isinstance(leaf, hfsm.ActState):
        return False
    return autonomy.asks(turn.parameter(LEVEL, str), type(leaf.command))


def replan_wanted(memory: Memory, turn: Turn) -> bool:
    """Whether this event is the operator's order to end the act under way, which is none of looking
    around.
    """
    if memory.act is None or memory.looking:
        return False
    return verb_about(turn, place(memory)) is Verb.REPLAN


def verb_about(turn: Turn, at: Place | None) -> Verb | None:
    """What the operator wants of this leaf, where the event is an order about it."""
    match turn.event:
        case Ordered(command=command) if (
            isinstance(command.order, SetParameter) and command.order.name == autonomy.STEP
        ):
            order = autonomy.read(str(command.order.value))
            here = at.id if at is not None else ""
            if order is not None and order.at == here:
                return order.verb
            turn.log(
                "word of the operator about another leaf", at=here, word=str(command.order.value)
            )
    return None


def place(memory: Memory) -> Place | None:
    """Where the leaf is that waits or is active, as co is told of it; None before the first one."""
    at = memory.asked or memory.at
    first = memory.safe or (plans.state_at(memory.machine, at[:1]) if at else None)
    if first is None:
        return None
    leaf = plans.leaf(memory.machine, at) if at else None
    command = leaf.command if isinstance(leaf, hfsm.ActState) else None
    path = (*((memory.safe.name,) if memory.safe else ()), *at)
    act = type(command).__name__ if command is not None else ""
    step = hfsm.step_of(first)
    short = step if len(msgspec.msgpack.encode(step)) <= STEP_BYTES else None
    return Place(
        tuple(name[-NAME_CHARS:] for name in path), short, act, getattr(command, "side", None)
    )
