"""Rules for reply-with and in-reply-to of a message: one table for agents and for judges. Pure.

A label is what a message has as reply-with. FIPA lets any message carry one (SC00061G), and each may be answered as
long as the conversation goes on. Both sides choose their own labels, so one label can stand for a message of either
side. Of FIPA's protocols every label at every step is explored with both (tests/topdown/test_labels_explored.py).
"""

from enum import StrEnum
from functools import lru_cache

from fipa_codec.performatives import Performative
from fipa_codec.tables import Protocol


class Needs(StrEnum):
    """Requirement on the reply-with of a message."""

    NOTHING = "nothing"
    """It may have one (SC00061G: the parameter is optional)."""
    OWN = "own"
    """It may have one, but none of an earlier round or of a failed cancel, whose copy it would be."""
    SAME = "same"
    """Said again, it has that of the first time: it is the same question."""
    ANY = "any"
    """It needs one: each of these messages is confirmed."""
    NEW = "new"
    """It may have one; a new round is not the copy of an earlier one."""


@lru_cache(maxsize=1024)
def needs(protocol: Protocol, performative: Performative) -> Needs:
    """Return what a message of this protocol needs; looked up once for each act, since it is asked of every message.

    FIPA requires a reply-with of no act (SC00061G): a cfp may have none. So may a cancel, or it has that of the opening
    it cancels: JADE's SubscriptionInitiator sends both kinds.
    """
    if performative is Performative.CANCEL:
        return Needs.OWN
    if performative in protocol.confirmed:
        return Needs.ANY
    if performative in protocol.rounds:
        return Needs.NEW
    return Needs.SAME if performative in protocol.openings else Needs.NOTHING
