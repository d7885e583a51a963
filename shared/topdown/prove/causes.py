"""Where a composed system is stuck: who waits for whom, in which state, with what in the inbox, and
the row that is missing or does not apply there.

Method: the trace of a finding is played again. From its last state fair moves are followed to where
none leads on to anything new. Of each agent that is not at rest is asked what would move it on: a
word that it took, a word of its own, a word of a peer. Who waits for a peer that is itself stuck
follows from that one, and is told in one line. Must not know: how states were explored.
"""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from fipa_codec.performatives import Performative
from fipa_codec.tables import RECEIVE, SEND, START, Role
from topdown.model.loading import line_of
from topdown.model.machines import NONE, Cause, Machine, ProtocolAct, Row
from topdown.prove.engine import WRONG, Finding
from topdown.prove.fleet import Flat, Fleet
from topdown.prove.local import DIES, GONE, Agent
from topdown.prove.parts import OWN, RESTART

MOST_STATES = 1_000
"""States that are looked at behind a trace (estimate: what is stuck has few)."""
MOST_ROWS = 3
"""Rows that are named for one cause (estimate: more, and nobody reads them)."""


class Stuck(NamedTuple):
    """An agent that is not at rest. `peer`: whom it waits for, "" where the cause is its own."""

    agent: str
    state: str
    peer: str
    words: str


class Taken(NamedTuple):
    """A move of the trace, with the states of the whole around it."""

    who: str
    what: str
    here: Flat
    there: Flat


def causes(fleet: Fleet, finding: Finding) -> tuple[str, ...]:
    """What is missing where the trace of a finding has led, the cause first; none where it cannot
    be told.
    """
    trail = _played(fleet, finding)
    if trail is None:
        return ()
    if finding.kind == WRONG:
        return tuple(_unforeseen(fleet, trail))
    trail = [*trail, *_onward(fleet, trail[-1].there if trail else fleet.start)]
    end = trail[-1].there if trail else fleet.start
    awake, still = list(_awake(fleet, end)), _still(fleet, end)
    stuck = [
        one
        for number in [number for number in awake if number in still] or awake
        for one in _Look(fleet, end, number, trail).stuck()
    ]
    roots = [one for one in stuck if not one.peer]
    if not roots:  # a circle, or peers that are at rest
        waiting = {one.agent for one in stuck}
        roots = [one for one in stuck if one.peer not in waiting] or stuck
    names = {one.agent for one in roots}
    told = [f"{one.agent} in {one.state}: {one.words}" for one in roots]
    rest = [
        f"{one.agent} in {one.state} waits for {one.peer}"
        for one in stuck
        if one.agent not in names
    ]
    follows = [f"what follows: {'; '.join(dict.fromkeys(rest))}"] if rest else []
    return tuple(dict.fromkeys((*told, *follows)))


def _unforeseen(fleet: Fleet, trail: list[Taken]) -> Iterator[str]:
    """Of a word that no row covers: each row that takes it, and why it does not apply."""
    here = trail[-1].there if trail else fleet.start
    if isinstance(here[0], str):  # not a state: what was done to come there is wrong
        yield from _done(fleet, trail)
        return
    for slot, number in fleet.inbound:
        said = fleet.parts.queues.values[here[slot]][0] if here[slot] else None
        if said and isinstance(fleet.parts.outcomes(number, here[number], said), str):
            look = _Look(fleet, here, number, trail)
            yield f"{look.name} in {look.local.state}: {look.taking(said)}"


def _done(fleet: Fleet, trail: list[Taken]) -> Iterator[str]:
    """The row of the last step, and what it says."""
    last = trail[-1]
    if last.who in fleet.parts.place:
        look = _Look(fleet, last.here, fleet.parts.place[last.who], trail)
        number = look.row_of(last.here[look.number], last.what)
        row = next((one for one in look.machine.rows if one.number == number), None)
        by = f"{look.place(row)}: " if row else ""
        yield f"{look.name} in {look.local.state}: {by}{last.what}"


def _played(fleet: Fleet, finding: Finding) -> list[Taken] | None:
    """The trace once more; None where the moves are not those of the trace."""
    trails: dict[Flat, list[Taken]] = {fleet.start: []}
    for step in finding.trace:
        trails = {
            there: [*trail, Taken(step.who, step.what, here, there)]
            for here, trail in trails.items()
            for who, what, there, *_ in fleet.moves(here)
            if (who, what) == (step.who, step.what) and fleet.describe(there) == step.after
        }
    return next(iter(trails.values()), None)


