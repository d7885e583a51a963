"""Rows, guards, states of rest and rules that can never apply, whatever the peers say; peers that
are never told.

Method: one use of a protocol at a time. The pairs (state of the agent, state of its conversation)
are walked over the agent's rows; the peer may say all that its table allows, and of the other uses
nothing is known. So the walk finds more than can happen, never less, and what it does not find
cannot happen. What takes two uses or two agents at once is left to the exploration of the composed
system (topdown.prove).
"""

from collections.abc import Collection, Iterator
from functools import cached_property
from typing import NamedTuple

from fipa_codec.exploration import reached
from fipa_codec.languages import Kind as Answer
from fipa_codec.performatives import Performative
from fipa_codec.tables import RECEIVE, SEND, START, Role
from fipa_codec.tables import Row as TableRow
from topdown.model import elements
from topdown.model.design import Design
from topdown.model.errors import DesignError
from topdown.model.findings import Finding, Kind
from topdown.model.loading import Path_
from topdown.model.machines import (
    NONE,
    SERVED,
    SETTLED,
    UNSETTLED,
    WAITING,
    Cause,
    Guard,
    Machine,
    ProtocolAct,
    References,
    Row,
    Use,
)

Pair = tuple[str, str]
"""State of the agent, state of its conversation ("": none is open)."""
CANCEL = Performative.CANCEL
EVENT, GUARD, SAYS, OWES = range(4)
"""What of a row does not hold, in the order in which it is looked at."""


class Barred(NamedTuple):
    """Why a row does not apply to a conversation in state `talk` (after the event but for
    EVENT).
    """

    stage: int
    talk: str
    words: str = ""


