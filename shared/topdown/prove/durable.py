"""Layer 2, durable: both roles of a protocol over two numbered streams, with every copy and every
receipt explicit.

Numbers are relative: place 1 of a direction is the oldest message its sender has no receipt for. A
receipt for places 1 to n empties them, and the rest moves up; so any number of conversations, one
after the other, is a finite net. The net may do more than the streams, never less, but for what
`ABSTRACTIONS` names.
"""

from collections.abc import Iterator

from fipa_codec.tables import SEND, START, Protocol, Role, Row
from topdown.prove.net import Command, Copy, Effect, Guard, Net, Variable, is_
from topdown.prove.roles import WRONG, Pair, Players, fault, spoilt_copies, to

BOUND = 3
"""Unreceipted messages at which a sender is held back; the explored fleet held 5 at most, a
pair 3.
"""
NONE, TAKEN = "-", "*"
"""A free place; a message that its receiver has taken: what it said matters no more, only its
receipt is missing.
"""

ABSTRACTIONS = (
    (
        "a step is one record, receipts and sends come after it",
        "layer 1 explores the micro-steps of a stream",
    ),
    (
        "a copy that comes before its turn waits for it",
        "dropping it is a loss, which is a fault of its own",
    ),
    (
        "a copy goes when its message is receipted",
        "it could only bring one more receipt, which re-sending brings too",
    ),
    (
        "nothing is sent again while its receipt is on the way",
        "the receiver would drop it and give the same receipt",
    ),
    (
        "a message taken, but not receipted yet, has no word any more",
        "its copies can only bring its receipt again",
    ),
    ("receipts on the way are a set", "they are cumulative: a second copy of one changes nothing"),
    (
        "news that changes no state is sent when all before it is receipted",
        "`eager` explores it without: see there",
    ),
    (
        "one conversation at a time, the next after the end",
        "agents of this method hold one of each use",
    ),
)
"""Dropped traffic, and why it is safe to drop it."""


class _Direction:
    """One stream: names of its variables, and the commands that move copies and receipts."""

    def __init__(self, pair: Pair, sender: Role, bound: int) -> None:
        self.pair, self.sender, self.bound = pair, sender, bound
        self.me, self.peer = pair.players.named(sender), pair.players.named(sender.other)
        self.taken = f"{self.me}>{self.peer} taken"
        self.cells = [f"{self.me}>{self.peer} {place}" for place in range(1, bound + 1)]
        self.copies = [f"{cell} copies" for cell in self.cells]
        self.receipts = [f"{cell} receipt" for cell in self.cells]
        self.words = pair.words(sender)
        self.filled = (TAKEN, *self.words)

    def variables(self) -> Iterator[Variable]:
        """For each place its word, copies on their way, and the receipt up to it; how many are
        taken.
        """
        yield Variable(self.taken, tuple(map(str, range(self.bound + 1))))
        for cell, copies, receipt in zip(self.cells, self.copies, self.receipts, strict=True):
            yield Variable(cell, (NONE, TAKEN, *self.words))
            yield Variable(copies, ("0", "1", "2"))
            yield Variable(receipt, ("no", "yes"))

    def room(self, places: int) -> tuple[Guard, ...]:
        """Whether the sender may add `places` more messages: else it does nothing, as in the
        runtime.
        """
        return (is_(self.cells[-places], NONE),) if places else ()

    def issue(self, word: str) -> Iterator[tuple[tuple[Guard, ...], tuple[Effect, ...]]]:
        """A word goes into the first free place, and one copy on its way."""
        for place, cell in enumerate(self.cells):
            before = (is_(self.cells[place - 1], *self.filled),) if place else ()
            yield (*before, is_(cell, NONE)), (to(cell, word), to(self.copies[place], 1))

    def take(self, word: str) -> Iterator[tuple[tuple[Guard, ...], tuple[Effect, ...]]]:
        """The next word in its turn is taken from a copy, and receipted."""
        for place, cell in enumerate(self.cells):
            for copies in (1, 2):
                there = is_(self.copies[place], str(copies)), is_(cell, word)
                gone = to(cell, TAKEN), to(self.copies[place], copies - 1)
                effects = to(self.taken, place + 1), *gone, to(self.receipts[place], "yes")
                yield (is_(self.taken, str(place)), *there), effects

    def wire(self) -> Iterator[Command]:
        """Copies of what was taken before, receipts that arrive, sending again."""
        for taken in range(1, self.bound + 1):
            for place in range(taken):
                for copies in (1, 2):
                    had = is_(self.taken, str(taken)), is_(self.copies[place], str(copies))
                    gone = to(self.copies[place], copies - 1)
                    what = f"had {place + 1} before, receipts again <- {self.me}"
                    yield Command(self.peer, what, had, (gone, to(self.receipts[taken - 1], "yes")))
            for receipted in range(1, taken + 1):
                guards = is_(self.taken, str(taken)), is_(self.receipts[receipted - 1], "yes")
                words = f"receipt for {receipted} <- {self.peer}"
                yield Command(self.me, words, guards, self._moved_up(receipted, taken))
        for place, cell in enumerate(self.cells):
            unreceipted = tuple(is_(receipt, "no") for receipt in self.receipts[place:])
            again = is_(self.copies[place], "0"), is_(cell, *self.filled), *unreceipted
            what = f"sends unreceipted {place + 1} again -> {self.peer}"
            yield Command(self.me, what, again, (to(self.copies[place], 1),))

    def _moved_up(self, receipted: int, taken: int) -> tuple[Effect, ...]:
        effects: list[Effect] = [to(self.taken, taken - receipted)]
        for cells, empty in ((self.cells, NONE), (self.copies, "0"), (self.receipts, "no")):
            for place, cell in enumerate(cells):
                later = place + receipted
                effects.append(Copy(cell, cells[later]) if later < self.bound else to(cell, empty))
        return tuple(effects)

    def faults(self) -> Iterator[Command]:
        """Loss and duplication of a copy, loss of a receipt."""
        for place, copies in enumerate(self.copies):
            words, receipt = f"{place + 1} of {self.me}", self.receipts[place]
            yield from spoilt_copies(copies, words)
            lost = (is_(receipt, "yes"),), (to(receipt, "no"),)
            yield fault("wire", f"loses the receipt for {words}", *lost)

    def nothing_arrives(self) -> tuple[Effect, ...]:
        """All copies are gone."""
        return tuple(to(copies, 0) for copies in self.copies)

    def no_receipt_arrives(self) -> tuple[Effect, ...]:
        """Lose all receipts that are on their way."""
        return tuple(to(receipt, "no") for receipt in self.receipts)


