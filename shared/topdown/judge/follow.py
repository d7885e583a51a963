"""One conversation followed from outside: where both roles may stand, after what was heard of them.

A listener hears what is said, and not when it is taken. A role's run is some merge of its own
messages and those said to it, each in their order; which merge, nobody but the role knows. So for
each role all states it may be in are kept, by how many of the messages said to it it has taken.
That is the exploration of fipa_codec (a state and what is on its way) for each role alone: the
roles meet in nothing but what was said. Legal crossings never alarm, since some merge explains
them. Must not know: content, size, time, who the agents are.
"""

from collections.abc import Iterable
from functools import cached_property, lru_cache
from typing import NamedTuple

from fipa_codec.conversation import Needs, needs
from fipa_codec.exploration import reached
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import NOT_UNDERSTOOD, RECEIVE, SEND, START, Protocol, Role, Table, Way

WINDOW = 64
"""Messages to a role that it may not have taken yet; beyond them it is held to have taken the
oldest. Estimate: an agent of the runtime takes nothing more once 16 of its own are unreceipted, and
keeps at most 16 of a stream waiting.
"""
States = frozenset[str]
BEGIN: States = frozenset({START})
NOWHERE: States = frozenset()


class TableMessage(NamedTuple):
    """A message as tables see it. `kinds`: the uses of its performative it may be (more than one:
    not known which).

    `label`: its m_w; `answers`: its m_t. `sure` False: its receiver may not have taken it (lost,
    dropped, a copy).
    """

    performative: Performative
    kinds: tuple[Kind, ...] = (Kind.PLAIN,)
    label: str = ""
    answers: str = ""
    sure: bool = True


class Moves:
    """Successors of states for one role: by its table and by the rule of not-understood outside it.

    `forgetful`: what ended is forgotten, so a participant may begin again (conversations that no
    journal keeps). Pure, so each answer is looked up in the table once only.
    """

    def __init__(self, table: Table, role: Role, *, forgetful: bool) -> None:
        self.table = table
        self.may_reopen = forgetful and role is Role.PARTICIPANT
        self.over = table.ended | {NOT_UNDERSTOOD}
        self._known: dict[tuple[object, ...], States] = {}

    @cached_property
    def uncancelled(self) -> States:
        """States that are reached without a cancel."""
        rows = [row for row in self.table if row.performative is not Performative.CANCEL]
        return frozenset(reached([START], lambda s: (row.to for row in rows if row.state == s)))

    def saying(self, states: States, said: TableMessage) -> States:
        """The states it may be in after saying this; none: it may not say it."""
        key = (states, said.performative, said.kinds)
        found = self._known.get(key)
        if found is None:
            if said.performative is Performative.NOT_UNDERSTOOD:
                found = frozenset(self._broken(state, said, SEND) for state in states)
            else:
                find, kinds = self.table.find, said.kinds
                rows = (
                    find(state, SEND, said.performative, kind) for state in states for kind in kinds
                )
                found = frozenset(row.to for row in rows if row is not None)
            self._known[key] = found
        return found

    def taking(self, states: States, said: TableMessage, *, sure: bool) -> States:
        """The states it may be in after this message (`sure`: and it took it); none: in none of
        these it can.
        """
        key = (states, said.performative, said.kinds, sure)
        found = self._known.get(key)
        if found is None:
            taken = frozenset(one for state in states for one in self._taking(state, said))
            found = self._known[key] = taken if sure else taken | states
        return found

    def words(self, states: States) -> str:
        """What may be said in these states."""
        words = {row.word for state in states for row in self.table.allowed(state, SEND)}
        return ", ".join(sorted(words)) or "nothing"

    def _taking(self, state: str, said: TableMessage) -> Iterable[str]:
        table, act = self.table, said.performative
        if act is Performative.NOT_UNDERSTOOD or state == NOT_UNDERSTOOD:
            return (self._broken(state, said, RECEIVE),)
        if state in table.urgent:
            return ()
        over = state in table.ended
        begins = (state, START) if over and self.may_reopen else (state,)
        rows = (table.find(one, RECEIVE, act, kind) for one in begins for kind in said.kinds)
        found = [row.to for row in rows if row is not None]
        return found or ((state,) if over else ())  # an ended role drops a stray

    def _broken(self, state: str, said: TableMessage, way: Way) -> str:
        """Not-understood ends it, whatever was said in it; as answer to a cancel it is a failed
        cancel.
        """
        if state in self.table.ended:
            return state
        if said.performative is Performative.NOT_UNDERSTOOD and Kind.CANCEL in said.kinds:
            row = self.table.find(state, way, Performative.FAILURE, Kind.CANCEL)
            if row is not None:
                return row.to
        return NOT_UNDERSTOOD


@lru_cache(maxsize=256)
def moves(protocol: Protocol, role: Role, durable: bool) -> Moves:
    """The moves of a role, shared by all conversations of a protocol."""
    return Moves(protocol.tables[role], role, forgetful=not durable)