class Walk:
    """All that may become of the conversation of one use, by the agent's rows."""

    def __init__(self, machine: Machine, use: Use) -> None:
        self.machine, self.use = machine, use
        self.table = use.protocol.tables[use.role]
        self.rows = [row for row in machine.rows if not row.several]
        self.owed = any(use.name in row.owes for row in self.rows)
        self.waits = any(use.name in row.waits for row in self.rows)
        self.steps: dict[Pair, list[tuple[Row, Pair]]] = {}
        self.applied: set[Row] = set()
        self.barred: dict[Row, set[Barred]] = {}
        reached([(machine.entry.initial, "")], self._onward)

    def _onward(self, here: Pair) -> list[Pair]:
        state, talk = here
        steps = self.steps[here] = []
        for row in self.rows:
            if state not in row.states:
                continue
            for after in self._after(row, talk):
                if isinstance(after, Barred):
                    self.barred.setdefault(row, set()).add(after)
                else:
                    self.applied.add(row)
                    steps.append((row, (row.to or state, after)))
        lost = [] if self.use.durable else [(state, "")]  # by a death
        return [*(there for _, there in steps), *lost]

    def _after(self, row: Row, talk: str) -> Iterator[str | Barred]:
        """The states of the conversation after a row, or why it does not apply."""
        for heard in self._heard(row, talk):
            acted = heard if isinstance(heard, Barred) else self._acted(row, heard)
            yield from [acted] if isinstance(acted, Barred) else self._besides(row, acted)

    def _besides(self, row: Row, talk: str) -> set[str]:
        """The states to which words lead that it may say besides."""
        may = [said for said in row.may if said.use == self.use.name]

        def said(here: str) -> list[str]:
            found = (self._said(word, here) for word in may)
            return ["" if there in self.table.ended else there for there in found if there]

        return reached([talk], said)

    def _heard(self, row: Row, talk: str) -> Iterator[str | Barred]:
        event, use = row.event, self.use
        soft = not use.durable
        if event.cause is Cause.RESTART:
            yield "" if soft else talk
        elif event.name != use.name or event.cause not in (Cause.TAKE, Cause.LATE):
            yield talk
        elif event.cause is Cause.LATE and use.latest and use.role is Role.PARTICIPANT:
            yield talk  # the wait for who subscribed and is gone
        elif event.cause is Cause.LATE:
            waits = use.role is Role.INITIATOR and talk
            yield ("" if soft else talk) if waits else Barred(EVENT, talk)
        else:
            assert event.act is not None
            # a newer question takes the place of an older one
            renewed = {START} if soft and use.role is Role.PARTICIPANT else set()
            for start in sorted({talk or START} | renewed):
                found = self.table.find(start, RECEIVE, event.act, event.kind)
                yield Barred(EVENT, talk) if found is None else str(found.to)

    def _acted(self, row: Row, talk: str) -> str | Barred:
        for guard in row.when:
            if guard.use == self.use.name and not self.holds(guard, talk):
                return Barred(GUARD, talk, "|".join(sorted(guard.words)))
        talk = "" if self.use.name in row.drop else talk
        for said in row.say:
            if said.use != self.use.name:
                continue
            there = self._said(said, talk)
            if there is None:
                return Barred(SAYS, talk, str(said))
            talk = there
        if talk in self.table.urgent:
            owed = (one.word for one in self.table.allowed(talk, SEND))
            return Barred(OWES, talk, " or ".join(owed))
        return "" if talk in self.table.ended else talk

    def _said(self, said: ProtocolAct, talk: str) -> str | None:
        """The state after a word of the agent; None where the table has no row for it."""
        opens = self.use.role is Role.INITIATOR and said.act in self.use.protocol.openings
        begins = opens and (not self.use.durable or talk in self.table.ended)
        start = START if begins else talk or START
        found = self.table.find(start, SEND, said.act, said.kind)
        return None if found is None else str(found.to)

    def holds(self, guard: Guard, talk: str) -> bool:
        """Whether a guard may hold for a conversation in this state."""
        due = {SETTLED, SERVED} | ({UNSETTLED} if self.owed else set())
        turn = {WAITING} if self.waits and talk else set()
        return (talk or NONE) in guard.states or not guard.words.isdisjoint(due | turn)

    @property
    def opened(self) -> bool:
        """Whether it is for the peer to open it, or a row does."""
        rows = self.machine.rows
        mine = any(self.opens((*row.say, *row.may)) for row in rows)
        return self.use.role is Role.PARTICIPANT or mine

    def opens(self, words: Collection[ProtocolAct]) -> bool:
        """Whether one of these words opens a conversation of this use."""
        mine = (said for said in words if said.use == self.use.name)
        return any(said.act in self.use.protocol.openings for said in mine)

    def about(self, row: Row) -> bool:
        """Whether the row's event is of this use."""
        return row.event.name == self.use.name and row.event.cause in (Cause.TAKE, Cause.LATE)

    @cached_property
    def states(self) -> frozenset[str]:
        """States of the agent that rows lead to."""
        return frozenset(state for state, _ in self.steps)

    def talks(self, states: Collection[str]) -> frozenset[str]:
        """States of the conversation, or NONE, while the agent is in one of these."""
        return frozenset(talk or NONE for state, talk in self.steps if state in states)

    def heard(self, states: Collection[str], says: Collection[str]) -> frozenset[str]:
        """The same after the events at which the agent says one of these words."""
        return frozenset(
            heard or NONE
            for row in self.rows
            if not set(map(str, row.say)).isdisjoint(says)
            for state, talk in self.steps
            if state in row.states and state in states
            for heard in self._heard(row, talk)
            if not isinstance(heard, Barred)
        )

    def follows(self, cause: Row, row: Row) -> bool:
        """Whether a message could come only after another, which no row takes where it can come."""
        first, then = self._taken(cause), self._taken(row)
        if not first or not then or row is cause:
            return False
        later = reached(
            [str(one.to) for one in first],
            lambda here: [str(one.to) for one in self.table if one.state == here],
        )
        return later.issuperset(one.state for one in then) and not later.issuperset(
            one.state for one in first
        )

    def _taken(self, row: Row) -> list[TableRow]:
        """The rows of the table for the message that a row takes; none where it takes none of this
        use.
        """
        event = row.event
        if event.cause is not Cause.TAKE or event.name != self.use.name:
            return []
        word = (RECEIVE, event.act, event.kind)
        return [one for one in self.table if (one.way, one.performative, one.kind) == word]

    def stuck(self) -> Iterator[tuple[Row, Pair]]:
        """Rows that lead to where only this agent could go on in the conversation, and no row ever
        does.
        """
        left = {here for here in self.steps if self._moves_on(here)}
        waiting = list(left)
        before: dict[Pair, list[Pair]] = {}
        for here, steps in self.steps.items():
            for row, there in steps:
                if row.event.cause is not Cause.RESTART:
                    before.setdefault(there, []).append(here)
        while waiting:
            for here in before.get(waiting.pop(), ()):
                if here not in left:
                    left.add(here)
                    waiting.append(here)
        for here, steps in self.steps.items():
            for row, there in steps:
                if there not in left and (here in left or here[1] != there[1]):
                    yield row, there

    def _moves_on(self, here: Pair) -> bool:
        """The conversation is over, the peer can say something in it, or a row does."""
        _, talk = here
        awaited = (row for row in self.table.allowed(talk, RECEIVE) if row.to != talk)
        may = any(row.performative is not CANCEL for row in awaited)
        said = (row for row, there in self.steps[here] if there[1] != talk)
        goes_on = any(row.event.cause is not Cause.RESTART for row in said)
        return not talk or talk in self.table.resting or may or goes_on


