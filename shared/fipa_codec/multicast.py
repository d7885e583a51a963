"""Several participants: one conversation-id, one conversation with each (FIPA SC00029H, SC00030H;
any protocol).

A `Multicast` is the initiator's view of all of them: who has not answered, whose answer was late,
whose proposals are open. It sends nothing: the caller sends and receives, and records each
conversation here. Immutable and without a clock; it can be encoded in a journal.
"""

from collections.abc import Iterable
from typing import Self

import msgspec

from fipa_codec.conversation import Conversation
from fipa_codec.errors import LocalProtocolError
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import State, named
from fipa_codec.tables import NOT_UNDERSTOOD, SEND, Role

Outgoing = tuple[tuple[str, P], ...]
"""Messages to send: (participant, performative)."""

_BOUND = frozenset((State.AWARDED, State.CANCELLING_AWARDED, State.DONE, State.FAILED))
"""States of a contract net that are reached by an award only."""


class Multicast(msgspec.Struct, frozen=True, omit_defaults=True):
    """The initiator's conversations with one id.

    `awarded`: participants whose proposal was accepted. `late`: participants that had not answered
    at reply-by, even if they did later.
    """

    talks: tuple[Conversation, ...]
    late: tuple[str, ...] = ()
    awarded: tuple[str, ...] = ()

    @classmethod
    def opened(cls, talks: Iterable[Conversation]) -> Self:
        """The multicast of conversations whose openings were just sent.

        Raise LocalProtocolError if id, protocol or initiator differ, a participant is there twice,
        or a conversation is in another state.
        """
        found = tuple(talks)
        if len({(talk.id, talk.protocol, talk.me) for talk in found}) != 1:
            raise LocalProtocolError(
                "conversation", "a multicast needs one id, one protocol and one initiator"
            )
        if len({talk.peer for talk in found}) != len(found):
            raise LocalProtocolError(
                "receiver", "a multicast has one conversation with each participant"
            )
        if any(
            talk.role is not Role.INITIATOR or talk.state not in _asked_states(talk.protocol)
            for talk in found
        ):
            raise LocalProtocolError(
                "conversation", "each conversation must be in the state after its opening"
            )
        return cls(found)

    def noted(self, talk: Conversation, now: float) -> Self:
        """The multicast after a message of either side at `now` [unix s].

        `talk` is what `send` or `receive` of that participant's conversation returned. Who had not
        answered by then and is late at `now` stays late (SC00029H: a proposal after reply-by is
        rejected); a new round forgets it. Raise LocalProtocolError if there is no such participant.
        """
        before = self.talk(talk.peer)
        others = tuple(peer for peer in self.late if peer != talk.peer)
        if self._unanswered(talk):
            late = others
        elif self._unanswered(before) and before.late(now):
            late = (*others, talk.peer)
        else:
            late = self.late
        bound = self._contract and talk.state in _BOUND and talk.peer not in self.awarded
        talks = tuple(talk if one.peer == talk.peer else one for one in self.talks)
        awarded = (*self.awarded, talk.peer) if bound else self.awarded
        return msgspec.structs.replace(self, talks=talks, late=late, awarded=awarded)

    def broken(self, peer: str) -> Self:
        """The multicast after this agent answered a message of a participant with not-understood.

        The conversation with that participant has ended, the others go on, as in JADE.
        Raise LocalProtocolError if there is no such participant.
        """
        gone = msgspec.structs.replace(self.talk(peer), state=NOT_UNDERSTOOD, due=())
        talks = tuple(gone if one.peer == peer else one for one in self.talks)
        return msgspec.structs.replace(self, talks=talks)

    # --- participants -----------------------------------------------------------------------------

    def talk(self, peer: str) -> Conversation:
        """The conversation with a participant.

        Raise LocalProtocolError, with the participants, if there is none.
        """
        for talk in self.talks:
            if talk.peer == peer:
                return talk
        known = ", ".join(talk.peer for talk in self.talks)
        raise LocalProtocolError(
            "receiver", f"{peer!r} is not a participant of {self.talks[0].id}, these are: {known}"
        )

    def awaited(self, now: float) -> tuple[str, ...]:
        """Who has not answered in this round and still can in time at `now` [unix s] (reply-by,
        SC00061G).
        """
        return tuple(
            talk.peer for talk in self.talks if self._unanswered(talk) and not talk.late(now)
        )

    def silent(self, now: float) -> tuple[str, ...]:
        """Who has not answered and is late at `now` [unix s]."""
        return tuple(talk.peer for talk in self.talks if self._unanswered(talk) and talk.late(now))

    @property
    def offers(self) -> tuple[str, ...]:
        """Participants with open proposals: made in time, neither accepted nor rejected."""
        return tuple(peer for peer in self._offered if peer not in self.late)

    def over(self, now: float) -> bool:
        """Whether nobody is to be waited for at `now` [unix s].

        Each conversation has ended, or the reply-by of its call or its award passed without an
        answer. Without a reply-by a silent participant is waited for without end. A silent one may
        still answer: its proposal is then among `rejections`.
        """
        return all(
            talk.ended
            or ((self._unanswered(talk) or talk.state == State.AWARDED) and talk.late(now))
            for talk in self.talks
        )

    def outcome(self, peer: str, now: float) -> str:
        """The final state with a participant at `now` [unix s], "" while the conversation is open.

        A participant that had not answered at reply-by counts as refused in a contract net and as
        failed elsewhere, whatever it sends later; the initiator must cancel a subscription or an
        act that was agreed too late. One that did not report by the reply-by of its award counts as
        failed until it does: cancel what it may still do. SC00029H only says that late proposals
        are rejected; the rest is a decision of this project. Raise LocalProtocolError if there is
        no such participant.
        """
        talk = self.talk(peer)
        if peer in self.late or (self._unanswered(talk) and talk.late(now)):
            return State.REFUSED if self._contract else State.FAILED
        if talk.state == State.AWARDED and talk.late(now):
            return State.FAILED
        return talk.state if talk.ended else ""

    # --- messages to send -------------------------------------------------------------------------

    @property
    def rejections(self) -> Outgoing:
        """The rejections of late proposals, to be sent at once."""
        return tuple((peer, P.REJECT_PROPOSAL) for peer in self._offered if peer in self.late)

    def award(self, *chosen: str) -> Outgoing:
        """The messages that accept the chosen proposals, if any, and reject all others (SC00029H).

        Nothing is sent: `send` each in `talk(peer)`, and `noted` the result. Raise
        LocalProtocolError if a chosen participant has no open proposal.
        """
        return self._choose(P.ACCEPT_PROPOSAL, chosen)

    def call_again(self, *chosen: str) -> Outgoing:
        """The messages that call the chosen participants again and reject all other proposals
        (SC00030H).

        Raise LocalProtocolError if the protocol has no rounds, after an award, or if a chosen
        participant has no open proposal.
        """
        protocol = self.talks[0].protocol
        if P.CFP not in named(protocol).rounds:
            raise LocalProtocolError("performative", f"{protocol} has one round only; use icfp")
        if self.awarded:
            awarded = ", ".join(self.awarded)
            raise LocalProtocolError(
                "performative",
                f"there is no new round after an award (to {awarded}); open another conversation",
            )
        if not chosen:
            raise LocalProtocolError(
                "receiver", "a new round needs a participant; to reject all proposals call award()"
            )
        return self._choose(P.CFP, chosen)

    def _choose(self, performative: P, chosen: tuple[str, ...]) -> Outgoing:
        offers = self.offers
        for peer in chosen:
            if peer not in offers:
                known = ", ".join(offers) or "nobody"
                raise LocalProtocolError(
                    "receiver", f"{peer!r} has no open proposal; there are proposals of: {known}"
                )
        others = (peer for peer in self._offered if peer not in chosen)
        rejected = ((peer, P.REJECT_PROPOSAL) for peer in others)
        return (*((peer, performative) for peer in chosen), *rejected)

    # ----------------------------------------------------------------------------------------------

    @property
    def _contract(self) -> bool:
        return P.CFP in named(self.talks[0].protocol).openings

    @property
    def _offered(self) -> tuple[str, ...]:
        return tuple(
            talk.peer for talk in self.talks if self._contract and talk.state == State.OFFERED
        )

    def _unanswered(self, talk: Conversation) -> bool:
        return talk.state in _asked_states(talk.protocol)


def _asked_states(protocol: str) -> frozenset[str]:
    """The initiator's states after its opening or a new round."""
    found = named(protocol)
    rows = found.tables[Role.INITIATOR]
    return frozenset(
        row.to for row in rows if row.way is SEND and row.performative in found.openings
    )
