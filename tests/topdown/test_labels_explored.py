"""Every label at every step: our side of a conversation and a judge who hears it say the same of
each message.

One side is ours, the other is anybody: it says whatever our table takes, under a new label, one
said before or none, in reply to anything or nothing. Breadth first, from the opening on.
"""

from collections.abc import Iterator
from typing import NamedTuple

import pytest

from fipa_codec.communicate import Communicate
from fipa_codec.conversation import Conversation
from fipa_codec.errors import FipaError
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import FIPA, PAPER, PROTOCOLS
from fipa_codec.tables import RECEIVE, SEND, START, Protocol, Role, Way
from topdown.judge.follow import Followed, TableMessage

DEPTH = 5
"""Messages of a conversation: opening, cancel, its failure, another cancel, and an answer to
either.
"""
UNKNOWN = "R9"
PAPERS = frozenset(PAPER) - frozenset(FIPA)
"""A repeated question is answered again, which our side takes, whether it was repeated or not."""


class Place(NamedTuple):
    """Our side, a judge, and what was said."""

    ours: Conversation
    judge: Followed
    said: tuple[tuple[Role, TableMessage], ...] = ()

    @property
    def labels(self) -> tuple[str, ...]:
        """All reply-with so far, each once."""
        return tuple(dict.fromkeys(said.label for _, said in self.said if said.label))

    @property
    def key(self) -> tuple[object, ...]:
        """Equal keys have equal futures."""
        return self.ours, self.judge.states, self.labels

    def acts(self, way: Way) -> set[P]:
        """The acts that the table allows here, and not-understood."""
        return {row.performative for row in self.ours.table.allowed(self.ours.state, way)} | {
            P.NOT_UNDERSTOOD
        }

    def judged(self, role: Role, one: Communicate, ours: Conversation) -> "Place | None":
        """The place after this message, None where the judge finds it out of sequence."""
        if self.judge.mislabelled(role, one.performative, one.reply_with):
            return None
        read = self.judge.read(
            role, one.performative, one.reply_with, one.in_reply_to, (Kind.PLAIN,)
        )
        if isinstance(read, str):
            return None
        judge = Followed(self.judge.protocol, durable=True)
        said = (*self.said, (role, read))
        return Place(ours, judge, said) if all(judge.take(*one) for one in said) else None

    def heard(self, number: int) -> Iterator["Place"]:
        """Yield the places after each word of the other side: both take it, or neither."""
        first = self.ours.state == START
        # forgotten by us, known to the judge
        for act in self.acts(RECEIVE) - ({P.CANCEL} if first else set()):
            for answers in ("", *self.labels, UNKNOWN):
                for label in dict.fromkeys(("", f"R{number}", *self.labels[-2:])):
                    message = Communicate(
                        performative=act,
                        protocol=self.ours.protocol,
                        reply_with=label,
                        in_reply_to=answers,
                        conversation=self.ours.id,
                        sender=self.ours.peer,
                        receiver=self.ours.me,
                    )
                    try:
                        ours = self.ours.receive(message)
                    except FipaError:
                        ours = None
                    place = self.judged(self.ours.role.other, message, ours or self.ours)
                    assert ours or not place, message
                    assert place or not ours or self.judge.protocol in PAPERS, message
                    # who said it says no more: we need not know
                    if place and act is not P.NOT_UNDERSTOOD:
                        yield place

    def says(self, number: int) -> Iterator["Place"]:
        """Yield the places after each word of our side, all of them in sequence."""
        acts = set() if self.ours.ended and not self.ours.owes else self.acts(SEND)
        words = (
            (act, kind, answers)
            for act in acts
            for kind in (Kind.PLAIN, Kind.CANCEL)
            for answers in self.choices
        )
        for act, kind, answers in words:
            try:
                ours, message = self.ours.send(
                    act, id=f"R{number}", now=1.0, kind=kind, in_reply_to=answers
                )
            except FipaError:
                continue
            place = self.judged(self.ours.role, message, ours)
            assert place is not None, message
            yield place

    @property
    def choices(self) -> tuple[str | None, ...]:
        """The labels that it may be made to answer; None: the one it answers of itself."""
        return (None, "", *self.labels, UNKNOWN)


@pytest.mark.parametrize("role", Role)
@pytest.mark.parametrize("protocol", PROTOCOLS, ids=lambda one: one.name)
def test_a_conversation_and_a_judge_read_labels_alike(protocol: Protocol, role: Role) -> None:
    """A word is taken by both or by neither; a judge finds words of our side, its own or
    prescribed, in sequence.
    """
    ours = Conversation.open(protocol, role, id="C1", me="me", peer="you")
    places = [Place(ours, Followed(protocol, durable=True))]
    for number in range(DEPTH):
        found = [after for place in places for after in (*place.heard(number), *place.says(number))]
        places = list({place.key: place for place in found}.values())
    assert places