def findings(design: Design) -> Iterator[Finding]:
    """Of every agent that has rows, and of the rules."""
    walks: dict[str, dict[str, Walk]] = {}
    for index, agent in enumerate(design.file.agent):
        try:
            machine = Machine(design, agent.name)
        except DesignError:
            continue  # that is a finding of its own
        if machine.rows:
            uses = machine.uses.items()
            walks[agent.name] = {name: Walk(machine, use) for name, use in uses}
            yield from _rows(machine, walks[agent.name], ("agent", index))
            yield from _rest(agent, walks[agent.name], ("agent", index))
            yield from _untold(machine, walks[agent.name], ("agent", index))
            yield from _endless(machine, walks[agent.name], ("agent", index))
    for number, rule in enumerate(design.file.never):
        at: Path_ = ("never", number)
        try:
            _readable(design, rule, walks, at)
        except DesignError as error:
            yield Finding(Kind.UNDEFINED, error.field, error.wrong, error.right, error.at)
        else:
            yield from _never(design, rule, walks, at)


# --- Rows and guards ------------------------------------------------------------------------------


def _rows(machine: Machine, walks: dict[str, Walk], at: Path_) -> Iterator[Finding]:
    """Rows that apply in no case; where some are found, what lies behind them is left out."""
    barred: dict[int, tuple[Row, Walk]] = {}
    # where no row opens a use, that its words do not come follows
    unopened = [walk for walk in walks.values() if not walk.opened]
    applies = {row.number for walk in unopened for row in walk.rows if walk.about(row)}
    met = frozenset(machine.waits).intersection(*(walk.states for walk in walks.values()))
    called_off = {
        said.use for row in machine.rows for said in (*row.say, *row.may) if said.act is CANCEL
    }
    for row in machine.rows:
        walk = next((one for one in walks.values() if row not in one.applied), None)
        # the answer to a cancel that nobody says hurts nobody
        idle = row.event.kind is Answer.CANCEL and row.event.name not in called_off
        if row.several or walk is None or idle:
            applies.add(row.number)
        else:
            barred.setdefault(row.number, (row, walk))
    found = {number: one for number, one in barred.items() if number not in applies}
    near = {number: one for number, one in found.items() if not met.isdisjoint(one[0].states)}
    causes = {
        number: (row, walk)
        for number, (row, walk) in near.items()
        if not any(walk.follows(other, row) for other, there in near.values() if there is walk)
    } or near
    for number, (row, walk) in causes.items():
        where, place = f"agent {machine.agent}, row {number}", (*at, "row", number - 1)
        wrong, right = _why(row, walk, met)
        yield Finding(Kind.NEVER_HOLDS, where, wrong, right, place)
    if not causes:
        for number, (row, _) in found.items():
            where, place = f"agent {machine.agent}, row {number}", (*at, "row", number - 1)
            wrong = f"never applies: no row leads to {' or '.join(sorted(row.states))}"
            right = "let a row lead there with `to`, or drop this one"
            yield Finding(Kind.NEVER_HOLDS, where, wrong, right, place)