class Side:
    """States that one role may be in: `_at[i]` are its states if it has taken `i` of the messages
    `_ahead`.

    `likely`: where it stands if nothing that was said to it is lost, and it takes it as soon as it
    can.
    """

    def __init__(self, moves: Moves) -> None:
        self._moves = moves
        self._ahead: list[TableMessage] = []
        self._at: list[States] = [BEGIN]
        self._taken = 0
        self._labels: dict[str, int] = {}
        self.likely: States = BEGIN

    @property
    def ended(self) -> bool:
        """Whether it likely stands at an end."""
        return self.likely <= self._moves.over

    @property
    def may_rest(self) -> bool:
        """Whether it may stay where it likely is for ever."""
        return bool(self.likely & self._moves.table.resting)

    def say(self, said: TableMessage) -> bool:
        """It says this; False, and nothing changes, where it may not in any of its states.

        What answers a message by its label is said after that message was taken.
        """
        found = self._saying(said)
        if not any(found):
            return False
        self._settle(found)
        likely = not said.sure and self._moves.saying(self.likely, said)
        self.likely = likely or self._last()
        return True

    def uses(self, said: TableMessage) -> tuple[Kind, ...]:
        """Of the uses that it may be those that this role may say now; all, if it may say none."""
        if len(said.kinds) == 1:
            return said.kinds
        may = (kind for kind in said.kinds if any(self._saying(said._replace(kinds=(kind,)))))
        return tuple(may) or said.kinds

    def _saying(self, said: TableMessage) -> list[States]:
        least = self._labels.get(said.answers, 0) - self._taken if said.answers else 0
        saying = self._moves.saying
        return [
            saying(states, said) if n >= least else NOWHERE for n, states in enumerate(self._at)
        ]

    def jump(self, said: TableMessage) -> None:
        """It said this although it may not: from here on it may also stand wherever saying it
        leads.
        """
        jumped = self._moves.saying(self._moves.table.states, said)
        self._settle([states | jumped for states in self._at])
        self.likely |= jumped

    def lose(self) -> None:
        """A part of what was said was not heard: it may stand anywhere, but for a cancel that
        nobody heard of.
        """
        self._ahead, self._taken, self._labels = [], 0, {}
        uncancelled = self._moves.uncancelled
        self.likely = uncancelled if self.likely <= uncancelled else self._moves.table.states
        self._at = [self.likely]

    def hear(self, said: TableMessage) -> None:
        """The other role said this: it is on its way."""
        self._ahead.append(said)
        self._at.append(self._moves.taking(self._at[-1], said, sure=said.sure))
        self.likely = self._moves.taking(self.likely, said, sure=True) or self._last()
        if said.label:
            self._labels.setdefault(said.label, self._taken + len(self._ahead))
        if len(self._ahead) > WINDOW and any(self._at[1:]):
            self._drop()

    def forget(self) -> None:
        """The agent died and came back: of a conversation that no journal keeps a participant knows
        nothing.
        """
        if self._moves.may_reopen:
            self._settle([states | BEGIN for states in self._at])

    def may_say(self) -> str:
        """What it may say, in words."""
        return self._moves.words(frozenset().union(*self._at))

    def _last(self) -> States:
        """Its state once it has taken all it can."""
        return next((states for states in reversed(self._at) if states), NOWHERE)

    def _drop(self) -> None:
        del self._at[0], self._ahead[0]
        self._taken += 1

    def _settle(self, found: list[States]) -> None:
        """Let it take what is on its way, as far as it can."""
        for n, said in enumerate(self._ahead):
            if found[n]:
                found[n + 1] |= self._moves.taking(found[n], said, sure=said.sure)
        self._at = found
        while len(self._at) > 1 and not self._at[0]:
            self._drop()


