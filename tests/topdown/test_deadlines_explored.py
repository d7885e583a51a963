"""Deadlines at every step: both sides of a conversation and a judge who hears it find the same
messages late.

Breadth first, through everything that two sides of ours may say, with a reply-by or without one,
and every order in which it is taken. Each reply-by is another time, and each message is tried after
each of them: who has the same messages late at all these times has the same deadline.
"""

import copy
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import pytest
from msgspec.structs import replace

from companion.design import COORDINATE
from fipa_codec.communicate import Communicate
from fipa_codec.conversation import Conversation
from fipa_codec.errors import FipaError
from fipa_codec.exploration import CAPACITY
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import PROTOCOLS
from fipa_codec.tables import SEND, START, Protocol, Role
from topdown.judge.conversations import Entry, Talk
from topdown.judge.follow import Followed
from topdown.judge.verdicts import Heard, Verdict

AGENTS = {Role.INITIATOR: "ina", Role.PARTICIPANT: "pit"}
WORDS = 4
"""Messages of a conversation: call, proposal, award, cancel, its failure and the result."""
Late = tuple[bool, ...]
"""Whether a message is late when it is sent after each reply-by so far."""


class Transit(NamedTuple):
    """A message on its way, and when its sender found it late."""

    message: Communicate
    kind: Kind
    late: Late


class Place(NamedTuple):
    """Both sides, what is on its way to each, and two judges: one heard what was said, one what was
    taken. `open`: the reply-with of each message that nobody answered by it, and its reply-by.
    """

    sides: dict[Role, Conversation]
    wires: dict[Role, tuple[Transit, ...]]
    said: Talk
    taken: Talk
    number: int = 0
    open: tuple[tuple[str, float | None], ...] = ()

    @property
    def key(self) -> str:
        """Equal keys have equal futures; labels and times are numbered as they come."""
        judges = (
            (one.due, one.withdrawn, [(side._at, side._ahead) for side in followed.sides.values()])
            for one in (self.said, self.taken)
            if (followed := one.followed) is not None
        )
        here = list(self.sides.values()), list(self.wires.values()), self.open, list(judges)
        text = repr(here)
        names: dict[str, str] = {}
        return re.sub(r"\bR?\d+\b", lambda n: names.setdefault(n[0], f"#{len(names)}"), text)

    def onward(self) -> Iterator["Place"]:
        """Yield the places after each step of either side."""
        for role in Role:
            if self.wires[role] and not self.sides[role].owes:
                yield self.takes(role)
            if len(self.wires[role.other]) < CAPACITY and self.number < WORDS:
                yield from self.says(role)

    def says(self, role: Role) -> Iterator["Place"]:
        """Yield the places after each word of a side; its sender and a judge agree on when it is
        late.
        """
        side, number = self.sides[role], self.number + 1
        rows = side.table.allowed(side.state, SEND)
        words: list[tuple[P, Kind, str | None]] = [(r.performative, r.kind, None) for r in rows]
        if side.state != START:
            labels = {None, "", side.cancel if role is Role.PARTICIPANT else ""}
            words += [(P.NOT_UNDERSTOOD, Kind.PLAIN, label) for label in labels]
        for act, kind, answers in words:
            for reply_by in (None, float(number)):
                try:
                    after, message = side.send(
                        act, id=f"R{number}", now=0.0, kind=kind, in_reply_to=answers,
                        reply_by=reply_by,
                    )  # fmt: skip
                except FipaError:
                    continue
                late = self.late(side, message, kind)
                wires = (*self.wires[role.other], Transit(message, kind, late))
                yield self._replace(
                    sides=self.sides | {role: after},
                    wires=self.wires | {role.other: wires},
                    said=judged(self.said, message, kind, late),
                    number=number,
                    open=self.answered(side, message, late),
                )

    def answered(
        self, side: Conversation, message: Communicate, late: Late
    ) -> tuple[tuple[str, float | None], ...]:
        """What is open after this message of a side; if it is the first answer to a reply-with, it
        is late after that message's reply-by.
        """
        left, answers = dict(self.open), message.in_reply_to
        own = side.protocol == COORDINATE.name  # its reports have no label, and answer a cancel
        if own and message.performative is P.INFORM:
            left.pop(side.asked, None)
        if answers in left:
            until = left.pop(answers)
            moments_late = (until is not None and at > until for at in moments(self.number))
            assert late == tuple(moments_late), (side, message)
        cancels = own and message.performative is P.CANCEL
        if message.reply_with == message.id and not cancels:  # else it is asked again
            left[message.id] = message.reply_by
        return tuple(left.items())

    def takes(self, role: Role) -> "Place":
        """The place after a side took what is next; it agrees with its sender and with a judge on
        when that was late.
        """
        (message, kind, late), *left = self.wires[role]
        side = self.sides[role]
        found = self.late(side, message, kind)[: len(late)]
        assert found == late, (side, message)
        judge = judged(self.taken, message, kind, late)
        sides = self.sides | {role: side.receive(message, kind)}
        return self._replace(sides=sides, wires=self.wires | {role: tuple(left)}, taken=judge)

    def late(self, side: Conversation, message: Communicate, kind: Kind) -> Late:
        """When a side finds a message late."""
        return tuple(side.late(at, message, kind) for at in moments(self.number))