def _why(row: Row, walk: Walk, met: Collection[str]) -> tuple[str, str]:
    """What is wrong with a row that never applies, and what would be right."""
    use, in_ = walk.use.name, " or ".join(sorted(row.states & set(met)))
    barred = walk.barred.get(row, set())
    stage = max((one.stage for one in barred), default=EVENT)
    last = sorted((one for one in barred if one.stage == stage), key=str)
    talks = "|".join(sorted({one.talk or NONE for one in last}))
    words = last[0].words if last else ""
    here = f"{use} is {talks} in {in_}"
    if stage == EVENT:
        told = f"never applies: {here}, where `{row.event}` cannot come"
        return told, "name the states in which it can come under `in`, or drop the row"
    if stage == GUARD:
        wrong = f"its guard `{use} {words}` never holds: {here} after the event"
        if WAITING in words.split("|") and not walk.waits:
            state = f", and never the state of {walk.use.protocol.name}"
            named = state if WAITING in map(str, walk.table.states) else ""
            wrong += (
                f"; `{WAITING}` means that it waits for its turn, as `waits` of a row says{named}"
            )
        return wrong, f"name one of {talks}, or drop the row"
    if stage == SAYS:
        wrong = f"never applies: {here} after the event, where the table has no row for `{words}`"
        return wrong, "say it in another state of the conversation, or drop the row"
    wrong = f"never applies: after it {use} is {talks}, which owes {words} in the same step"
    return wrong, f"add it under `say`: {words}"


# --- States of rest, and peers that wait for a word -----------------------------------------------


def _rest(agent: elements.Agent, walks: dict[str, Walk], at: Path_) -> Iterator[Finding]:
    """In a state of rest nothing is open, at least sometimes."""
    for state in agent.rest:
        open_: dict[str, str] = {}
        for name, walk in walks.items():
            talks = walk.talks([state])
            if talks and talks.isdisjoint({NONE, *walk.table.resting}):
                open_[name] = "|".join(sorted(talks))
        if open_:
            told = " and ".join(f"{name} is {talks}" for name, talks in open_.items())
            wrong = f"{state} is said to be a state of rest, and {told} there whatever happens"
            right = f"drop {state} from `rest`: it is in the middle of that conversation"
            yield Finding(Kind.NO_REST, f"agent {agent.name}, rest", wrong, right, (*at, "rest"))


def _untold(machine: Machine, walks: dict[str, Walk], at: Path_) -> Iterator[Finding]:
    """The row by which a peer is left waiting, once for each use and state."""
    told: set[tuple[str, str]] = set()
    several = {said.use for row in machine.rows if row.several for said in row.say}
    for name, walk in walks.items():
        for row, (state, talk) in walk.stuck() if name not in several else ():
            if (name, talk) in told:
                continue
            told.add((name, talk))
            words = " or ".join(
                f"`{name} {one.word}`" for one in walk.table.allowed(talk, SEND) if not one.free
            )
            where, place = f"agent {machine.agent}, {row}", (*at, "row", row.number - 1)
            wrong = (
                f"leaves {name} {talk} in {state}, and no row from there on says {words}:"
                f" {walk.use.peer} waits for ever"
            )
            right = f"say {words} in this row, or give {state} a row that does"
            yield Finding(Kind.NEVER_TOLD, where, wrong, right, place)


CALLS = ("cfp", "icfp")
"""Protocols whose participants may stay silent: a deadline ends the wait (SC00029H)."""


