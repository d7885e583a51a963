"""Several participants: one conversation-id, and one conversation with each (FIPA SC00029H, SC00030H; any protocol).

A `Multicast` is what the initiator knows of all of them together: who has not answered, whose answer came too late,
whose proposals stand. It says nothing itself; whoever speaks (a test, a behaviour's turn) notes here what each
conversation has become. Pure: time is an argument, and the whole encodes into a journal.
"""

from collections.abc import Iterable
from typing import Self

import msgspec

from fipa_codec.conversation import Conversation
from fipa_codec.errors import LocalProtocolError
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import State, named
from fipa_codec.tables import NOT_UNDERSTOOD, SEND, Role

Told = tuple[tuple[str, P], ...]
"""What is to be said, to whom: (participant, performative)."""

_BOUND = frozenset((State.AWARDED, State.CANCELLING_AWARDED, State.DONE, State.FAILED))
"""In a contract net: states only an award leads to."""


class Multicast(msgspec.Struct, frozen=True, omit_defaults=True):
    """The initiator's conversations of one id. `awarded`: whom it accepted.

    `late`: who said nothing by reply-by, whatever was said in its conversation later.
    """

    talks: tuple[Conversation, ...]
    late: tuple[str, ...] = ()
    awarded: tuple[str, ...] = ()

    @classmethod
    def opened(cls, talks: Iterable[Conversation]) -> Self:
        """After the openings were said. LocalProtocolError where these are not one id, protocol and initiator."""
        found = tuple(talks)
        if len({(talk.id, talk.protocol, talk.me) for talk in found}) != 1:
            raise LocalProtocolError("conversation", "one multicast has one id, one protocol and one initiator")
        if len({talk.peer for talk in found}) != len(found):
            raise LocalProtocolError("receiver", "one multicast has one conversation with each participant")
        if any(talk.role is not Role.INITIATOR or talk.state not in _asked_states(talk.protocol) for talk in found):
            raise LocalProtocolError("conversation", "each conversation stands right after its opening")
        return cls(found)

    def noted(self, talk: Conversation, now: float) -> Self:
        """After something was said in `talk`, by either side, at `now` [unix s]; equal to reply-by is in time."""
        before = self.talk(talk.peer)
        others = tuple(peer for peer in self.late if peer != talk.peer)
        if self._unanswered(talk):
            late = others
        elif self._unanswered(before) and before.late(now):
            late = (*others, talk.peer)
        else:
            late = self.late
        bound = self._contract and talk.state in _BOUND and talk.peer not in self.awarded
        return msgspec.structs.replace(
            self,
            talks=tuple(talk if one.peer == talk.peer else one for one in self.talks),
            late=late,
            awarded=(*self.awarded, talk.peer) if bound else self.awarded,
        )

    def broken(self, peer: str) -> Self:
        """After this agent could not take what a participant said, and told it not-understood: that one is out."""
        gone = msgspec.structs.replace(self.talk(peer), state=NOT_UNDERSTOOD, deadline=None)
        return msgspec.structs.replace(self, talks=tuple(gone if one.peer == peer else one for one in self.talks))

    # --- who ----------------------------------------------------------------------------------------------------------

    def talk(self, peer: str) -> Conversation:
        """The conversation with a participant. LocalProtocolError names those there are."""
        for talk in self.talks:
            if talk.peer == peer:
                return talk
        known = ", ".join(talk.peer for talk in self.talks)
        raise LocalProtocolError("receiver", f"{peer!r} takes no part in {self.talks[0].id}, {known} do")

    def awaited(self, now: float) -> tuple[str, ...]:
        """Whose first answer, in this round, may still come in time."""
        return tuple(talk.peer for talk in self.talks if self._unanswered(talk) and not talk.late(now))

    def silent(self, now: float) -> tuple[str, ...]:
        """Who has not answered by reply-by."""
        return tuple(talk.peer for talk in self.talks if self._unanswered(talk) and talk.late(now))

    @property
    def offers(self) -> tuple[str, ...]:
        """Whose proposals stand: made in time, neither accepted nor rejected yet."""
        return tuple(peer for peer in self._offered if peer not in self.late)

    @property
    def over(self) -> bool:
        """Whether every conversation has ended."""
        return all(talk.ended for talk in self.talks)

    def outcome(self, peer: str, now: float) -> str:
        """How it ended with a participant, "" while it is open.

        One that was silent at reply-by counts as refused in a contract net and as failed elsewhere, whatever it says
        later; a subscription or an act agreed too late is the initiator's to cancel. SC00029H rejects late proposals,
        the standard says no more; the counting is ours.
        """
        talk = self.talk(peer)
        if peer in self.late or (self._unanswered(talk) and talk.late(now)):
            return State.REFUSED if self._contract else State.FAILED
        return talk.state if talk.ended else ""

    # --- what to say --------------------------------------------------------------------------------------------------

    @property
    def rejections(self) -> Told:
        """What is due at once: proposals that came too late are rejected."""
        return tuple((peer, P.REJECT_PROPOSAL) for peer in self._offered if peer in self.late)

    def award(self, *chosen: str) -> Told:
        """Accept the chosen offers, one or several, and reject all others; none chosen: reject all.

        LocalProtocolError where a chosen one has no standing offer.
        """
        return self._choose(P.ACCEPT_PROPOSAL, chosen)

    def call_again(self, *chosen: str) -> Told:
        """A new round: a call to the chosen of those that proposed, a rejection to the others.

        LocalProtocolError where the protocol has no rounds, after an award, or where one has no standing offer.
        """
        protocol = self.talks[0].protocol
        if P.CFP not in named(protocol).rounds:
            raise LocalProtocolError("performative", f"{protocol} has one round only; icfp has several")
        if self.awarded:
            awarded = ", ".join(self.awarded)
            raise LocalProtocolError("performative", f"no cfp after an award, and {awarded} has one; open another")
        if not chosen:
            raise LocalProtocolError("receiver", "a new round has at least one participant; award() rejects all")
        return self._choose(P.CFP, chosen)

    def _choose(self, performative: P, chosen: tuple[str, ...]) -> Told:
        offers = self.offers
        for peer in chosen:
            if peer not in offers:
                known = ", ".join(offers) or "nobody"
                raise LocalProtocolError("receiver", f"{peer!r} has no standing offer, {known} has")
        others = (peer for peer in self._offered if peer not in chosen)
        return (*((peer, performative) for peer in chosen), *((peer, P.REJECT_PROPOSAL) for peer in others))

    # ------------------------------------------------------------------------------------------------------------------

    @property
    def _contract(self) -> bool:
        return P.CFP in named(self.talks[0].protocol).openings

    @property
    def _offered(self) -> tuple[str, ...]:
        return tuple(talk.peer for talk in self.talks if self._contract and talk.state == State.OFFERED)

    def _unanswered(self, talk: Conversation) -> bool:
        return talk.state in _asked_states(talk.protocol)


def _asked_states(protocol: str) -> frozenset[str]:
    """The initiator's states right after its opening, or a new round."""
    found = named(protocol)
    rows = found.tables[Role.INITIATOR]
    return frozenset(row.to for row in rows if row.way is SEND and row.performative in found.openings)
