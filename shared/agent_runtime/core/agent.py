"""An agent as its designer writes it: states, arcs and behaviours (paper, section 3).

An elementary action computes (c', y) := f(c, x); a behaviour repeats it until its terminal or error
condition holds; then the first arc whose initial condition holds picks the next state (no
condition: True). States, arcs and the names of conditions come from the design; an agent binds
Python functions to the names. Everything here is pure: functions of memory and turn.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Generic, Protocol, TypeVar

from agent_runtime.core.control import Parameters
from agent_runtime.core.errors import AgentTableError
from agent_runtime.core.events import Deed, Late, Local, Received
from agent_runtime.core.turn import Turn
from fipa_codec.errors import LocalProtocolError
from fipa_codec.languages import Kind, Reason
from fipa_codec.performatives import Performative
from fipa_codec.tables import SEND

M = TypeVar("M")
Taken = Received | Local | Late


def never(memory: Any) -> bool:
    return False


def always(memory: Any) -> bool:
    return True


def everything(memory: Any, event: Taken) -> bool:
    return True


@dataclass(frozen=True)
class Behaviour(Generic[M]):
    """The transition, the end conditions and the accepted events of one state.

    `transition(memory, turn) -> memory` is called once with `turn.event is None` when the state is
    entered (at a start of the process with Started instead), then once per event. It must not
    change the memory it is given. `takes(memory, event)` is asked of every Received, Local and
    Late; one not taken waits in the inbox, unreceipted, in order. Started, Woken, PeerChanged and
    Ordered are handed over always; ignore those you do not know.
    """

    transition: Callable[[M, Turn], M]
    terminal: Callable[[M], bool] = never
    error: Callable[[M], bool] = never
    takes: Callable[[M, Taken], bool] = everything


@dataclass(frozen=True)
class Arc:
    """An arc to the next state, taken when the behaviour of `source` ended and condition `when`
    holds ("" = always).
    """

    source: str
    target: str
    when: str = ""


class Rows(Protocol):
    """The conversational behaviour of an agent in the design; topdown.model.machines reads it from
    the design file.
    """

    def takes(self, state: str, use: str, act: Performative, kind: Kind) -> bool:
        """Whether a message is taken in this state."""
        ...

    def own(self, state: str) -> tuple[str, ...]:
        """Words of the own side that rows of this state wait for; none in a state of rest."""
        ...

    def ends_wait(self, use: str) -> bool:
        """Whether a row is for the end of the wait in a conversation that this agent opens."""
        ...

    def why_not(self, deed: Deed) -> str:
        """Why a step does not fit the design; "" where it does."""
        ...


@dataclass(frozen=True)
class Agent(Generic[M]):
    """The table of an agent with its bindings; `memory` is the memory of the first start.

    Memory is a frozen msgspec Struct and is journalled whole whenever it changes, except a field
    named `soft`, if there is one: that one is lost by a death and comes back as `type(soft)()`. A
    field that is UNSET stands in no record. `local` is the union of Structs that `Local` events
    carry. `rows`: what the design says of its steps; a message that no row of the state names waits
    in the inbox, and a step that fits no row is logged and counted. None: not said. `parameters`:
    values that an operator may set while it runs; None: there are none.
    """

    name: str
    start: str
    memory: M
    behaviours: Mapping[str, Behaviour[M]]
    arcs: tuple[Arc, ...] = ()
    conditions: Mapping[str, Callable[[M], bool]] = field(default_factory=dict)
    local: Any = None
    rows: Rows | None = None
    parameters: Parameters | None = None

    def __post_init__(self) -> None:
        states = ", ".join(sorted(self.behaviours))
        if self.start not in self.behaviours:
            where = f"start state {self.start!r} has no behaviour"
            raise AgentTableError(self.name, where, f"states are {states}")
        for arc in self.arcs:
            for state in (arc.source, arc.target):
                if state not in self.behaviours:
                    where = f"arc {arc} names {state!r}"
                    raise AgentTableError(self.name, where, f"states are {states}")
            if arc.when and arc.when not in self.conditions:
                known = ", ".join(sorted(self.conditions)) or "none"
                where = f"arc {arc} has an unbound condition"
                raise AgentTableError(self.name, where, f"bound are {known}")

    def next_state(self, state: str, memory: M) -> str | None:
        """The target of the first arc that may be taken; None if there is none."""
        for arc in self.arcs:
            if arc.source == state and (not arc.when or self.conditions[arc.when](memory)):
                return arc.target
        return None


# --- A behaviour that is not written yet ----------------------------------------------------------
# A skeleton made from a design runs with these functions: they refuse, with the reason, and keep
# the state. So every question is answered, and no peer waits for a behaviour that is still to be
# written.


NOES = (Performative.REFUSE, Performative.FAILURE, Performative.REJECT_PROPOSAL)
"""Acts of refusal, mildest first; not-understood remains where a protocol or a design has none of
them.
"""


def decline(turn: Turn, why: str) -> Performative | None:
    """Answer the message of this turn with the mildest refusal that protocol and design allow;
    return its performative.

    None where nothing was taken, or where the message needs no answer.
    """
    event = turn.event
    if not isinstance(event, Received) or not turn.holds(event.conversation):
        return None
    talk = turn.conversation(event.conversation)
    for act in NOES:
        kinds = (Kind.PLAIN, Kind.CANCEL)
        kind = next((k for k in kinds if talk.table.find(talk.state, SEND, act, k)), None)
        # With the reason, or without content where the design has none there.
        for content in (Reason(why), None) if kind is not None else ():
            with suppress(LocalProtocolError):
                turn.say(talk.id, act, content, kind=kind)
                return act
    if not talk.table.allowed(talk.state, SEND):
        return None
    turn.say(talk.id, Performative.NOT_UNDERSTOOD, Reason(why))
    return Performative.NOT_UNDERSTOOD


def unfilled(memory: M, turn: Turn, behaviour: str) -> M:
    """Decline the request of this turn and change nothing; stands in for the named behaviour, whose
    state stays.
    """
    why = f"behaviour {behaviour} of {turn.me} is not filled in"
    act = decline(turn, why)
    if act is not None:
        turn.log("declined", level="warning", performative=str(act), why=why)
    return memory