class Followed:
    """A conversation under a protocol; `durable`: its agents' journals keep it, and nothing is lost
    or taken twice.
    """

    def __init__(self, protocol: Protocol, *, durable: bool) -> None:
        self.protocol, self.durable = protocol, durable
        self.sides = {role: Side(moves(protocol, role, durable)) for role in Role}
        self._labels: dict[Role, dict[str, dict[Performative, tuple[Kind, ...]]]] = {
            role: {} for role in Role
        }
        self._rounds: frozenset[str] = frozenset()
        self._answered: dict[Role, set[str]] = {role: set() for role in Role}

    @property
    def states(self) -> tuple[str, str]:
        """States in which initiator and participant likely are, in words."""
        return _states_text(self.sides[Role.INITIATOR].likely), _states_text(
            self.sides[Role.PARTICIPANT].likely
        )

    @property
    def opened(self) -> bool:
        """Whether its opening was said."""
        return bool(self._rounds)

    @property
    def ended(self) -> bool:
        """Whether both have ended."""
        return all(side.ended for side in self.sides.values())

    def read(
        self, role: Role, act: Performative, label: str, answers: str, kinds: tuple[Kind, ...]
    ) -> TableMessage | str:
        """The message as the tables see it, or what is wrong with its labels. `kinds`: the
        content's own words.
        """
        asked, uses = self._labels[role.other], self._waiting(role.other, answers)
        if act is Performative.NOT_UNDERSTOOD:
            if answers and list(uses) == [act]:
                return f"it answers {answers!r}, a not-understood, which ended the conversation"
            cancelled = answers != "" and Performative.CANCEL in uses
            kinds = (Kind.CANCEL,) if cancelled else (Kind.PLAIN,)
            return TableMessage(act, kinds, label, answers if cancelled else "", self.durable)
        if answers and not uses:
            why = "was answered" if answers in asked else "was not asked here"
            return f"it answers {answers!r}, which {why}; asked were {', '.join(asked) or 'none'}"
        if uses and uses.keys() <= self.protocol.rounds and answers not in self._rounds:
            return (
                f"it answers {answers!r} of an earlier round; this round is"
                f" {_states_text(self._rounds)}"
            )
        if not label and needs(self.protocol, act) is Needs.ANY:
            return f"a {act} needs a reply-with, for its answer"
        if act is Performative.CONFIRM:
            confirmed = next((uses[one] for one in self.protocol.confirmed if one in uses), None)
            if confirmed is None:
                return "a confirm names in in-reply-to what it confirms"
            kinds = confirmed
        else:
            kinds = kinds if act is Performative.INFORM else (Kind.PLAIN,)
            # the label of the cancel, and perhaps of what it cancels; or it had none
            if Performative.CANCEL in uses:
                kinds = (Kind.CANCEL,) if answers and len(uses) == 1 else (*kinds, Kind.CANCEL)
        return TableMessage(act, kinds, label, answers, self.durable)

    def mislabelled(self, role: Role, act: Performative, label: str) -> str:
        """Return what is wrong with the label of a repeated message, "" where nothing is
        (fipa_codec.conversation).

        A repeated opening has the same one. A new round has none of an earlier round or of a
        cancel; nor has a cancel, but for that of its opening.
        """
        need, uses = needs(self.protocol, act), self._labels[role].get(label, {})
        if need is Needs.SAME and self._rounds and label not in self._rounds:
            return f"asked again with reply-with {label!r}; it was {_states_text(self._rounds)}"
        used = label != "" and bool(uses.keys() & {Performative.CANCEL, *self.protocol.openings})
        if used and (need is Needs.NEW or (need is Needs.OWN and label not in self._rounds)):
            return f"{act} with reply-with {label!r} again; that was used before"
        return ""

    def take(self, role: Role, said: TableMessage) -> bool:
        """`role` says this; False, and nothing changes, where it may not."""
        if not self.sides[role].say(said):
            return False
        if said.performative in self.protocol.openings:
            self._rounds = frozenset({said.label})
        if said.performative is Performative.CANCEL:
            self._answered[role].discard(said.label)
        # a volatile one may be asked again, and answered again
        elif said.kinds == (Kind.CANCEL,) and self.durable:
            self._answered[role.other].add(said.answers)
        self._pass_on(role, said)
        return True

    def doubt(self, role: Role, said: TableMessage) -> None:
        """`role` said this, but it may count for nothing: it was wrong, or a copy. Both stand where
        either leads.
        """
        self.sides[role].jump(said)
        if said.performative in self.protocol.rounds:  # it may have begun one, or not
            self._rounds |= {said.label}
        self._pass_on(role, said._replace(sure=False))

    def lose(self) -> None:
        """A part was not heard: both may stand anywhere, until what is said next tells."""
        for side in self.sides.values():
            side.lose()

    def guess(self, role: Role, said: TableMessage) -> None:
        """`role` says this from wherever it may stand."""
        if not self.sides[role].say(said):
            self.sides[role].jump(said)
        self._pass_on(role, said)

    def repeat(self, role: Role, said: TableMessage) -> None:
        """A copy came by: where no journal numbers it, its receiver may take it once more."""
        if not self.durable:
            self.sides[role].say(said)
            self.sides[role.other].hear(said._replace(sure=False))

    def _waiting(self, role: Role, label: str) -> dict[Performative, tuple[Kind, ...]]:
        """The acts that `role` said under this label and may have answered: all but an answered
        cancel.
        """
        uses = self._labels[role].get(label, {})
        if label not in self._answered[role]:
            return uses
        return {act: kinds for act, kinds in uses.items() if act is not Performative.CANCEL}

    def _pass_on(self, role: Role, said: TableMessage) -> None:
        if said.label or said.performative is Performative.CANCEL:
            self._labels[role].setdefault(said.label, {}).setdefault(said.performative, said.kinds)
        self.sides[role.other].hear(said)


def ended(protocol: Protocol, states: tuple[str, str]) -> bool:
    """Whether initiator and participant, in states as `Followed.states` words them, are at an end
    of their tables.
    """
    both = zip(Role, states, strict=True)
    return all(
        words and set(words.split("|")) <= protocol.tables[role].ended | {NOT_UNDERSTOOD}
        for role, words in both
    )


@lru_cache(maxsize=4096)
def _states_text(states: States) -> str:
    return "|".join(sorted(states))