def moments(count: int) -> list[float]:
    """A time after each reply-by of so many messages."""
    return [number + 0.5 for number in range(1, count + 1)]


def judged(before: Talk, message: Communicate, kind: Kind, late: Late) -> Talk:
    """The judge after this message, which it finds late as the sides do, by the question's own
    reply-by.
    """
    talk = copied(before)
    rule: Any = None
    entry = Entry(Heard(1, 0.0, "", 0, message), message, rule, (kind,))
    word = talk.take(entry)
    assert not isinstance(word, str), word
    for at, is_late in zip(moments(len(late)), late, strict=True):
        verdict, _ = copy.copy(talk).timed(
            entry._replace(communicate=replace(message, sent=at)), word
        )
        assert (verdict is Verdict.LATE) == is_late, (message, at, talk.due)
    talk.timed(entry, word)
    return talk


def copied(talk: Talk) -> Talk:
    """A judge's conversation to go on with."""
    after = copy.copy(talk)
    assert talk.followed is not None
    after.followed = followed = copy.copy(talk.followed)
    followed.sides = {role: copy.copy(side) for role, side in followed.sides.items()}
    for side in followed.sides.values():
        side._ahead, side._at = list(side._ahead), list(side._at)
        side._labels = dict(side._labels)
    followed._labels = copy.deepcopy(followed._labels)
    followed._answered = copy.deepcopy(followed._answered)
    return after


def opened(protocol: Protocol) -> Place:
    """Nothing was said yet."""
    sides = {
        role: Conversation.open(protocol, role, id="C", me=AGENTS[role], peer=AGENTS[role.other])
        for role in Role
    }
    talk = Talk(("C", protocol.name, "ina", "pit"), 0.0)
    talk.initiator, talk.followed = AGENTS[Role.INITIATOR], Followed(protocol, durable=True)
    return Place(sides, dict.fromkeys(Role, ()), talk, copied(talk))


@pytest.mark.timeout(300)
@pytest.mark.parametrize("protocol", [*PROTOCOLS, COORDINATE], ids=lambda one: one.name)
def test_both_sides_and_a_judge_find_the_same_late(protocol: Protocol) -> None:
    """In every order of saying and taking."""
    places = [opened(protocol)]
    seen: set[str] = set()
    while places:
        found = {after.key: after for place in places for after in place.onward()}
        places = [place for key, place in found.items() if key not in seen]
        seen |= found.keys()
    assert len(seen) > WORDS
