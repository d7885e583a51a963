"""Whether what agents really did is a path of the composed model: each step of theirs must be a
move of it.

The model chooses where agents choose by content, so all states it may be in are kept. What agents
do not show as steps of theirs (a question asked again, a loss, a cancel that the runtime answers)
the model may do in between.
"""

from collections import Counter
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from fipa_codec.tables import Role
from topdown.judge.steps import Done, Steps
from topdown.model.design import Design
from topdown.model.errors import NoSuchEntry
from topdown.model.machines import Cause, Event, ProtocolAct
from topdown.prove.fleet import ANY, Faults, Flat, Fleet
from topdown.prove.local import DIES

HIDDEN = 4
"""Moves in between that no agent shows, at most (estimate: a loss, a repetition, a late cancel and
one to spare).
"""


class Deviation(NamedTuple):
    """The step that no move of the model answers to; `number` counts steps from 1, `here` are
    states of one guess.
    """

    number: int
    agent: str
    what: str
    here: dict[str, str]


class Follower:
    """Follows steps of running agents through the composed model of their design, from the start of
    all agents. What groups do shows nowhere: any of it may have happened in between.

    `states`: those the model may be in. `aside`: (use, agent) of questions and answers that are not
    in the model.
    """

    def __init__(self, design: Design) -> None:
        self.fleet = Fleet(design, Faults(ANY))
        self.steps = {name: Steps(design, name) for name in design.agents}
        self.states: set[Flat] = {self.fleet.boot}
        self.news = tuple(f"{soft.news} <-" for soft in self.fleet.soft if soft.latest)
        self.count = self.most = 0
        self.aside: Counter[tuple[str, str]] = Counter()

    def follow(self, deeds: Iterable[tuple[str, Done]]) -> Deviation | None:
        """Follow (agent, step) in order of time; return the first that is not a move of the model,
        None if all are.

        Raises NoSuchEntry for an agent that the design does not have.
        """
        for agent, deed in deeds:
            if agent not in self.steps:
                raise NoSuchEntry("agent", agent, self.steps)
            self.count += 1
            if self._shows_nothing(agent, deed):
                continue
            found = self._after(agent, deed) or self._unasked(agent, deed)
            if not found:
                here = self.fleet.describe(min(self.states))
                took = Event(Cause.TAKE, *deed.took) if deed.took else deed.event
                said = ", ".join(str(ProtocolAct(*one)) for one in deed.said) or "nothing"
                told = f"in {deed.before} on {took} said {said}, then {deed.after}"
                return Deviation(self.count, agent, told, here)
            self.states, self.most = found, max(self.most, len(found))
            self._note_aside(agent, deed)
        return None

    def _shows_nothing(self, agent: str, deed: Done) -> bool:
        """A step that the model leaves out: a silent word, a complaint, nothing said or changed."""
        if deed.took is None:
            return _is_quiet(deed) and not deed.event.startswith(("Started", "PeerChanged"))
        silent = self.fleet.parts.silent
        return ProtocolAct(*deed.took) in silent or deed.took[1] == "not-understood"

    def _after(self, agent: str, deed: Done) -> set[Flat]:
        """All states the model may be in after the step, with as few moves in between as need
        be.
        """
        label = self.fleet.parts.agents[self.fleet.parts.place[agent]].label
        labels = {DIES} if deed.event.startswith("Started") else set()
        for row in self.steps[agent].fitting(deed):
            labels.add(f"{DIES}; {label(row)}" if row.event.cause is Cause.RESTART else label(row))
        seen = here = set(self.states)
        for _ in range(HIDDEN + 1):
            found = {there for state in here for there in self._answers(state, agent, deed, labels)}
            if found:
                return found
            here = {there for state in here for there in self._hidden(state)} - seen
            seen = seen | here
        return set(self.states) if self._is_repeated(agent, deed) else set()

    def _note_aside(self, agent: str, deed: Done) -> None:
        """Questions that a row may ask besides, or that were given up, are not in the model:
        answered once each.
        """
        steps = self.steps[agent]
        rows = steps.fitting(deed)
        said = [ProtocolAct(*one) for one in deed.said] if rows else []
        besides = [one for one in said if all(one in r.may and one not in r.say for r in rows)]
        dropped = {use for row in rows for use in row.drop}
        for use in (*(one.use for one in besides), *dropped, *self._given_up(steps, deed)):
            if not steps.uses[use].durable:
                self.aside[use, steps.uses[use].peer] += 1

    def _given_up(self, steps: Steps, deed: Done) -> list[str]:
        """Uses whose question nobody waits for any more: the wait is over, or who asked has
        died.
        """
        uses = steps.uses.values()
        asks = [use.name for use in uses if use.role is Role.INITIATOR and not use.durable]
        word, _, about = deed.event.partition(" ")
        return [use for use in asks if word == "Started" or (word == "Late" and about == use)]

    def _unasked(self, agent: str, deed: Done) -> set[Flat]:
        """Such a question is answered, or its answer taken: nothing else may change."""
        if deed.took is None or deed.before != deed.after or not self.aside[deed.took[0], agent]:
            return set()
        self.aside[deed.took[0], agent] -= 1
        for use, _, _ in deed.said:
            self.aside[use, self.steps[agent].uses[use].peer] += 1
        return set(self.states)

    def _answers(self, state: Flat, agent: str, deed: Done, labels: set[str]) -> Iterator[Flat]:
        number = self.fleet.parts.place[agent]
        for who, what, there, _, _ in self.fleet.moves(state):
            if who != agent or isinstance(there[0], str):
                continue
            plain = what.removesuffix(" (a copy)").removesuffix("; its receipt is lost")
            after = self.fleet.parts.local(number, there[number]).state
            if after == deed.after and plain in labels:
                yield there

    def _hidden(self, state: Flat) -> Iterator[Flat]:
        """Moves that no agent shows as a step of its own; of observations any may be the last one
        that is owed.
        """
        for who, what, there, _, _ in self.fleet.moves(state):
            hidden = (
                who == "net"
                or who in self.fleet.groups
                or what.endswith(("again", "too late", "is dropped"))
                or what.startswith(self.news)
            )
            if hidden and not isinstance(there[0], str):
                yield there

    def _is_repeated(self, agent: str, deed: Done) -> bool:
        """One observation stands for all; a peer that appears again brings no news; a start that
        changes nothing.
        """
        if deed.took is None:
            return _is_quiet(deed) and deed.event.startswith(("PeerChanged", "Started"))
        return _is_quiet(deed) and self.steps[agent].uses[deed.took[0]].latest


def _is_quiet(deed: Done) -> bool:
    """Nothing is said, and its state stays."""
    return not deed.said and deed.before == deed.after
