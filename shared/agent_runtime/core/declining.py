"""The behaviour of an agent whose behaviours are not written yet: it refuses, with the reason, and keeps its state.

A skeleton made from a design runs with these functions: every question is answered, and no peer waits for a behaviour
that is still to be written.
"""

from typing import TypeVar

from agent_runtime.core.events import Received
from agent_runtime.core.turn import Turn
from fipa_codec.errors import LocalProtocolError
from fipa_codec.languages import Kind, Reason
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import SEND

M = TypeVar("M")
NOES = (P.REFUSE, P.FAILURE, P.REJECT_PROPOSAL)
"""Acts of refusal, mildest first; not-understood remains where a protocol or a design has none of them."""


def decline(turn: Turn, why: str) -> P | None:
    """Answer the message of this turn with the mildest refusal that protocol and design allow; return its performative.

    None where nothing was taken, or where the message needs no answer.
    """
    event = turn.event
    if not isinstance(event, Received) or not turn.holds(event.conversation):
        return None
    talk = turn.conversation(event.conversation)
    for act in NOES:
        kind = next((k for k in (Kind.PLAIN, Kind.CANCEL) if talk.table.find(talk.state, SEND, act, k)), None)
        if kind is not None and _said(turn, talk.id, act, why, kind):
            return act
    if not talk.table.allowed(talk.state, SEND):
        return None
    turn.say(talk.id, P.NOT_UNDERSTOOD, Reason(why))
    return P.NOT_UNDERSTOOD


def _said(turn: Turn, conversation: str, act: P, why: str, kind: Kind) -> bool:
    """Say `act` with the reason, or without content where the design has none there. Return whether it was said."""
    for content in (Reason(why), None):
        try:
            turn.say(conversation, act, content, kind=kind)
        except LocalProtocolError:
            continue
        return True
    return False


def unfilled(memory: M, turn: Turn, behaviour: str) -> M:
    """Decline the request of this turn and change nothing; stands in for the named behaviour, whose state stays."""
    why = f"behaviour {behaviour} of {turn.me} is not filled in"
    act = decline(turn, why)
    if act is not None:
        turn.log("declined", level="warning", performative=str(act), why=why)
    return memory