def _endless(machine: Machine, walks: dict[str, Walk], at: Path_) -> Iterator[Finding]:
    """Questions whose answer may never come (of volatile uses, and calls for proposals), asked by a
    row that leads to a state in which no row ends the wait.
    """
    late = {
        (row.event.name, state)
        for row in machine.rows
        if row.event.cause is Cause.LATE
        for state in row.states
    }
    for name, walk in walks.items():
        use = walk.use
        answered = use.durable and use.protocol.name not in CALLS
        if use.role is Role.PARTICIPANT or use.latest or answered:
            continue
        asked = {
            there: row
            for steps in walk.steps.values()
            for row, (there, talk) in steps
            if talk and walk.opens(row.say)
        }
        for state, row in asked.items():
            if (name, state) in late or state in machine.rest:
                continue
            where, place = f"agent {machine.agent}, row {row.number}", (*at, "row", row.number - 1)
            wrong = (
                f"{machine.agent} in {state} waits for an answer in {name} that may never come, and"
                f" no row on `late {name}` ends the wait"
            )
            right = f"add a row on `late {name}` in {state}"
            yield Finding(Kind.NO_DEADLINE, where, wrong, right, place)


# --- Rules of what must never happen --------------------------------------------------------------


def _talks(walk: Walk, states: Collection[str], rule: elements.Never) -> frozenset[str]:
    """States of a conversation at the event at which the words of a rule are said."""
    if walk.machine.agent == rule.agent:
        return walk.heard(states, rule.says)
    return walk.talks(states)


def _readable(
    design: Design, rule: elements.Never, walks: dict[str, dict[str, Walk]], at: Path_
) -> None:
    """Raises DesignError where a rule names an agent or an act that is not there."""
    known = (*design.agents, *(one.name for one in design.file.group))
    read = References(design, f"never {rule.name}", (*at, "agent"))
    read.among("agent", rule.agent, design.agents)
    read.at = (*at, "says")
    for text in rule.says if rule.agent in walks else ():
        read.said(text, walks[rule.agent], f"protocol of {rule.agent}")
    read.at = (*at, "while")
    for text in rule.while_:
        read.among("agent", text.partition(" ")[0], known)


def _never(
    design: Design, rule: elements.Never, walks: dict[str, dict[str, Walk]], at: Path_
) -> Iterator[Finding]:
    """A rule whose words nobody says, or whose conditions never hold, forbids nothing."""
    where = f"never {rule.name}"
    agent = design.agents.get(rule.agent)
    if agent is not None and rule.agent in walks:
        machine = next(iter(walks[rule.agent].values())).machine if walks[rule.agent] else None
        said = {str(one) for row in (machine.rows if machine else ()) for one in row.say}
        if said.isdisjoint(rule.says):
            wrong = f"no row of {rule.agent} says {' or '.join(rule.says)}, so it forbids nothing"
            right = "name what a row has under `say`"
            yield Finding(Kind.NEVER_HOLDS, where, wrong, right, (*at, "says"))
            return
    within: dict[str, set[str]] = {}
    for text in rule.while_:
        name, what, words = (*text.split(" ", 2), "", "")[:3]
        if what == "in" and name in walks:
            states = set(words.split("|"))
            within[name] = within.get(name, states) & states
    for text in rule.while_:
        name, what, words = (*text.split(" ", 2), "", "")[:3]
        if name not in walks or not walks[name]:
            continue
        own = walks[name]
        met = set.intersection(*(set(walk.states) for walk in own.values()))
        here = within.get(name, met) & met
        if not here:
            wrong = f"`{text}` never holds: rows of {name} lead to {', '.join(sorted(met))}"
            right = "name one of these, and of one agent states that can be at once"
        elif what == "owes" and words in own and not own[words].owed:
            wrong = f"`{text}` never holds: no row of {name} has {words} under `owes`"
            right = "give a row `owes`, or drop the condition"
        elif what in own and (talks := _talks(own[what], here, rule)).isdisjoint(words.split("|")):
            known = "|".join(sorted(talks))
            inside = f" in {'|'.join(sorted(here))}" if name in within else ""
            wrong = f"`{text}` never holds: {what} of {name} is {known}{inside} after the event"
            right = f"name one of {known}"
        else:
            continue
        yield Finding(Kind.NEVER_HOLDS, where, wrong, right, (*at, "while"))
        return
