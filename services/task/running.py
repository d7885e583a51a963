"""The super-state of ta: the state machine of the plan, or the one that makes a cancelled plan safe (paper, Table 6).

Only the position in the plan is kept; plan.py says where an outcome leads. Every change of state is reported to co,
which confirms it; ta waits only for the last confirm.
"""

from collections.abc import Callable

from msgspec import UNSET
from msgspec.structs import replace

from agent_runtime.core.events import Broken, Late, Ordered, Received, Started
from agent_runtime.core.turn import Turn
from companion.languages import hfsm, rc, sw, wm
from companion.languages.evidence import Evidence
from fipa_codec.performatives import Performative
from services.task import acts, orders, senses
from services.task import plan as plans
from services.task.memory import Memory, Pending, Soft, way_to_safety
from services.task.words import SURVEY, not_checked

ASK_WITHIN_S = 20.0  # estimate: km answers in ms and comes back in seconds
ATTEMPTS = 2  # to put down what is held: the second one starts elsewhere, with newer observations (estimate)
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
_PLAN_AGAIN = (
    rc.NotDoneKind.REPLAN,
    rc.NotDoneKind.SLIPPED,
    rc.NotDoneKind.BUSY,
    rc.NotDoneKind.INTERRUPTED,
    *LOOK_FIRST,
)
OF_KIND: dict[str, Outcome] = dict.fromkeys(_PLAN_AGAIN, Outcome.REPLAN)
"""Kinds of NotDone after which a new plan may succeed: the world is not as planned, or the machine failed."""


def always(memory: Memory, turn: Turn) -> Memory:
    """Take what may come in every state of a plan: a new observer, the end of the conversation with co."""
    observed(turn)
    match turn.event:
        case Broken(conversation=name, reason=reason) if name == memory.conversation and memory.end is None:
            return preempted(memory, turn, f"the conversation with co broke: {reason}")
    return memory


def observed(turn: Turn) -> None:
    """Tell an observer that comes during a plan that no look around is made for it."""
    match turn.event:
        case Received(content=wm.ObserveWorld()) as received:
            turn.say(received.conversation, Performative.AGREE)
            acts.nothing_seen(turn, "no look around is made while a plan is carried out")


# --- running ----------------------------------------------------------------------------------------------------------


def run_plan(memory: Memory, turn: Turn) -> Memory:
    """State running: run the states of the plan, until it ends, is cancelled, or an act is late."""
    if turn.event is None:
        assert memory.plan is not None
        let, position = bool(memory.let), memory.let or plans.first(memory.plan.root)
        return enter(replace(memory, pending=UNSET), turn, position, let=let)
    memory = always(memory, turn)
    if memory.end is not None:
        return memory
    match turn.event:
        case Received(communicate=word, conversation=name) if name == memory.conversation:
            return preempted(memory, turn, "") if word.performative is Performative.CANCEL else memory
        case Ordered() if orders.replan_wanted(memory, turn):
            return replace(acts.stop(memory, turn), end=sw.WorkerState.REPLAN, reason=orders.WANTED)
        case _:
            return _go_on(memory, turn, _finish)


def preempted(memory: Memory, turn: Turn, reason: str) -> Memory:
    """End a cancelled plan: stop the act, drop the query; what is held is put down afterwards."""
    if memory.soft.question:
        turn.drop(memory.soft.question)
    memory = replace(acts.stop(memory, turn), pending=UNSET)
    tell(memory, turn, sw.WorkerState.TERMINATING)
    return replace(memory, cancelled=True, end=sw.WorkerState.PREEMPTED, reason=reason, soft=Soft())


def _finish(memory: Memory, outcome: Outcome, reason: str) -> Memory:
    """End the plan; where it succeeded, say what nobody has checked."""
    words = not_checked(memory.evidence) if outcome is Outcome.SUCCEEDED else ""
    return replace(memory, end=ENDS[outcome], reason=_joined(reason, words))


# --- securing ---------------------------------------------------------------------------------------------------------