def _onward(fleet: Fleet, start: Flat) -> list[Taken]:
    """The way over fair moves to a state that all its fair successors lead back to."""
    onward: dict[Flat, list[Flat]] = {}
    came: dict[Flat, Taken] = {}
    waiting = [start]
    for here in waiting:
        moves = () if len(onward) >= MOST_STATES or fleet.wrong(here) else fleet.moves(here)
        onward[here] = []
        for who, what, there, fair, fault in moves:
            if fair and not fault and not isinstance(there[0], str):
                onward[here].append(there)
                if there != start and there not in came:
                    came[there] = Taken(who, what, here, there)
                    waiting.append(there)
    looked_at = set(waiting[:MOST_STATES])
    onward = {one: [two for two in onward[one] if two in looked_at] for one in looked_at}
    here, seen = start, {start}
    while True:
        lost = (one for one in reversed(_reach(here, onward)) if one not in seen)
        further = next((one for one in lost if here not in _reach(one, onward)), None)
        if further is None:
            break
        here = further
        seen.add(here)
    way: list[Taken] = []
    while here != start:
        way.append(came[here])
        here = came[here].here
    return way[::-1]


def _still(fleet: Fleet, end: Flat) -> set[int]:
    """The agents that stay as they are whatever fair moves come; others go round for ever."""
    seen = dict.fromkeys([end])
    for here in (waiting := [end]):
        for _, _, there, fair, fault in fleet.moves(here) if len(seen) < MOST_STATES else ():
            if fair and not fault and not isinstance(there[0], str) and there not in seen:
                seen[there] = None
                waiting.append(there)
    return {number for number in range(fleet.count) if len({state[number] for state in seen}) == 1}


def _reach(start: Flat, onward: dict[Flat, list[Flat]]) -> list[Flat]:
    found = dict.fromkeys([start])
    waiting = [start]
    for here in waiting:
        for there in onward.get(here, ()):
            if there not in found:
                found[there] = None
                waiting.append(there)
    return list(found)


def _awake(fleet: Fleet, state: Flat) -> Iterator[int]:
    """The agents that are not at rest, or have something in their inbox."""
    full = {number for slot, number in fleet.inbound if state[slot]}
    for number, name in enumerate(fleet.names):
        rests = fleet.parts.resting(number, state[number]) and number not in full
        gone = fleet.parts.local(number, state[number]).state == GONE
        if name not in fleet.groups and not rests and not gone:
            yield number


