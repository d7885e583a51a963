"""Layer 2, volatile: both roles of a protocol whose conversations are not journalled: questions,
and subscriptions.

A volatile word travels in any order and may be lost. The initiator says its last word again until
anything comes in the conversation; a participant that is asked again gives its last answer again.
What belongs to an older conversation is dropped, so it is not in the net. With `latest` the
participant's plain informs are observations: it owes the newest one until that is receipted, over
deaths and renewed subscriptions.
"""

from collections.abc import Iterator
from functools import cached_property
from typing import NamedTuple

from fipa_codec.exploration import reached
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import RECEIVE, SEND, START, Protocol, Role, Row
from topdown.prove.net import Command, Effect, Guard, Net, Variable, Wrong, is_
from topdown.prove.roles import Pair, Players, fault, spoilt_copies, to

NOTHING = "-"
ASKED, SAID = "asks again", "last said"
DUE, ARRIVING, HELD, RECEIPT = (
    "due",
    "observation on its way",
    "newest held",
    "its receipt on its way",
)
NOT_HELD = "an observation is receipted, and its subscriber does not hold it"

ABSTRACTIONS = (
    (
        "words of an older conversation are dropped at once",
        "both sides tell conversations apart by their ids",
    ),
    (
        "a renewed subscription takes the place of the older one at once",
        "the older one's observations are dropped",
    ),
    (
        "one subject, and only its newest version",
        "subjects are independent, older versions are receipted and ignored",
    ),
    (
        "a message without a row is dropped",
        "so does the runtime with what is not durable: copies are normal there",
    ),
    ("reply-by may pass at any time, and gives a question up", "no statement on durations is made"),
)
"""Dropped traffic, and why it is safe to drop it."""


class Rules(NamedTuple):
    """Duties of the delivery beyond the tables; a test switches each off to show its purpose.

    `asks_again`: the last word of the initiator is repeated. `cancels_till_over`: a cancel until
    the conversation is over, not only until anything comes. `renews`: an initiator whose
    conversation may rest begins it again when the participant comes back from a death. `keeps_due`:
    observations due are journalled.
    """

    asks_again: bool = True
    cancels_till_over: bool = True
    renews: bool = True
    keeps_due: bool = True