def make_safe(memory: Memory, turn: Turn) -> Memory:
    """State securing: put down what is held as the plan says, with two tries; a second cancel changes nothing."""
    if turn.event is None:
        safe = way_to_safety(memory)
        assert safe is not None
        return enter(replace(memory, safe=safe, secured=1, end=None), turn, plans.first(safe), _secured)
    memory = _go_on(always(memory, turn), turn, _secured)
    if memory.end is not None and memory.hands and memory.secured < ATTEMPTS:
        memory = replace(memory, secured=memory.secured + 1, end=None, reason="")
        return enter(memory, turn, plans.first(memory.machine), _secured)
    return memory


def _secured(memory: Memory, outcome: Outcome, reason: str) -> Memory:
    """End the plan: Preempted if nothing is held, else Failed."""
    why = memory.reason or reason
    if not memory.hands:
        return replace(memory, end=sw.WorkerState.PREEMPTED, reason=why)
    held = ", ".join(memory.hands.values())
    words = f"cancelled, but not everything could be put down (held: {held}): {why}"
    return replace(memory, end=sw.WorkerState.FAILED, reason=words)


# --- both -------------------------------------------------------------------------------------------------------------

Finish = Callable[[Memory, Outcome, str], Memory]


def enter(
    memory: Memory, turn: Turn, position: plans.Position, finish: Finish | None = None, *, let: bool = False
) -> Memory:
    """Enter the leaf at `position`: report it, and start its act or query; or have it wait for the operator.

    `let`: the operator let it begin.
    """
    leaf = plans.leaf(memory.machine, position)
    if not let and orders.asks(memory, turn, leaf):
        return replace(memory, at=memory.at or position, pending=Pending(position))
    memory = replace(memory, at=position)
    tell(memory, turn, sw.WorkerState.RUNNING)
    if isinstance(leaf, hfsm.ActState):
        return acts.begin(memory, turn, _named(memory, leaf.command))
    if isinstance(leaf, hfsm.AskState):
        return _ask(memory, turn, leaf)
    return leave(memory, turn, leaf.outcome, leaf.reason, finish or _finish)


def _named(memory: Memory, command: rc.Act) -> rc.Act:
    """Return the command, with a new key if it is requested again."""
    return replace(command, key=f"{command.key}.{memory.secured}") if memory.secured > 1 else command


def leave(memory: Memory, turn: Turn, outcome: Outcome, reason: str, finish: Finish) -> Memory:
    """Leave the leaf with an outcome: enter the next one, or finish the machine."""
    following = plans.after(memory.machine, memory.at, outcome)
    if isinstance(following, Outcome):
        return finish(memory, following, reason)
    return enter(memory, turn, following, finish)


def _go_on(memory: Memory, turn: Turn, finish: Finish) -> Memory:
    """Take an event that the present leaf waits for."""
    if acts.overdue(memory, turn):
        assert memory.act is not None
        words = f"ex took too long for {memory.act.command.key}"
        end = sw.WorkerState.FAILED if memory.cancelled else sw.WorkerState.REPLAN
        return replace(acts.stop(memory, turn), end=end, reason=words)
    if memory.soft.question or isinstance(turn.event, Started):
        return _answered(memory, turn, finish)
    memory, outcome = acts.hear(memory, turn)
    if outcome is None or memory.act is not None:
        return memory
    return _acted(memory, turn, outcome, finish)


def _acted(memory: Memory, turn: Turn, outcome: acts.Outcome, finish: Finish) -> Memory:
    if memory.looking:
        why = _joined(memory.reason, senses.told(outcome))
        return finish(replace(memory, looking=False), Outcome.REPLAN, why)
    if isinstance(outcome, rc.Done):
        if outcome.missing and outcome.arrived is None and memory.safe is None:
            return _look(memory, turn, outcome.key, f"{' and '.join(outcome.missing)}: not where it was")
        lacking = _lacking(memory, outcome)
        end = Outcome.SUCCEEDED if _poured(memory, outcome) and not lacking else Outcome.FAILED
        why = _joined(_seen(memory, outcome) or not_checked(lacking), senses.told(outcome))
        return leave(memory, turn, end, why, finish)
    turn.log("act not done", level="warning", key=outcome.key, kind=outcome.kind, reason=outcome.reason)
    if memory.safe is not None:
        memory = replace(memory, reason=memory.reason or outcome.reason)
    if outcome.kind in LOOK_FIRST and memory.safe is None:
        return _look(memory, turn, outcome.key, outcome.reason)
    why = _joined(outcome.reason, senses.told(outcome))
    return leave(memory, turn, OF_KIND.get(outcome.kind, Outcome.FAILED), why, finish)