class _Look:
    """One agent in a state of the whole."""

    def __init__(self, fleet: Fleet, state: Flat, number: int, trail: list[Taken]) -> None:
        self.fleet, self.whole, self.number, self.trail = fleet, state, number, trail
        self.agent: Agent = fleet.parts.agents[number]
        self.machine: Machine = self.agent.machine
        self.name, self.local = fleet.names[number], fleet.parts.local(number, state[number])
        self.words = {
            sender: fleet.parts.queues.values[state[slot]]
            for (sender, to), slot in fleet.parts.queue_of.items()
            if to == self.name and state[slot]
        }

    def stuck(self) -> Iterator[Stuck]:
        """What it waits for; what only it can do comes alone."""
        blocked = [self._blocked(peer, words[0]) for peer, words in self.words.items()]
        onward = blocked or list(self._owed()) or list(self._awaited())
        for peer, words in onward or [("", self._no_way())]:
            yield Stuck(self.name, self.local.state, peer, words)

    def _no_way(self) -> str:
        """No state of rest, and no row that leads on."""
        here = [row for row in self.machine.rows if self.local.state in row.states]
        wrong = "it is no state of rest, and no row leads on"
        return f"{wrong}: {self._rows(here, 'add a row that leads to one')}"

    def _blocked(self, peer: str, said: ProtocolAct) -> tuple[str, str]:
        """A word at the head of its inbox that no row takes here."""
        wrong = f"`{said}` of {peer} is at the head of its inbox, and no row takes it there"
        return "", f"{wrong}; {self.taking(said)}"

    def taking(self, said: ProtocolAct) -> str:
        """The rows that take a word, and why none of them applies here."""
        takes = [row for row in self.machine.rows if str(row.event) == str(said)]
        return self._rows(takes, f"add a row on `{said}`")

    def _owed(self) -> Iterator[tuple[str, str]]:
        """Conversations in which only it can go on, and nobody else would move it; an agent that
        waits in another one goes on after that.
        """
        if any(True for _ in self._awaited()):
            return
        for use, talk, mine, _ in self._open():
            words = " or ".join(f"`{one}`" for one in mine)
            says = [row for row in self.machine.rows if not {*row.say}.isdisjoint(mine)]
            wrong = f"{use} is {talk}, where only {self.name} can go on, by {words}"
            rows = self._rows(says, f"add a row that says {words}")
            yield "", wrong + (self._forgotten() or f"{self._since(use)}; {rows}")
        for use in sorted(self.local.owed):
            wrong = f"it owes {self.machine.uses[use].peer} what it observed ({use})"
            yield "", f"{wrong}, and that never comes"

    def _awaited(self) -> Iterator[tuple[str, str]]:
        """Conversations in which a peer must go on."""
        for use, talk, mine, theirs in self._open():
            if mine or not theirs:
                continue
            peer = self.machine.uses[use].peer
            words = " or ".join(f"`{one}`" for one in theirs)
            if peer in self.fleet.groups:
                yield peer, f"it waits for {peer}, which may never say {words} ({use} is {talk})"
                continue
            number = self.fleet.parts.place[peer]
            there = self.fleet.parts.local(number, self.whole[number])
            if there.state == GONE:
                late = [row for row in self.machine.rows if str(row.event) == f"late {use}"]
                wrong = f"{use} is {talk}, and {peer} is gone for good"
                yield "", f"{wrong}; {self._rows(late, f'add a row on `late {use}`')}"
                continue
            other = _Look(self.fleet, self.whole, number, self.trail)
            says = [row for row in other.machine.rows if not {*row.say}.isdisjoint(theirs)]
            heard = other.agent.talk(there, use) or NONE
            wrong = f"{use} is {talk}: it waits for {words} of {peer}, which is in {there.state}"
            rows = other._rows(says, f"add a row of {peer} that says {words}")
            yield peer, f"{wrong} with {use} {heard}; {rows}"

    def _open(self) -> Iterator[tuple[str, str, list[ProtocolAct], list[ProtocolAct]]]:
        """Each open conversation: use, state, what this side and what the other may say next; what
        nobody has to say is left out.
        """
        for use, talk in zip(self.agent.uses, self.local.talks, strict=True):
            table = use.protocol.tables[use.role]
            if not talk or talk in table.resting:
                continue
            listed = self._listed(use.name)
            said: dict[object, list[ProtocolAct]] = {SEND: [], RECEIVE: []}
            for row in table:
                word = ProtocolAct(use.name, row.performative, row.kind)
                speaker = self.name if row.way is SEND else use.peer
                known = (speaker, row.performative) in listed or row.kind == "cancel"
                calls_off = row.performative is Performative.CANCEL
                if row.state == talk and row.to != talk and known and not calls_off:
                    said[row.way].append(word)
            # who asked waits for an answer, whatever else it may say
            first = use.role is Role.INITIATOR and said[RECEIVE]
            yield use.name, talk, [] if first else said[SEND], said[RECEIVE]

    def _listed(self, use: str) -> set[tuple[str, Performative]]:
        """(sender, act) of the messages of a use."""
        every = {**self.fleet.design.protocols, **self.fleet.design.included_uses}
        return {(one.sender, one.performative) for one in every[use].message}

    # --- rows -------------------------------------------------------------------------------------

    def _rows(self, rows: Iterable[Row], right: str) -> str:
        """Why none of these rows applies here, each with its place; what is to be done."""
        known = {row.number: row for row in rows if not row.several}
        if not known:
            return f"{right} in {self.local.state}"
        here = sorted(known.values(), key=lambda row: self.local.state not in row.states)
        told = [f"{self.place(row)} {self._why(row)}" for row in here[:MOST_ROWS]]
        more = f"; and {len(here) - MOST_ROWS} more" if len(here) > MOST_ROWS else ""
        return f"{'; '.join(told)}{more}"

    def _since(self, use: str) -> str:
        """The rows it took since the conversation is in its state: one of them says too little."""
        numbers: list[int] = []
        for one in reversed(self.trail):
            here, there = one.here[self.number], one.there[self.number]
            before, after = (self.fleet.parts.local(self.number, two) for two in (here, there))
            if self.agent.talk(before, use) != self.agent.talk(after, use):
                break
            if one.who == self.name and before.state != after.state:
                numbers.append(self.row_of(here, one.what, there))
        rows = {row.number: row for row in self.machine.rows}
        told = [self.place(rows[number]) for number in numbers[::-1] if number][:MOST_ROWS]
        return f"; since then it took {', then '.join(told)}, without a word of it" if told else ""

    def _forgotten(self) -> str:
        """The volatile conversations that it lost in a death, in the state in which it is."""
        for one in reversed(self.trail):
            parts = self.fleet.parts
            before = parts.local(self.number, one.here[self.number])
            after = parts.local(self.number, one.there[self.number])
            if before.state != self.local.state or after.state != self.local.state:
                break
            if one.who == self.name and one.what.startswith(DIES):
                talks = zip(self.agent.uses, before.talks, after.talks, strict=True)
                lost = " and ".join(use.name for use, talk, now in talks if talk and not now)
                right = f"add a row on `restart` in {after.state}"
                return f"; it forgot {lost} in a death: {right}" if lost else ""
        return ""

    def _by(self, use: str) -> str:
        """The row that brought a conversation to the state in which it is."""
        for one in reversed(self.trail):
            here, there = one.here[self.number], one.there[self.number]
            before, after = (self.fleet.parts.local(self.number, two) for two in (here, there))
            if self.agent.talk(before, use) != self.agent.talk(after, use):
                number = self.row_of(here, one.what, there) if one.who == self.name else 0
                row = next((row for row in self.machine.rows if row.number == number), None)
                to = f", to {row.to}" if row and row.to else ""
                return f" since {self.place(row)}{to}" if row else ""
        return ""

    def row_of(self, here: int, what: str, there: int | None = None) -> int:
        """The number of the row by which it did this in a local state; 0 where it was none."""
        parts = self.fleet.parts
        takes = {row.event for row in self.machine.rows if row.event.act is not None}
        events = [ProtocolAct(one.name, one.act, one.kind) for one in takes if one.act is not None]
        for event in (OWN, RESTART, *events):
            found = parts.outcomes(self.number, here, event)
            for ready in found if isinstance(found, tuple) else ():
                if ready.label == what and there in (None, ready.there):
                    return ready.row
        return 0

    def _why(self, row: Row) -> str:
        if self.local.state not in row.states:
            states = ", ".join(sorted(row.states))
            return f"stands in {states} only: add {self.local.state} to its `in`, if it fits"
        for guard in row.when:
            if guard.use != row.event.name and not self.agent.holds(self.local, guard):
                talk = self.agent.talk(self.local, guard.use) or NONE
                words = "|".join(sorted(guard.words))
                return f"has the guard `{guard.use} {words}`, and {guard.use} is {talk}"
        if row.event.cause is Cause.PERSON:
            return f"is a person's choice (`{row.event}`), which nobody may wait for"
        if row.event.cause is Cause.RESTART:
            return "applies only after a death"
        if row.event.cause is Cause.TAKE and self._at_head(row):
            return f"takes it, and then {self._unsayable(row)}"
        if row.event.cause is Cause.OWN and self._unsayable(row):
            return self._unsayable(row)
        return f"waits for `{row.event}`, which does not come"

    def _unsayable(self, row: Row) -> str:
        """The word of a row that its conversation does not allow here, "" where there is none; what
        the row takes has come.
        """
        took, local = row.event, self.local
        if took.act is not None:
            use = self.machine.uses[took.name]
            table, talk = use.protocol.tables[use.role], self.agent.talk(local, took.name)
            found = table.find(talk or START, RECEIVE, took.act, took.kind)
            local = self.agent.with_talk(local, took.name, str(found.to)) if found else local
        for number, said in enumerate(row.say):
            if not self.agent.may_say(local, row.say[: number + 1]):
                use, talk = self.machine.uses[said.use], self.agent.talk(local, said.use)
                ended = talk in use.protocol.tables[use.role].ended
                word = NONE if ended or not talk else talk
                return f"may not say `{said}`: {said.use} is {word}{self._by(said.use)}"
        return ""

    def _at_head(self, row: Row) -> bool:
        return any(str(row.event) == str(words[0]) for words in self.words.values())

    def place(self, row: Row) -> str:
        design = self.fleet.design
        index = next((i for i, one in enumerate(design.file.agent) if one.name == self.name), 0)
        line = line_of(design.text, ("agent", index, "row", row.number - 1)) if design.text else 0
        where = f"{design.path or 'design.toml'}:{line}" if line else self.name
        return f"row {row.number} ({where})"
