"""Actions of one agent in the composed model: its rows applied to the states of its conversations.

A local state is small: the state it waits in, the state of its conversation in each use (one at a
time), what it owes, which act was begun, which peers it has news of. Everything an event may lead
to is worked out once and kept.
"""

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

from fipa_codec.performatives import Performative
from fipa_codec.tables import RECEIVE, SEND, START, Role
from topdown.model.machines import (
    NONE,
    SERVED,
    SETTLED,
    UNSETTLED,
    WAITING,
    Cause,
    Event,
    Guard,
    Machine,
    ProtocolAct,
    Row,
    Use,
)

DIES = "dies and comes back"
GONE = "gone"
"""State of an agent that died for good."""


class Stray(str):
    """Reason why a word is outside an open conversation: where copies and late answers are normal,
    it is dropped.
    """


class Local(NamedTuple):
    """`talks`: state of the conversation of each use, "" where none is open; `owed`, `begun`: uses
    in which an observation is due, an act was begun; `news`: peers that came back and were not
    taken note of; `waiting`: uses whose conversation waits for its turn.
    """

    state: str
    talks: tuple[str, ...]
    owed: frozenset[str] = frozenset()
    begun: frozenset[str] = frozenset()
    news: frozenset[str] = frozenset()
    waiting: frozenset[str] = frozenset()


class Effect(NamedTuple):
    """An effect of a step outside the agent: `kind` is "say", "open", "close" or "owe"; `said` for
    the first two.
    """

    kind: str
    use: str
    said: ProtocolAct | None = None


class Outcome(NamedTuple):
    """Result of an event: `label` in words, `row` its number (0: the runtime's own answer),
    `again`: an act was begun that had been begun before.

    `heard`, `happened`: the local state and the effects of the event alone, before the row says
    anything: guards and `while` are evaluated there.
    """

    there: Local
    effects: tuple[Effect, ...]
    label: str
    row: int
    heard: Local
    happened: tuple[Effect, ...] = ()
    again: str = ""


