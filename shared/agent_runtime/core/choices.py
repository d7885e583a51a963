"""Choice of the next event: from the inbox, wake-ups, late and lost conversations; and when to look again."""

from collections.abc import Sequence
from typing import Any

import msgspec

from agent_runtime.core.agent import Agent
from agent_runtime.core.events import Arrived, Late, Received
from agent_runtime.core.state import CoreState, Held, Waiting
from agent_runtime.core.verdict import Verdict, What, judge
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import Role

LATE_AFTER = 0.001
"""A message at reply-by itself is in time (SC00061G); look a millisecond later."""
# Before Python 3.12 a member found by its class takes 0.1 us.
_INITIATOR, _COMPLAINT, _TAKE = Role.INITIATOR, Performative.NOT_UNDERSTOOD, What.TAKE


class Choice(msgspec.Struct, frozen=True):
    """An event that can be taken: an entry of the inbox with its verdict, a late conversation, a wake-up's name, or the
    key of a lost conversation.
    """

    waiting: Waiting | None = None
    verdict: Verdict | None = None
    late: Held | None = None
    wake: str = ""
    lost: str = ""


class Choices:
    """The choices of an agent. It has no state but a cache of look-ups in the design."""

    def __init__(self, agent: Agent[Any]) -> None:
        self.agent = agent
        self._taken_in: dict[tuple[str, str, Performative, Kind], bool] = {}

    def next(self, state: CoreState, now: float) -> Choice | None:
        """Return what can be taken first; None for nothing."""
        if state.lost and (key := _untold(state)):
            return Choice(lost=key)
        found = self._find_waiting(state)
        if found is not None:
            return Choice(waiting=found[0], verdict=found[1])
        if state.wakes and (name := _due_wake(state, now)) is not None:
            return Choice(wake=name)
        late = self._find_late(state, unended(state), now)
        return None if late is None else Choice(late=late)

    def ready(self, state: CoreState, waits: Sequence[Held] | None, now: float) -> bool:
        """Whether more can be taken at once; `waits` None: nothing is, while paused."""
        if waits is None:
            return False
        return bool(
            (state.lost and _untold(state))
            or (state.soft.inbox and self._find_waiting(state) is not None)
            or (state.wakes and _due_wake(state, now) is not None)
            or (waits and self._find_late(state, waits, now) is not None)
        )

    def _find_waiting(self, state: CoreState) -> tuple[Waiting, Verdict | None] | None:
        """Return the first inbox entry that can be taken. Streams keep order: an entry not taken blocks the rest."""
        passed: set[str] = set()
        takes = self.agent.behaviours[state.state].takes
        for waiting in state.soft.inbox:
            if waiting.held or (waiting.number and waiting.peer in passed):
                if waiting.number:
                    passed.add(waiting.peer)
                continue
            if not isinstance(waiting.event, Arrived):
                if waiting.forced or takes(state.memory, waiting.event):
                    return waiting, None
                continue
            verdict = judge(state, waiting)
            if verdict.what is not _TAKE:
                return waiting, verdict
            communicate = waiting.event.communicate
            if self._named(state, waiting, verdict) and takes(state.memory, Received(communicate, waiting.content)):
                return waiting, verdict
            if waiting.number:
                passed.add(waiting.peer)
        return None

    def _named(self, state: CoreState, waiting: Waiting, verdict: Verdict) -> bool:
        """Whether a row of the state names this message; a complaint is always taken."""
        rows, act = self.agent.rows, waiting.event.communicate.performative
        if rows is None or act is _COMPLAINT:
            return True
        place = state.state, waiting.link.use, act, verdict.kind  # words of the design, so their number is bounded
        taken = self._taken_in.get(place)
        if taken is None:
            taken = self._taken_in[place] = rows.takes(*place)
        return taken

    def _find_late(self, state: CoreState, waits: Sequence[Held], now: float) -> Held | None:
        takes = self.agent.behaviours[state.state].takes
        for held in waits:
            over = held.reply_by is not None and now > held.reply_by and held.key not in state.soft.held
            if over and takes(state.memory, Late(held.conversation.id)):
                return held
        return None


def wake_at(state: CoreState, waits: Sequence[Held] | None, now: float) -> float | None:
    """Return the time of the next Tick; times already past wait for a behaviour that takes them, or for room."""
    soft, times = state.soft, []
    if soft.up and soft.resend:
        times += [at for at, _ in soft.resend.values()]
    if soft.up and (soft.asks or soft.last):
        times += [one.at for one in (*soft.asks.values(), *soft.last.values())]
    if waits is not None:
        times += [at for name, at in state.wakes.items() if wake_key(name) not in soft.held]
        for held in waits:
            if held.reply_by is not None and held.reply_by + LATE_AFTER > now:
                times.append(held.reply_by + LATE_AFTER)
    return min(times, default=None)


def wake_key(name: str) -> str:
    return f" {name}"  # no key of a conversation begins with a blank


def _untold(state: CoreState) -> str:
    """Return the key of the first lost conversation that the behaviour was not told of and that does not wait."""
    return next((key for key, one in state.lost.items() if not one.told and key not in state.soft.held), "")


def _due_wake(state: CoreState, now: float) -> str | None:
    held = state.soft.held
    due = [(at, name) for name, at in state.wakes.items() if at <= now and not (held and wake_key(name) in held)]
    return min(due)[1] if due else None


def unended(state: CoreState) -> list[Held]:
    """Conversations in which this agent waits for an end, and whose Late event was not raised yet."""
    both = (*state.conversations.values(), *state.soft.conversations.values())
    return [held for held in both if not held.late and held.conversation.role is _INITIATOR]