class _Volatile:
    """Builds the net."""

    def __init__(self, pair: Pair, latest: bool, rules: Rules) -> None:
        self.pair, self.latest, self.rules = pair, latest, rules
        self.initiator, self.participant = pair.players
        self.first, self.second = pair.tables[Role.INITIATOR], pair.tables[Role.PARTICIPANT]
        self.lives = bool(self.first.resting)

    # --- names ------------------------------------------------------------------------------------

    def on_way(self, role: Role, word: str) -> str:
        """The variable that counts copies of a word."""
        return f"{self.pair.players.named(role)} {word} on its way"

    def spoken(self, role: Role) -> tuple[str, ...]:
        """Words that travel as such: all but observations."""
        observed = Performative.INFORM if self.latest and role is Role.PARTICIPANT else ""
        return tuple(word for word in self.pair.words(role) if word != observed)

    def variables(self) -> Iterator[Variable]:
        """States, words on their way, what is said again, observations."""
        yield from (self.pair.state(role) for role in Role)
        for role in Role:
            for word in self.spoken(role):
                yield Variable(self.on_way(role, word), ("0", "1", "2"))
        yield Variable(ASKED, (NOTHING, *self.spoken(Role.INITIATOR)))
        yield Variable(SAID, (NOTHING, *self.spoken(Role.PARTICIPANT)))
        if self.lives:
            yield Variable("back", ("no", "yes"))
        if self.latest:
            yield from (Variable(name, ("no", "yes")) for name in (DUE, ARRIVING, RECEIPT))
            yield Variable(HELD, ("yes", "no"))

    # --- parts of commands ------------------------------------------------------------------------

    def gone(self, *roles: Role) -> tuple[Effect, ...]:
        """Lose all messages of these roles that are on their way, also observations and
        receipts.
        """
        words = [to(self.on_way(role, word), 0) for role in roles for word in self.spoken(role)]
        if self.latest and Role.PARTICIPANT in roles:
            words.append(to(ARRIVING, "no"))
        if self.latest and Role.INITIATOR in roles:
            words.append(to(RECEIPT, "no"))
        return tuple(words)

    def forgotten(self) -> tuple[Effect, ...]:
        """No conversation any more, for both; a receipt on its way stays, since it belongs to
        none.
        """
        words = (to(self.on_way(role, word), 0) for role in Role for word in self.spoken(role))
        arriving = (to(ARRIVING, "no"),) if self.latest else ()
        ends = to(self.initiator, START), to(self.participant, START)
        return (*words, *arriving, *ends, to(ASKED, NOTHING), to(SAID, NOTHING))

    def said(self, role: Role, word: str, state: str) -> tuple[Effect, ...]:
        """A word goes on its way, and is remembered for the next asking."""
        keeper = ASKED if role is Role.INITIATOR else SAID
        over = state in self.pair.tables[role].ended
        return to(self.on_way(role, word), 1), to(keeper, NOTHING if over else word)

    def _arrives(self, role: Role, word: str) -> Iterator[tuple[Guard, Effect]]:
        """A copy of the peer's word is taken off the wire."""
        name = self.on_way(role.other, word)
        for copies in (1, 2):
            yield is_(name, str(copies)), to(name, copies - 1)

    # --- commands ---------------------------------------------------------------------------------

    def commands(self) -> Iterator[Command]:
        """All of them."""
        for role in Role:
            for row in self.pair.sends(role):
                me, peer = self.pair.players.named(role), self.pair.players.named(role.other)
                said = to(me, row.to), *self.said(role, row.word, row.to)
                if role is Role.INITIATOR and row.state == START:
                    none, said = is_(me, *self.pair.over(role)), (*self.forgotten(), *said)
                    yield Command(me, f"{row.word} -> {peer}", (none,), said, fair=False)
                elif row.word in self.spoken(role):
                    here = (is_(me, row.state),)
                    yield Command(me, f"{row.word} -> {peer}", here, said, fair=not row.free)
            yield from self._taken(role)
            yield from self._words_lost(role)
        yield from self._again()
        yield from self._deaths()
        over = self.pair.over(Role.INITIATOR) | self.first.resting
        waits = is_(self.initiator, *sorted(str(state) for state in self.first.states - over))
        yield fault(self.initiator, "gives up: reply-by has passed", (waits,), self.forgotten())
        if self.latest:
            yield from self._observations()

    def _taken(self, role: Role) -> Iterator[Command]:
        """Take what has a row; answer an opening again that is asked again; drop the rest."""
        me, peer = self.pair.players.named(role), self.pair.players.named(role.other)
        table, travels = self.pair.tables[role], self.spoken(role.other)
        for row in (one for one in self.pair.spoken(role.other) if one.word in travels):
            for state in sorted(table.states - table.urgent):
                what, effects = self._reaction(role, str(state), row)
                for guard, gone in self._arrives(role, row.word):
                    here = is_(me, str(state)), guard
                    yield Command(me, f"{what} <- {peer}", here, (gone, *effects))

    def _reaction(self, role: Role, state: str, word: Row) -> tuple[str, tuple[Effect, ...]]:
        me, table = self.pair.players.named(role), self.pair.tables[role]
        over = state in self.pair.over(role)
        if role is Role.PARTICIPANT and self.pair.opens(word) and not over:
            return f"{word.word}, asked again", ()
        known = START if over and role is Role.PARTICIPANT else state
        row = table.find(known, RECEIVE, word.performative, word.kind)
        if row is None or (over and role is Role.INITIATOR):
            return f"{word.word}, dropped", ()
        return word.word, (to(me, row.to), *self._answered(role, state, row.to))

    def _answered(self, role: Role, state: str, after: str) -> tuple[Effect, ...]:
        """The initiator stops asking when anything comes; when it has cancelled, only when all is
        over.
        """
        cancelling = state in self.cancelling and after not in self.first.ended
        keeps = cancelling and self.rules.cancels_till_over
        return (to(ASKED, NOTHING),) if role is Role.INITIATOR and not keeps else ()

    @cached_property
    def cancelling(self) -> frozenset[str]:
        """States of the initiator after its cancel."""
        sends = (row for row in self.first if row.way is SEND)
        after = (row.to for row in sends if row.performative is Performative.CANCEL)
        found = reached(after, lambda s: (row.to for row in self.first if row.state == s))
        return frozenset(found)

    def _again(self) -> Iterator[Command]:
        """The initiator asks again while nothing came, the participant answers again when asked
        again.
        """
        for word in self.spoken(Role.INITIATOR) if self.rules.asks_again else ():
            guards = is_(ASKED, word), is_(self.on_way(Role.INITIATOR, word), "0")
            effects = (to(self.on_way(Role.INITIATOR, word), 1),)
            yield Command(self.initiator, f"{word} again -> {self.participant}", guards, effects)
        held = sorted(str(state) for state in self.second.states - self.pair.over(Role.PARTICIPANT))
        for opening in sorted({row.word for row in self.first.allowed(START, SEND)}):
            for word in self.spoken(Role.PARTICIPANT):
                for guard, gone in self._arrives(Role.PARTICIPANT, opening):
                    once_more = is_(self.participant, *held), is_(SAID, word), guard
                    again = gone, to(self.on_way(Role.PARTICIPANT, word), 1)
                    what = f"{word} again -> {self.initiator}"
                    yield Command(self.participant, what, once_more, again)

    def _words_lost(self, role: Role) -> Iterator[Command]:
        for word in self.spoken(role):
            words = f"{word} of {self.pair.players.named(role)}"
            yield from spoilt_copies(self.on_way(role, word), words)

    def _deaths(self) -> Iterator[Command]:
        """Either side dies and is restored without its soft state; the other side sees another
        incarnation.
        """
        mine = (*self.forgotten(), *((to(RECEIPT, "no"),) if self.latest else ()))
        yield fault(self.initiator, "dies and is restored", (), mine)
        came_back = (to("back", "yes"),) if self.lives else ()
        due = () if self.rules.keeps_due or not self.latest else (to(DUE, "no"),)
        lost = (*self.gone(*Role), to(self.participant, START), to(SAID, NOTHING), *came_back, *due)
        yield fault(self.participant, "dies and is restored", (), lost)
        if self.lives:
            over = self.pair.over(Role.INITIATOR)
            yield from self._renewed(sorted(str(state) for state in self.first.states - over))
            seen = is_("back", "yes"), is_(self.initiator, *over)
            yield Command(self.initiator, "sees it is back", seen, (to("back", "no"),))

    def _renewed(self, states: list[str]) -> Iterator[Command]:
        """Renew an open conversation of a kind that may rest with the new incarnation."""
        guards = is_("back", "yes"), is_(self.initiator, *states)
        for row in self.first.allowed(START, SEND) if self.rules.renews else ():
            opened = to(self.initiator, row.to), *self.said(Role.INITIATOR, row.word, row.to)
            effects = (*self.forgotten(), to("back", "no"), *opened)
            what = f"sees it is back: {row.word} -> {self.participant}"
            yield Command(self.initiator, what, guards, effects)

    # --- observations -----------------------------------------------------------------------------

    def _observations(self) -> Iterator[Command]:
        """Something is seen, sent while there is a subscription, held, receipted."""
        asker, server = self.initiator, self.participant
        seen = to(DUE, "yes"), to(HELD, "no"), to(ARRIVING, "no"), to(RECEIPT, "no")
        yield Command(server, "sees something new", (), seen, fair=False)
        owed = is_(DUE, "yes"), is_(ARRIVING, "no"), is_(RECEIPT, "no")
        for row in self.second:
            if row.way is SEND and row.word == Performative.INFORM:
                sent = to(ARRIVING, "yes"), to(server, row.to)
                yield Command(server, f"inform -> {asker}", (is_(server, row.state), *owed), sent)
        for state in sorted(self.first.states - self.first.urgent):
            row_in = self.first.find(state, RECEIVE, Performative.INFORM, Kind.PLAIN)
            here = is_(asker, str(state)), is_(ARRIVING, "yes")
            if row_in is None or state in self.pair.over(Role.INITIATOR):
                yield Command(asker, "inform, dropped", here, (to(ARRIVING, "no"),))
            else:
                effects = to(asker, row_in.to), to(ARRIVING, "no"), to(HELD, "yes")
                answered = (*self._answered(Role.INITIATOR, str(state), row_in.to),)
                what = f"inform, receipted <- {server}"
                yield Command(asker, what, here, (*effects, *answered, to(RECEIPT, "yes")))
        settled = to(RECEIPT, "no"), to(DUE, "no")
        yield Command(server, f"receipt <- {asker}", (is_(RECEIPT, "yes"),), settled)
        for name in (ARRIVING, RECEIPT):
            yield fault("wire", f"loses the {name}", (is_(name, "yes"),), (to(name, "no"),))

    def net(self) -> Net:
        """Variables, commands, rest and wrong."""
        quiet = [is_(self.on_way(role, word), "0") for role in Role for word in self.spoken(role)]
        awake = (is_("back", "no"),) if self.lives else ()
        rest = []
        for number, states in enumerate(self.pair.at_rest()):
            settled = (is_(DUE, "no"), is_(RECEIPT, "no")) if self.latest and number else ()
            rest.append((*states, *quiet, *settled, *awake))
        wrong = (Wrong(NOT_HELD, (is_(DUE, "no"), is_(HELD, "no"))),) if self.latest else ()
        variables, commands = tuple(self.variables()), tuple(self.commands())
        players = tuple(self.pair.players)
        return Net(self.pair.name, variables, (), commands, tuple(rest), wrong, players)


def volatile_pair(
    protocol: Protocol,
    players: Players | None = None,
    *,
    faults: int | None = 1,
    latest: bool = False,
    rules: Rules | None = None,
) -> Net:
    """The net of a protocol whose conversations are volatile (`latest`: with observations), and at
    most `faults` faults (None: any number).
    """
    pair = Pair(protocol, players or Players())
    return _Volatile(pair, latest, rules or Rules()).net().counted(faults)