class Agent:
    """An agent of the composed model. `silent`: words that change nothing anywhere, which are not
    sent. `direct`: uses whose words a device brings, so that none waits in the inbox.
    """

    def __init__(
        self,
        machine: Machine,
        silent: frozenset[ProtocolAct],
        direct: frozenset[str] = frozenset(),
    ) -> None:
        self.machine, self.silent, self.direct = machine, silent, direct
        self.uses: tuple[Use, ...] = tuple(machine.uses.values())
        self.index = {use.name: number for number, use in enumerate(self.uses)}
        self.take = lru_cache(maxsize=None)(self._take)
        self.spontaneous = lru_cache(maxsize=None)(self._spontaneous)
        self.restarted = lru_cache(maxsize=None)(self._restarted)

    @property
    def start(self) -> Local:
        """Before anything was said; every peer whose coming back matters has just come."""
        return Local(self.machine.entry.initial, ("",) * len(self.uses), news=self.watched)

    @property
    def watched(self) -> frozenset[str]:
        """Peers whose coming back some row answers."""
        events = (row.event for row in self.machine.rows)
        return frozenset(event.name for event in events if event.cause is Cause.BACK)

    def talk(self, local: Local, use: str) -> str:
        """State of the conversation of a use, "" where none is open."""
        return local.talks[self.index[use]]

    def at_rest(self, local: Local) -> bool:
        """Idle, nothing open but what may rest for ever, nothing owed, no news."""
        quiet = all(
            not talk or talk in use.protocol.tables[use.role].resting
            for use, talk in zip(self.uses, local.talks, strict=True)
        )
        return quiet and local.state in self.machine.rest and not local.owed and not local.news

    # --- what can happen --------------------------------------------------------------------------

    def _take(self, local: Local, said: ProtocolAct) -> "tuple[Outcome, ...] | str | None":
        """Outcomes of a message at the head of its queue; None: it waits; a text: nobody has
        thought of it.
        """
        if local.state == GONE:
            return None
        use = self.machine.uses[said.use]
        talk, table = self.talk(local, said.use), use.protocol.tables[use.role]
        if not talk and said.act is Performative.CANCEL and use.role is Role.PARTICIPANT:
            if table.find(START, RECEIVE, said.act, said.kind) is None:
                return f"{self.machine.agent} knows no conversation of {said.use} and got {said}"
            # the runtime answers a cancel of what has ended as the table says
            said_late = (Effect("say", use.name, one) for one in self.late_answers(use.name))
            return (Outcome(local, tuple(said_late), f"{said} <- {use.peer}, too late", 0, local),)
        named = self.machine.by_event.get((local.state, Event(Cause.TAKE, *said)), ())
        rows = [row for row in named if not row.several]
        who = f"{self.machine.agent} in {local.state}"
        found = table.find(talk or START, RECEIVE, said.act, said.kind)
        if not rows and found is not None and said.use in self.direct:
            return f"no row of {who} takes {said}, which does not wait"
        if not rows:
            return f"only rows for several at a time of {who} take {said}" if named else None
        if found is None:
            return Stray(f"{who} has {said.use} in {talk or NONE} and got {said}")
        after = self.with_talk(local, said.use, str(found.to))
        outcomes = tuple(self._apply(after, rows))
        if not outcomes:
            state = {u.name: t for u, t in zip(self.uses, after.talks, strict=True) if t}
            return f"no row of {who} applies to {said}; its conversations: {state}"
        return outcomes

    def late_answers(self, name: str) -> tuple[ProtocolAct, ...]:
        """The runtime's answer to a cancel that is not open: one word or, where the table owes
        none, nothing.
        """
        use = self.machine.uses[name]
        table = use.protocol.tables[use.role]
        taken = table.find(START, RECEIVE, Performative.CANCEL)
        answers = taken is not None and taken.to in table.urgent
        owed = table.allowed(taken.to, SEND) if taken is not None and answers else ()
        return tuple(ProtocolAct(name, row.performative, row.kind) for row in owed[:1])

    def _spontaneous(self, local: Local) -> tuple[tuple[Outcome, Event], ...]:
        """The events without a message, except restarts: own, person, back (with news of that
        peer), late.
        """
        found: list[tuple[Outcome, Event]] = []
        for row in self.machine.spontaneous.get(local.state, ()):
            event = row.event
            if row.several or event.cause is Cause.RESTART or not self._happens(local, event):
                continue
            gives_up = event.cause is Cause.LATE and not self.machine.uses[event.name].durable
            heard = {event.name} if event.cause is Cause.BACK else set()
            after = local._replace(news=local.news - heard)
            after = self.with_talk(after, event.name, "") if gives_up else after
            closed = (Effect("close", event.name),) if gives_up else ()
            for outcome in self._apply(after, [row]):
                happened = (*closed, *outcome.happened)
                found.append((outcome._replace(happened=happened), event))
        answered = {event.name for _, event in found if event.cause is Cause.BACK}
        # news are told once: where no row answers them, they change nothing
        for peer in sorted(local.news - answered):
            after = local._replace(news=local.news - {peer})
            dropped = Outcome(after, (), f"news of {peer} is dropped", 0, after)
            found.append((dropped, Event(Cause.BACK, peer)))
        return tuple(found)

    def _happens(self, local: Local, event: Event) -> bool:
        if event.cause is Cause.BACK:
            return event.name in local.news
        if event.cause is Cause.LATE:
            use = self.machine.uses[event.name]
            return use.role is Role.INITIATOR and bool(self.talk(local, event.name))
        return True

    def _restarted(self, local: Local) -> tuple[Outcome, ...]:
        """After a death: soft conversations are gone, then a row for it, where there is one that
        applies.
        """
        closed = tuple(Effect("close", use.name) for use in self.uses if not use.durable)
        held = zip(self.uses, local.talks, strict=True)
        talks = tuple(talk if use.durable else "" for use, talk in held)
        after = local._replace(talks=talks, news=self.watched)
        rows = self.machine.by_event.get((local.state, Event(Cause.RESTART)), ())
        outcomes = tuple(self._apply(after, [row for row in rows if not row.several]))
        found = outcomes or (Outcome(after, (), "", 0, after),)
        return tuple(
            one._replace(happened=(*closed, *one.happened), label=f"{DIES}{_and(one.label)}")
            for one in found
        )

    def would_change(self, local: Local, said: ProtocolAct) -> bool:
        """Whether a silent word, where it may come, would change this state after all, or would not
        be taken.
        """
        use, talk = self.machine.uses[said.use], self.talk(local, said.use)
        table = use.protocol.tables[use.role]
        if not talk or table.find(talk, RECEIVE, said.act, said.kind) is None:
            return False
        found = self.take(local, said)
        if found is None or isinstance(found, str):
            return True
        return any(one.there != local or one.happened or one.effects for one in found)

    def gone(self) -> Outcome:
        """Dead for good."""
        closed = tuple(Effect("close", use.name) for use in self.uses if not use.durable)
        there = Local(GONE, ("",) * len(self.uses))
        return Outcome(there, closed, "dies for good", 0, there)

    # --- a row applied ----------------------------------------------------------------------------

    def _apply(self, after: Local, rows: list[Row]) -> Iterator[Outcome]:
        """Every row that applies to `after` (the event has happened to it)."""
        for row in rows:
            heard = local = after._replace(owed=after.owed.union(row.owes))
            if not all(self.holds(heard, guard) for guard in row.when):
                continue
            happened, effects = tuple(Effect("owe", name) for name in row.owes), []
            called = {guard.use for guard in row.when if WAITING in guard.words}
            local = local._replace(waiting=local.waiting - called)
            for name in row.drop:
                if self.talk(local, name):
                    local = self.with_talk(local, name, "")
                    effects.append(Effect("close", name))
            spoken = self._spoken(local, row.say)
            if spoken is None:
                continue
            local, said = spoken
            again = row.moves if row.moves and row.moves in local.begun else ""
            if row.moves:
                local = local._replace(begun=local.begun | {row.moves})
            if row.to:
                local = local._replace(state=row.to)
            local = local._replace(waiting=local.waiting.union(row.waits))
            ended, closing = self._forget_ended(local)
            if ended is not None:
                done = (*effects, *said, *closing)
                yield Outcome(ended, done, self.label(row), row.number, heard, happened, again)

    def holds(self, local: Local, guard: Guard) -> bool:
        """Whether a guard holds in a local state."""
        talk = self.talk(local, guard.use) or NONE
        due = UNSETTLED if guard.use in local.owed else SETTLED
        turn = WAITING if guard.use in local.waiting else SERVED
        return talk in guard.states or not guard.words.isdisjoint((due, turn))

    def may_say(self, local: Local, words: tuple[ProtocolAct, ...]) -> bool:
        """Whether the tables allow these words, one after the other."""
        return self._spoken(local, words) is not None

    def _spoken(
        self, local: Local, words: tuple[ProtocolAct, ...]
    ) -> "tuple[Local, list[Effect]] | None":
        """The local state after these words, and what they do outside; None where a table forbids
        one.
        """
        effects: list[Effect] = []
        for said in words:
            use = self.machine.uses[said.use]
            table, talk = use.protocol.tables[use.role], self.talk(local, said.use)
            opens = use.role is Role.INITIATOR and said.act in use.protocol.openings
            begins = opens and (not use.durable or talk in table.ended)
            found = table.find(START if begins else talk or START, SEND, said.act, said.kind)
            if found is None:
                return None
            local = self.with_talk(local, said.use, str(found.to))
            if said not in self.silent:
                effects.append(Effect("open" if opens else "say", said.use, said))
        return local, effects

    def _forget_ended(self, local: Local) -> "tuple[Local | None, list[Effect]]":
        """Ended conversations are not kept; None where one still owes a word, so that the row does
        not apply.
        """
        effects: list[Effect] = []
        for use, talk in zip(self.uses, local.talks, strict=True):
            table = use.protocol.tables[use.role]
            if talk and talk in table.urgent:
                return None, []
            if talk and talk in table.ended:
                begun, waiting = local.begun - {use.name}, local.waiting - {use.name}
                local = self.with_talk(local, use.name, "")._replace(begun=begun, waiting=waiting)
                if not use.durable:
                    effects.append(Effect("close", use.name))
        return local, effects

    def with_talk(self, local: Local, use: str, state: str) -> Local:
        """The same with another state of the conversation of a use."""
        number = self.index[use]
        return local._replace(talks=(*local.talks[:number], state, *local.talks[number + 1 :]))

    def label(self, row: Row) -> str:
        """A row in words, as drawings of traces show it."""
        event, uses = row.event, self.machine.uses
        told = event.name.replace("_", " ") if event.cause is Cause.OWN else str(event)
        told += f" <- {uses[event.name].peer}" if event.cause is Cause.TAKE else ""
        return told + _and(", ".join(f"{one} -> {uses[one.use].peer}" for one in row.say))


def _and(words: str) -> str:
    return f"; {words}" if words else ""
