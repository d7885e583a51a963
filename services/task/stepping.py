"""State waiting: an act waits for the operator, and what a word about it does.

ta waits between two leaves, with no act under way; the plan can be cancelled meanwhile. Putting down what a cancelled
plan holds waits for nobody.
"""

from msgspec import UNSET
from msgspec.structs import replace

from agent_runtime.core.events import Ordered, Received, Woken
from agent_runtime.core.turn import Turn
from companion.autonomy import WAIT_S, Verb
from companion.languages import hfsm, sw
from companion.languages.facts import Kind, fact
from fipa_codec.performatives import Performative
from services.task import plan as plans
from services.task import running
from services.task.memory import Memory, Pending
from services.task.orders import WANTED, asks, place, verb_about

NOBODY = "nobody came"
"""Wake-up at the end of the wait."""


def await_operator(memory: Memory, turn: Turn) -> Memory:
    """State waiting: tell co what waits; go on at the operator's word, end where nobody gives it or the plan is
    cancelled.
    """
    if turn.event is None:
        turn.wake(NOBODY, turn.now + WAIT_S)
        running.tell(memory, turn, sw.WorkerState.WAITING)
        return memory
    memory = _answered(running.always(memory, turn), turn)
    if not memory.asked:
        turn.unwake(NOBODY)
    return memory


def _answered(memory: Memory, turn: Turn) -> Memory:
    match turn.event:
        case Received(communicate=word, conversation=name) if name == memory.conversation:
            cancelled = word.performative is Performative.CANCEL
            return running.preempted(memory, turn, ()) if cancelled else memory
        case Woken(name=name) if name == NOBODY:
            held = (fact(Kind.HOLDING, *memory.hands.values()),) if memory.hands else ()
            why = (fact(Kind.NOBODY_CAME, WAIT_S / 60.0), *held)
            return replace(memory, end=sw.WorkerState.FAILED, why=why, pending=UNSET)
        case Ordered():
            return _ordered(memory, turn)
    return memory


def _ordered(memory: Memory, turn: Turn) -> Memory:
    """Take a word about the leaf that waits, or a level at which it need not wait."""
    verb = verb_about(turn, place(memory))
    if verb is Verb.REPLAN:
        following = plans.after(memory.machine, memory.asked, hfsm.Outcome.REPLAN)
        if isinstance(following, hfsm.Outcome):
            return replace(memory, end=running.ENDS[following], why=WANTED, pending=UNSET)
        return replace(memory, pending=Pending(following, let=True))
    free = verb is Verb.GO or not asks(memory, turn, plans.leaf(memory.machine, memory.asked))
    return replace(memory, pending=Pending(memory.asked, let=True)) if free else memory