class _Streams:
    """The streams of both directions between two agents, as one net."""

    def __init__(self, pair: Pair, bound: int, eager: bool) -> None:
        self.pair, self.eager = pair, eager
        self.out = {role: _Direction(pair, role, bound) for role in Role}
        self.texts: list[str] = []

    def commands(self) -> Iterator[Command]:
        """Of both roles, both streams, and the faults."""
        for role in Role:
            for row in self.pair.sends(role):
                yield from self._send(role, row)
            for row, states in self.pair.takes(role):
                yield from self._take(role, row, states)
            yield from self._wrong(role)
            yield from self.out[role].wire()
            yield from self.out[role].faults()
            yield from self._deaths(role)

    def _send(self, role: Role, row: Row) -> Iterator[Command]:
        me, stream, opens = self.pair.players.named(role), self.out[role], row.state == START
        here = is_(me, *self.pair.sources(role, row) if opens else (str(row.state),))
        news = row.to == row.state and not self.eager
        answers = str(row.state) in self.pair.tables[role].urgent
        room = () if answers else stream.room(1 + self._owed(role, row.to))
        what, fair = f"{row.word} -> {stream.peer}", not (row.free or opens)
        for place, (guards, effects) in enumerate(stream.issue(row.word)):
            if not (news and place):
                yield Command(me, what, (here, *room, *guards), (to(me, row.to), *effects), fair)

    def _owed(self, role: Role, state: str, most: int = 2) -> int:
        """The number of words that a role owes at once in a state, counting at most `most` of a
        chain.
        """
        table = self.pair.tables[role]
        if state not in table.urgent or not most:
            return 0
        rows = table.allowed(state, SEND)
        return 1 + max((self._owed(role, row.to, most - 1) for row in rows), default=0)

    def _take(self, role: Role, row: Row, states: frozenset[str]) -> Iterator[Command]:
        me, stream = self.pair.players.named(role), self.out[role.other]
        for guards, effects in stream.take(row.word):
            room = self.out[role].room(max(1, self._owed(role, row.to)))
            everything = (is_(me, *states), *guards, *room)
            yield Command(me, f"{row.word} <- {stream.me}", everything, (to(me, row.to), *effects))

    def _wrong(self, role: Role) -> Iterator[Command]:
        """Yield receptions without a row, and answers that are owed while the queue has no room."""
        me, stream = self.pair.players.named(role), self.out[role.other]
        for state, word, forgotten in self.pair.untaken(role):
            text = self._text(self.pair.wrong_words(role, state, word, forgotten))
            for guards, _ in stream.take(word):
                heard = (is_(me, state), *guards)
                yield Command(me, f"{word} <- {stream.me}", heard, (to(WRONG, text),))
        table = self.pair.tables[role]
        if table.urgent:
            text = self._text(f"{me} has to answer at once, and its outbox is full")
            last = self.out[role]
            guards = is_(me, *map(str, table.urgent)), is_(last.cells[-1], *last.filled)
            yield Command(me, "passes the bound of its outbox", guards, (to(WRONG, text),))

    def _text(self, text: str) -> str:
        self.texts.append(text)
        return text

    def _deaths(self, role: Role) -> Iterator[Command]:
        """Drop the traffic to a dead side; with it, or not, what that side had recorded and not yet
        sent.
        """
        me, mine, others = self.pair.players.named(role), self.out[role], self.out[role.other]
        waited = (*others.nothing_arrives(), *mine.no_receipt_arrives())
        unsent = (*mine.nothing_arrives(), *others.no_receipt_arrives())
        yield fault(me, "dies and is restored, its output was sent", (), waited)
        yield fault(me, "dies and is restored, its output was not sent", (), (*waited, *unsent))

    def net(self) -> Net:
        """Variables, commands, rest and wrong."""
        commands = tuple(self.commands())
        streams = tuple(variable for role in Role for variable in self.out[role].variables())
        empty = tuple(is_(self.out[role].cells[0], NONE) for role in Role)
        return self.pair.net(commands, self.texts, empty, streams)


def durable_pair(
    protocol: Protocol,
    players: Players | None = None,
    *,
    faults: int | None = 1,
    bound: int = BOUND,
    eager: bool = False,
) -> Net:
    """The net of a protocol over two durable streams, with at most `faults` faults (None: any
    number).

    `eager`: news (rows that stay in their state) may fill the outbox. Then two agents that take
    nothing while their outboxes are full can block each other: a sender of news must leave room for
    the answers it owes.
    """
    return _Streams(Pair(protocol, players or Players()), bound, eager).net().counted(faults)