def _joined(*words: str) -> str:
    return "; ".join(filter(None, words))


def _look(memory: Memory, turn: Turn, key: str, reason: str) -> Memory:
    """Look around after an act that left the world unknown, without moving an arm; then plan again. Say why at once."""
    memory = replace(memory, looking=True, reason=reason)
    tell(memory, turn, sw.WorkerState.ERROR, reason[: orders.PATH_CHARS])
    return acts.begin(memory, turn, replace(SURVEY, key=f"{key}.look"))


def _lacking(memory: Memory, outcome: rc.Done) -> tuple[Evidence, ...]:
    """Return the claims without which the act fails and that no sense told; an ex of another version tells of less."""
    leaf = plans.leaf(memory.machine, memory.at)
    needed = rc.needed(type(leaf.command)) if isinstance(leaf, hfsm.ActState) else frozenset()
    return tuple(one for one in outcome.evidence if not one.by and one.claim in needed)


def _poured(memory: Memory, outcome: rc.Done) -> bool:
    """Whether content was seen to arrive, where the act was a pour: content that nobody saw there is not poured."""
    match plans.leaf(memory.machine, memory.at):
        case hfsm.ActState(command=rc.Pour()):
            return outcome.arrived is True
        case _:
            return True


def _seen(memory: Memory, outcome: rc.Done) -> str:
    """Return what was seen or felt in an act, which is told where it ends the plan."""
    leaf = plans.leaf(memory.machine, memory.at)
    match leaf:
        case hfsm.ActState(command=rc.Look()):
            return f"seen: {', '.join(sorted(one.object for one in outcome.seen)) or 'nothing'}"
        case hfsm.ActState(command=rc.Pour() as pour):
            felt = "" if outcome.weighed is None else _felt(pour, *outcome.weighed)
            return _joined(felt, _looked_into(pour, outcome))
        case _:
            return ""


def _felt(pour: rc.Pour, before: float, after: float) -> str:
    """Return how much [kg] was felt to leave a source, and how much to stay in it."""
    words = f"felt: {1000 * (before - after):.0f} g left {pour.source}"
    rest = after - pour.empty_mass
    return f"{words}, {1000 * rest:.0f} g are still in it" if rest > rc.LEAST_WEIGHED_KG else words


def _looked_into(pour: rc.Pour, outcome: rc.Done) -> str:
    """Return how much was seen in the destination then."""
    if pour.destination in outcome.missing:
        return f"{pour.destination} is not where it was"
    if outcome.arrived is None:
        return f"not seen: whether it is in {pour.destination}; look into {pour.destination}"
    seen = next((one.content for one in outcome.seen if one.object == pour.destination), None)
    words = f"seen: {'some' if seen is None else f'about {round(1000 * seen, -1):.0f} g'} in {pour.destination}"
    return words if outcome.arrived else f"{words}: the rest is not there"


# --- questions --------------------------------------------------------------------------------------------------------


def _ask(memory: Memory, turn: Turn, leaf: hfsm.AskState) -> Memory:
    query, plan = Performative.QUERY_REF, memory.conversation
    name = turn.open(acts.OBSERVER, "query", query, leaf.query, reply_by_s=ASK_WITHIN_S, parent=plan)
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
                return leave(memory, turn, Outcome.SUCCEEDED, "", finish)
            return leave(memory, turn, leaf.otherwise, _no(leaf, content), finish)
        case Late(conversation=name) | Broken(conversation=name) if name == memory.soft.question:
            words = f"km does not answer: {leaf.name}"
            return leave(replace(memory, soft=Soft()), turn, Outcome.FAILED, words, finish)
        case _:
            return memory


def _no(leaf: hfsm.AskState, content: object) -> str:
    return content.reason if isinstance(content, wm.Unknown | wm.UnknownState) else f"{leaf.name} no"


def tell(memory: Memory, turn: Turn, state: sw.WorkerState, reason: str = "") -> None:
    """Report the position in the plan to co."""
    if not turn.holds(memory.conversation) or memory.plan is None:
        return
    turn.say(memory.conversation, Performative.INFORM, sw.Report(state, at=orders.path(memory), reason=reason))
