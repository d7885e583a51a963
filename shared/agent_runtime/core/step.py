"""The pure core of an agent: step(state, event, now) -> (state, effects). No clock, no I/O, no
thread.

A step takes at most one event to the behaviour, runs it and the chain of states it leads to, and
ends in one journal record if anything durable happened: a stream message or an observation was
taken, a durable communicate or an observation issued, the FSM's state or the memory (but for its
`soft` field) changed, or the behaviour asked for it by `turn.keep()`. Else the record is None.

Driver: state = core.boot(last record); sync core.record(state) before anything else; step with
Started, then with each event; after each step carry the effects out in their order; while
`effects.more`, step with Next(); at `wake_at` with Tick().
"""

from collections.abc import Sequence
from typing import Generic, TypeVar

import msgspec
from msgspec.structs import replace

from agent_runtime.core import control, peers, streams
from agent_runtime.core.agent import Agent, Behaviour
from agent_runtime.core.errors import AgentTableError, BehaviourError
from agent_runtime.core.events import (
    AnyEvent,
    Arrived,
    Broken,
    Deed,
    Effects,
    Late,
    Local,
    Out,
    PeerChanged,
    Received,
    Woken,
)
from agent_runtime.core.outside import GuestHears, GuestLost
from agent_runtime.core.reception import Verdict, What, carry_out, judge, note
from agent_runtime.core.state import (
    CoreState,
    Held,
    Waiting,
    encode_memory,
    encode_record,
    fresh,
    restored,
    same_memory,
)
from agent_runtime.core.turn import Seen, Turn, conversation_of
from agent_runtime.core.wiring import Delivery, Wiring
from fipa_codec.communicate import UNREADABLE
from fipa_codec.errors import LocalProtocolError
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import SEND, Role

M = TypeVar("M")
CHAIN_BOUND = 16
"""States entered in one step; the paper's machines have at most 5, so more is a loop (estimate)."""
OUTSIDE = "step outside the design"
ENDLESS = "opened {use} without a reply-by, so the design's rows on `late {use}` never apply"
UNFIT = "kept value does not fit the design"
KNOWN_DEEDS = 1024
"""Steps known to fit the design; estimate: an agent of the paper has some hundred different
ones.
"""
# Before Python 3.12 a member found by its class takes 0.1 us.
_DURABLE, _TAKE, _INITIATOR = Delivery.DURABLE, What.TAKE, Role.INITIATOR
_COMPLAINT = Performative.NOT_UNDERSTOOD


# --- Choice of the next event: from the inbox, wake-ups, late and lost conversations; and when to
# look again


LATE_AFTER = 0.001
"""A message at reply-by itself is in time (SC00061G); look a millisecond later."""


class Choice(msgspec.Struct, frozen=True):
    """An event that can be taken: an entry of the inbox with its verdict, a late conversation, a
    wake-up's name, or the key of a lost conversation.
    """

    waiting: Waiting | None = None
    verdict: Verdict | None = None
    late: Held | None = None
    wake: str = ""
    lost: str = ""


def wake_at(state: CoreState, waits: Sequence[Held] | None, now: float) -> float | None:
    """When the next Tick is wanted; times already past wait for a behaviour that takes them, or for
    room.
    """
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


def unended(state: CoreState) -> list[Held]:
    """Conversations in which this agent waits for an end, and whose Late event was not raised
    yet.
    """
    both = (*state.conversations.values(), *state.soft.conversations.values())
    return [held for held in both if not held.late and held.conversation.role is _INITIATOR]


# --- The core -------------------------------------------------------------------------------------


class Core(Generic[M]):
    """An agent bound to its wiring. It has no state but a cache of look-ups in the design."""

    def __init__(self, agent: Agent[M], wiring: Wiring) -> None:
        if agent.name != wiring.agent:
            where = f"is wired as {wiring.agent!r}"
            raise AgentTableError(agent.name, where, "give it its own wiring")
        self.agent, self.wiring = agent, wiring
        self._designed: set[Deed] = set()
        self._taken_in: dict[tuple[str, str, Performative, Kind], bool] = {}
        try:
            restored(agent, encode_record(fresh(agent)))
        except (msgspec.MsgspecError, TypeError, AttributeError) as error:
            hint = (
                "memory is a msgspec Struct whose fields, but for `soft`, msgspec encodes and"
                " decodes"
            )
            where = f"its memory cannot be journalled: {error}"
            raise AgentTableError(agent.name, where, hint) from error

    def first(self, journal: str) -> bytes:
        """The record that a new journal of this name begins with."""
        return encode_record(fresh(self.agent, journal))

    def boot(self, record: bytes | None) -> CoreState:
        """The start state of the next incarnation: the first memory, or the state in the journal's
        record.
        """
        try:
            state = fresh(self.agent) if record is None else restored(self.agent, record)
        except UNREADABLE as error:
            hint = "it is of another version, or damaged: start a new run, or move the journal away"
            agent = self.agent.name
            raise AgentTableError(agent, f"its journal cannot be read: {error}", hint) from error
        if state.agent != self.agent.name or state.state not in self.agent.behaviours:
            where = f"the journal is of agent {state.agent!r} in state {state.state!r}"
            raise AgentTableError(self.agent.name, where, "use its own journal")
        state.incarnation += 1
        state.soft.parameters, unfit = control.values(state.now_set, self.agent.parameters)
        for _ in unfit:
            state.count(UNFIT)
        return state

    def record(self, state: CoreState) -> bytes:
        return encode_record(state)

    def step(self, state: CoreState, event: AnyEvent, now: float) -> tuple[CoreState, Effects]:
        """The state after it, and the effects; the given state is not changed.

        Raises BehaviourError, LocalProtocolError.
        """
        after, out = self.begin(state, event, now)
        return after, self.end(state, after, out, now)

    def begin(self, state: CoreState, event: AnyEvent, now: float) -> tuple[CoreState, Out]:
        """Run the part of a step after which its record is written and its messages may leave."""
        after, out = state.fork(), Out()
        after.soft.step += 1
        note(self.agent, self.wiring, after, out, event, now)
        if not after.paused and after.journal == state.journal:
            after, out = self._take_one(after, out, now)
        self._check_owed(state, after)
        if state.memory is not after.memory and not same_memory(state.memory, after.memory):
            kept = encode_memory(after.memory)
            out.durable = out.durable or kept != state.kept
            after.kept = kept
        out.record = encode_record(after) if out.durable or state.state != after.state else None
        return after, out

    def end(self, state: CoreState, after: CoreState, out: Out, now: float) -> Effects:
        """Run the rest, for which no peer waits: compare the step with the design, find the time of
        the next step.
        """
        deed = out.deed(state.state, after.state, tuple(after.due))
        if deed is not None and deed not in self._designed:
            why = self.agent.rows.why_not(deed) if self.agent.rows is not None else ""
            if why:  # the proof of the design does not cover this step
                after.count(OUTSIDE)
                out.log(OUTSIDE, level="error", why=why)
            elif len(self._designed) < KNOWN_DEEDS:
                self._designed.add(deed)
        rows = self.agent.rows
        for use in out.unlimited:
            if rows is not None and rows.ends_wait(use):
                after.count(OUTSIDE)
                out.log(OUTSIDE, level="error", why=ENDLESS.format(use=use))
        waits = None if after.paused else unended(after)
        more = waits is not None and self._next(after, now, waits) is not None
        return out.sealed(more, wake_at(after, waits, now), deed)

    # --- choice of the next event -----------------------------------------------------------------

    def _next(
        self, state: CoreState, now: float, waits: Sequence[Held] | None = None
    ) -> Choice | None:
        """What can be taken first; None for nothing. `waits`: what `unended` returned, where it is
        known.
        """
        soft = state.soft
        for key, one in state.lost.items():
            if not one.told and key not in soft.held:
                return Choice(lost=key)
        if soft.inbox and (choice := self._find_waiting(state)) is not None:
            return choice
        if state.wakes:
            past = ((at, name) for name, at in state.wakes.items() if at <= now)
            due = [(at, name) for at, name in past if wake_key(name) not in soft.held]
            if due:
                return Choice(wake=min(due)[1])
        takes = self.agent.behaviours[state.state].takes
        for held in unended(state) if waits is None else waits:
            over = held.reply_by is not None and now > held.reply_by and held.key not in soft.held
            if over and takes(state.memory, Late(held.conversation.id)):
                return Choice(late=held)
        return None

    def _find_waiting(self, state: CoreState) -> Choice | None:
        """The first inbox entry that can be taken. Streams keep their order: an entry not taken
        blocks the rest.
        """
        passed: set[str] = set()
        takes = self.agent.behaviours[state.state].takes
        for waiting in state.soft.inbox:
            if waiting.held or (waiting.number and waiting.peer in passed):
                if waiting.number:
                    passed.add(waiting.peer)
                continue
            if not isinstance(waiting.event, Arrived):
                if waiting.forced or takes(state.memory, waiting.event):
                    return Choice(waiting)
                continue
            verdict = judge(state, waiting)
            if verdict.what is not _TAKE:
                return Choice(waiting, verdict)
            communicate = waiting.event.communicate
            if self._named(state, waiting, verdict) and takes(
                state.memory, Received(communicate, waiting.content)
            ):
                return Choice(waiting, verdict)
            if waiting.number:
                passed.add(waiting.peer)
        return None

    def _named(self, state: CoreState, waiting: Waiting, verdict: Verdict) -> bool:
        """Whether a row of the state names this message; a complaint is always taken."""
        rows, act = self.agent.rows, waiting.event.communicate.performative
        if rows is None or act is _COMPLAINT:
            return True
        # all of the design, so their number is bounded
        place = state.state, waiting.link.use, act, verdict.kind
        taken = self._taken_in.get(place)
        if taken is None:
            taken = self._taken_in[place] = rows.takes(*place)
        return taken

    # --- taking one event -------------------------------------------------------------------------

    def _take_one(self, state: CoreState, out: Out, now: float) -> tuple[CoreState, Out]:
        """Take what can be taken first. With a full outbox: the first that fits, and what does not
        fit stays.
        """
        while (choice := self._next(state, now)) is not None:
            if not (state.outbox and streams.crowded(state)):
                self._take(state, out, choice, now)
                return state, out
            after, said = state.fork(), out.fork()
            self._take(after, said, choice, now)
            full = streams.overfull(state, after, choice.waiting.event if choice.waiting else None)
            if not full:
                return after, said
            if not state.soft.full:  # said once
                state.count("outbox full")
                out.log("outbox full", level="error", peer=full, bound=streams.OUTBOX_BOUND)
            soft, held = state.soft, choice.waiting
            soft.full = full
            if held is not None:
                soft.inbox = tuple(
                    replace(one, held=True) if one is held else one for one in soft.inbox
                )
            else:
                late = wake_key(choice.wake) if choice.late is None else choice.late.key
                soft.held |= {choice.lost or late}
        return state, out

    def _take(self, state: CoreState, out: Out, choice: Choice, now: float) -> None:
        if choice.waiting is not None:
            self._take_waiting(state, out, choice.waiting, choice.verdict, now)
        elif choice.late is not None:
            self._take_late(state, out, choice.late, now)
        elif choice.lost:
            lost = peers.note_lost(state, choice.lost)
            out.durable = True
            talk = lost.held.conversation
            out.about = self.wiring.required(talk.peer, talk.protocol).use
            self._run(
                state, out, Broken(talk.id, lost.why, talk.peer if lost.held.several else ""), now
            )
        else:
            del state.wakes[choice.wake]
            self._run(state, out, Woken(choice.wake), now)

    def _take_waiting(
        self, state: CoreState, out: Out, waiting: Waiting, verdict: Verdict | None, now: float
    ) -> None:
        inbox = state.soft.inbox
        state.soft.inbox = (
            tuple(one for one in inbox if one is not waiting) if len(inbox) > 1 else ()
        )
        event: Seen | None = waiting.event
        if verdict is not None:
            if verdict.what is _TAKE:  # the message in the words of the design
                out.took = (waiting.link.use, waiting.event.communicate.performative, verdict.kind)
            else:
                out.about = waiting.link.use
            event = carry_out(state, out, self.wiring, waiting, verdict, now)
        if event is not None:
            self._run(state, out, event, now)

    def _take_late(self, state: CoreState, out: Out, held: Held, now: float) -> None:
        name = held.conversation.id
        state.count("late")
        if held.delivery is _DURABLE:
            state.conversations[held.key] = replace(held, late=True)
            out.durable = True
        else:
            state.soft.conversations.pop(name, None)
            state.soft.asks.pop(name, None)
        out.about = self.wiring.required(held.conversation.peer, held.conversation.protocol).use
        self._run(state, out, Late(name, held.conversation.peer if held.several else ""), now)

    # --- the behaviour ----------------------------------------------------------------------------

    def _run(self, state: CoreState, out: Out, event: Seen, now: float) -> None:
        """Run one elementary action, then the arcs it opens; on entry a behaviour runs once without
        an event.
        """
        out.handled = event
        if isinstance(event, PeerChanged):
            out.about = event.agent if event.incarnation is not None else ""
        elif isinstance(event, Local):  # a word of an included system in the words of the design
            match event.content:
                case GuestHears(use=use, act=act, kind=kind):
                    out.took = (use, act, kind)
                case GuestLost(use=use):
                    out.called, out.about = Late.__name__, use
        behaviour = self.agent.behaviours[state.state]
        turn = Turn(state, self.wiring, out, event, now)
        state.memory = self._act(behaviour, state, turn)
        turn.event = None  # of what is done on entering the states that follow
        for _ in range(CHAIN_BOUND):
            if not (behaviour.terminal(state.memory) or behaviour.error(state.memory)):
                return
            target = self.agent.next_state(state.state, state.memory)
            if target is None:
                leading = (arc for arc in self.agent.arcs if arc.source == state.state)
                arcs = ", ".join(f"{arc.when or 'always'} -> {arc.target}" for arc in leading)
                what = "ended, and no arc may be taken"
                raise BehaviourError(self.agent.name, state.state, what, f"arcs: {arcs or 'none'}")
            out.log("state", old=state.state, new=target, conversation=conversation_of(event))
            state.state = target
            behaviour = self.agent.behaviours[state.state]
            state.memory = self._act(behaviour, state, turn)
        agent, what = self.agent.name, f"entered {CHAIN_BOUND} states in one step"
        raise BehaviourError(agent, state.state, what, "some state must wait for an event")

    def _act(self, behaviour: Behaviour[M], state: CoreState, turn: Turn) -> M:
        """Run the behaviour once; what it may not say is told with the agent and its state."""
        try:
            return behaviour.transition(state.memory, turn)
        except LocalProtocolError as error:
            where = f"agent {self.agent.name!r} in state {state.state!r}"
            field = f"{where}, {error.field}" if error.field else where
            raise LocalProtocolError(field, error.reason) from error

    def _check_owed(self, before: CoreState, state: CoreState) -> None:
        """Raise where a message that the protocol demands in the same step was not said."""
        for was, now in (
            (before.conversations, state.conversations),
            (before.soft.conversations, state.soft.conversations),
        ):
            for name, held in now.items():
                talk = held.conversation
                if was.get(name) is not held and talk.owes:
                    wanted = ", ".join(row.word for row in talk.table.allowed(talk.state, SEND))
                    what = (
                        f"took a message in {talk.id} ({talk.protocol}, {talk.state}) and owes its"
                        " answer"
                    )
                    agent = self.agent.name
                    raise BehaviourError(agent, state.state, what, f"say {wanted} in the same step")
