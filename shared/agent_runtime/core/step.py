"""The pure core of an agent: step(state, event, now) -> (state, effects). No clock, no I/O, no thread.

A step takes at most one event to the behaviour, runs it and the chain of states it leads to, and ends in one journal
record if anything durable happened: a stream message or an observation was taken, a durable communicate or an
observation issued, the FSM's state or the memory (but for its `soft` field) changed, or the behaviour asked for it by
`turn.keep()`. Else the record is None.

Driver: state = core.boot(last record); sync core.record(state) before anything else; step with Started, then with each
event; after each step carry the effects out in their order; while `effects.more`, step with Next(); at `wake_at` with
Tick().
"""

from collections.abc import Sequence
from typing import Generic, TypeVar

import msgspec
from msgspec.structs import replace

from agent_runtime.core import control, lineage, renumbering, streams
from agent_runtime.core.agent import Agent
from agent_runtime.core.effects import Deed, Effects, Out
from agent_runtime.core.errors import AgentTableError, BehaviourError
from agent_runtime.core.events import (
    AnyEvent,
    Arrived,
    Broken,
    Garbled,
    Late,
    LinkChanged,
    Local,
    Next,
    Ordered,
    PeerChanged,
    Receipted,
    Received,
    Settled,
    Started,
    Tick,
    Woken,
)
from agent_runtime.core.intake import admit
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
from agent_runtime.core.verdict import Verdict, What, carry_out, judge
from agent_runtime.core.wiring import Delivery, Wiring
from fipa_codec.communicate import UNREADABLE
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import SEND, Role

M = TypeVar("M")
CHAIN_BOUND = 16
"""States entered in one step; the paper's machines have at most 5, so more is a loop (estimate)."""
OUTSIDE = "step outside the design"
REFUSED = "order refused"
UNFIT = "kept value does not fit the design"
KNOWN_DEEDS = 1024
"""Steps known to fit the design; estimate: an agent of the paper has some hundred different ones."""
LATE_AFTER = 0.001
"""A message at reply-by itself is in time (SC00061G); look a millisecond later."""
# Before Python 3.12 a member found by its class takes 0.1 us.
_DURABLE, _VOLATILE = Delivery.DURABLE, Delivery.VOLATILE
_INITIATOR, _PARTICIPANT = Role.INITIATOR, Role.PARTICIPANT
_COMPLAINT, _TAKE = Performative.NOT_UNDERSTOOD, What.TAKE


class Choice(msgspec.Struct, frozen=True):
    """An event that can be taken: an entry of the inbox with its verdict, a late conversation, a wake-up's name, or the
    key of a lost conversation.
    """

    waiting: Waiting | None = None
    verdict: Verdict | None = None
    late: Held | None = None
    wake: str = ""
    lost: str = ""


class Core(Generic[M]):
    """An agent bound to its wiring. It has no state but a cache of look-ups in the design."""

    def __init__(self, agent: Agent[M], wiring: Wiring) -> None:
        if agent.name != wiring.agent:
            raise AgentTableError(agent.name, f"is wired as {wiring.agent!r}", "give it its own wiring")
        self.agent, self.wiring = agent, wiring
        self._designed: set[Deed] = set()
        self._taken_in: dict[tuple[str, str, Performative, Kind], bool] = {}
        try:
            restored(agent, encode_record(fresh(agent)))
        except (msgspec.MsgspecError, TypeError, AttributeError) as error:
            hint = "memory is a msgspec Struct whose fields, but for `soft`, msgspec encodes and decodes"
            raise AgentTableError(agent.name, f"its memory cannot be journalled: {error}", hint) from error

    def first(self, journal: str) -> bytes:
        """Return the record that a new journal of this name begins with."""
        return encode_record(fresh(self.agent, journal))

    def boot(self, record: bytes | None) -> CoreState:
        """Return the start state of the next incarnation: the first memory, or the state in the journal's record."""
        try:
            state = fresh(self.agent) if record is None else restored(self.agent, record)
        except UNREADABLE as error:
            hint = "it is of another version, or damaged: start a new run, or move the journal away"
            raise AgentTableError(self.agent.name, f"its journal cannot be read: {error}", hint) from error
        if state.agent != self.agent.name or state.state not in self.agent.behaviours:
            raise AgentTableError(
                self.agent.name,
                f"the journal is of agent {state.agent!r} in state {state.state!r}",
                "use its own journal",
            )
        state.incarnation += 1
        state.soft.parameters, unfit = control.values(state.now_set, self.agent.parameters)
        for _ in unfit:
            state.count(UNFIT)
        return state

    def record(self, state: CoreState) -> bytes:
        """Return the journal record of a state."""
        return encode_record(state)

    def step(self, state: CoreState, event: AnyEvent, now: float) -> tuple[CoreState, Effects]:
        """Return state and effects; the given state is not changed. Raises BehaviourError, LocalProtocolError."""
        after, out = self.begin(state, event, now)
        return after, self.end(state, after, out, now)

    def begin(self, state: CoreState, event: AnyEvent, now: float) -> tuple[CoreState, Out]:
        """Run the part of a step after which its record is written and its messages may leave."""
        after, out = state.fork(), Out()
        after.soft.step += 1
        self._note(after, out, event, now)
        if not after.paused:
            after, out = self._take_one(after, out, now)
        self._check_owed(state, after)
        durable = self._durable(state, after, out)
        out.record = encode_record(after) if durable else None
        return after, out

    def end(self, state: CoreState, after: CoreState, out: Out, now: float) -> Effects:
        """Run the rest, for which no peer waits: compare the step with the design, find the time of the next step."""
        deed = out.deed(state.state, after.state, tuple(after.due))
        if deed is not None and deed not in self._designed:
            self._compare(after, out, deed)
        waits = None if after.paused else _waits(after)
        return out.sealed(self._ready(after, waits, now), self._wake_at(after, waits, now), deed)

    def _compare(self, state: CoreState, out: Out, deed: Deed) -> None:
        """Log a step that does not fit the design: the proof of the design does not cover it."""
        why = self.agent.rows.why_not(deed) if self.agent.rows is not None else ""
        if why:
            state.count(OUTSIDE)
            out.log(OUTSIDE, level="error", why=why)
        elif len(self._designed) < KNOWN_DEEDS:
            self._designed.add(deed)

    # --- what an event does before anything is taken ------------------------------------------------------------------

    def _note(self, state: CoreState, out: Out, event: AnyEvent, now: float) -> None:
        match event:
            case Arrived():
                self._arrive(state, out, event)
            case Local():
                _queue(state, Waiting(event))
            case Receipted(peer=peer):
                if self._settles(state, out, event, now):
                    _queue(state, Waiting(Settled(peer), forced=True))
            case PeerChanged():
                self._note_peer(state, out, event, now)
                _queue(state, Waiting(event, forced=True))
            case LinkChanged(up=up):
                state.soft.up = up
                out.log("router back" if up else "router away", level="info" if up else "warning")
                self._flush_all(state, out, now, wanted=up)
            case Started():
                _queue(state, Waiting(event, forced=True))
                self._flush_all(state, out, now, wanted=True)
            case Garbled(key=key, reason=reason, forged=forged):
                what = "forged" if forged else "garbled"
                state.count(what)
                out.log(what, level="warning", key=key, why=reason)
            case Tick():
                streams.on_time(state, out, self.wiring, now)
                _forget_unanswered(state, now)
            case Ordered(command=command):
                self._obey(state, out, command)
            case Next():
                pass
            case _:
                raise BehaviourError(
                    self.agent.name, state.state, f"was stepped with {event!r}", "that is the core's own"
                )

    def _arrive(self, state: CoreState, out: Out, event: Arrived) -> None:
        said, journal = event.communicate, event.journal
        if not journal or lineage.fits(state, out, said.sender, journal, event.believed):
            admit(state, out, self.wiring, event)

    def _obey(self, state: CoreState, out: Out, command: control.Command) -> None:
        """Obey an order, or say why not; either way the answer names it."""
        order, parameters = control.worded(command.order), self.agent.parameters
        try:
            settings = control.obeyed(state.now_set, command.order, parameters)
        except ValueError as error:
            state.count(REFUSED)
            out.log(REFUSED, level="warning", order=order, why=str(error))
            state.soft.answer = control.Answer(command.id, str(error))
            return
        state.settings, state.soft.answer = settings, control.Answer(command.id)
        state.soft.parameters = control.values(settings, parameters)[0]
        out.durable = True
        out.log("ordered", order=order)

    def _settles(self, state: CoreState, out: Out, event: Receipted, now: float) -> bool:
        """Take a receipt of the present journal. Return True where it covers the last observation due."""
        if event.journal and not lineage.fits(state, out, event.peer, event.journal, event.believed):
            return False
        emptied = streams.settle(state, out, self.wiring, event, now)
        renumbering.look(state, out, event, now)
        return emptied

    def _note_peer(self, state: CoreState, out: Out, event: PeerChanged, now: float) -> None:
        if event.incarnation is None:
            state.soft.peers.pop(event.agent, None)
            streams.forget_last(state, event.agent)
        else:
            if state.soft.peers.get(event.agent, event.incarnation) != event.incarnation:
                streams.forget_last(state, event.agent)
            state.soft.peers[event.agent] = event.incarnation
            news = lineage.met(state, out, event.agent, event.journal)
            streams.flush(state, out, self.wiring, event.agent, now, force=news)

    def _flush_all(self, state: CoreState, out: Out, now: float, *, wanted: bool) -> None:
        for peer in self.wiring.peers if wanted else ():
            streams.flush(state, out, self.wiring, peer, now, force=True)

    # --- taking one event ---------------------------------------------------------------------------------------------

    def _take_one(self, state: CoreState, out: Out, now: float) -> tuple[CoreState, Out]:
        """Take what can be taken first. With a full outbox: the first that fits, and what does not fit stays."""
        while (choice := self._choice(state, now)) is not None:
            if not (state.outbox and streams.crowded(state)):
                self._take(state, out, choice, now)
                return state, out
            after, said = state.fork(), out.fork()
            self._take(after, said, choice, now)
            full = streams.overfull(state, after, choice.waiting.event if choice.waiting else None)
            if not full:
                return after, said
            _hold(state, out, choice, full)
        return state, out

    def _choice(self, state: CoreState, now: float) -> Choice | None:
        if state.lost and (key := _untold(state)):
            return Choice(lost=key)
        found = self._find_waiting(state)
        if found is not None:
            return Choice(waiting=found[0], verdict=found[1])
        if state.wakes and (name := _due_wake(state, now)) is not None:
            return Choice(wake=name)
        late = self._find_late(state, _waits(state), now)
        return None if late is None else Choice(late=late)

    def _take(self, state: CoreState, out: Out, choice: Choice, now: float) -> None:
        if choice.waiting is not None:
            self._take_waiting(state, out, choice.waiting, choice.verdict, now)
        elif choice.late is not None:
            self._take_late(state, out, choice.late, now)
        elif choice.lost:
            self._take_lost(state, out, choice.lost, now)
        else:
            del state.wakes[choice.wake]
            self._run(state, out, Woken(choice.wake), now)

    def _ready(self, state: CoreState, waits: Sequence[Held] | None, now: float) -> bool:
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

    def _take_waiting(self, state: CoreState, out: Out, waiting: Waiting, verdict: Verdict | None, now: float) -> None:
        inbox = state.soft.inbox
        state.soft.inbox = tuple(one for one in inbox if one is not waiting) if len(inbox) > 1 else ()
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

    def _take_lost(self, state: CoreState, out: Out, key: str, now: float) -> None:
        lost = lineage.told(state, key)
        out.durable = True
        talk = lost.held.conversation
        out.about = self.wiring.required(talk.peer, talk.protocol).use
        self._run(state, out, Broken(talk.id, lost.why, talk.peer if lost.held.several else ""), now)

    # --- the behaviour ------------------------------------------------------------------------------------------------

    def _run(self, state: CoreState, out: Out, event: Seen, now: float) -> None:
        """Run one elementary action, then the arcs it opens; on entry a behaviour runs once without an event."""
        out.handled = event
        if isinstance(event, PeerChanged):
            out.about = event.agent if event.incarnation is not None else ""
        behaviour = self.agent.behaviours[state.state]
        turn = Turn(state, self.wiring, out, event, now)
        state.memory = behaviour.transition(state.memory, turn)
        turn.event = None  # of what is done on entering the states that follow
        for _ in range(CHAIN_BOUND):
            if not (behaviour.terminal(state.memory) or behaviour.error(state.memory)):
                return
            target = self.agent.next_state(state.state, state.memory)
            if target is None:
                arcs = ", ".join(
                    f"{a.when or 'always'} -> {a.target}" for a in self.agent.arcs if a.source == state.state
                )
                raise BehaviourError(
                    self.agent.name, state.state, "ended, and no arc may be taken", f"arcs: {arcs or 'none'}"
                )
            out.log("state", old=state.state, new=target, conversation=conversation_of(event))
            state.state = target
            behaviour = self.agent.behaviours[state.state]
            state.memory = behaviour.transition(state.memory, turn)
        raise BehaviourError(
            self.agent.name,
            state.state,
            f"entered {CHAIN_BOUND} states in one step",
            "some state must wait for an event",
        )

    def _check_owed(self, before: CoreState, state: CoreState) -> None:
        """Raise where a word that the protocol demands in the same step was not said."""
        for was, now in (
            (before.conversations, state.conversations),
            (before.soft.conversations, state.soft.conversations),
        ):
            for name, held in now.items():
                talk = held.conversation
                if was.get(name) is not held and talk.owes:
                    wanted = ", ".join(row.word for row in talk.table.allowed(talk.state, SEND))
                    what = f"took a message in {talk.id} ({talk.protocol}, {talk.state}) and owes its answer"
                    raise BehaviourError(self.agent.name, state.state, what, f"say {wanted} in the same step")

    # --- the record and the time --------------------------------------------------------------------------------------

    def _durable(self, before: CoreState, after: CoreState, out: Out) -> bool:
        if before.memory is not after.memory and not same_memory(before.memory, after.memory):
            kept = encode_memory(after.memory)
            out.durable = out.durable or kept != before.kept
            after.kept = kept
        return out.durable or before.state != after.state

    def _wake_at(self, state: CoreState, waits: Sequence[Held] | None, now: float) -> float | None:
        """Return the time of the next Tick; times already past wait for a behaviour that takes them, or for room."""
        soft, times = state.soft, []
        if soft.up and soft.resend:
            times += [at for at, _ in soft.resend.values()]
        if soft.up and (soft.asks or soft.last):
            times += [one.at for one in (*soft.asks.values(), *soft.last.values())]
        if waits is not None:
            times += [at for name, at in state.wakes.items() if _wake_key(name) not in soft.held]
            for held in waits:
                if held.reply_by is not None and held.reply_by + LATE_AFTER > now:
                    times.append(held.reply_by + LATE_AFTER)
        return min(times, default=None)


def _hold(state: CoreState, out: Out, choice: Choice, full: str) -> None:
    """Leave it where it is until an outbox has room again; say so once."""
    if not state.soft.full:
        state.count("outbox full")
        out.log("outbox full", level="error", peer=full, bound=streams.OUTBOX_BOUND)
    soft, one = state.soft, choice.waiting
    soft.full = full
    if one is not None:
        soft.inbox = tuple(replace(other, held=True) if other is one else other for other in soft.inbox)
    else:
        soft.held |= {choice.lost or (_wake_key(choice.wake) if choice.late is None else choice.late.key)}


def _wake_key(name: str) -> str:
    return f" {name}"  # no key of a conversation begins with a blank


def _untold(state: CoreState) -> str:
    """Return the key of the first lost conversation that the behaviour was not told of and that does not wait."""
    return next((key for key, one in state.lost.items() if not one.told and key not in state.soft.held), "")


def _queue(state: CoreState, waiting: Waiting) -> None:
    state.soft.inbox = (*state.soft.inbox, waiting)


def _forget_unanswered(state: CoreState, now: float) -> None:
    """Drop questions of peers left unanswered until their reply-by: no peer waits for them any more."""
    for name, held in list(state.soft.conversations.items()):
        talk = held.conversation
        if held.delivery is _VOLATILE and talk.role is _PARTICIPANT and talk.late(now):
            state.count("left unanswered")
            del state.soft.conversations[name]


def _due_wake(state: CoreState, now: float) -> str | None:
    held = state.soft.held
    due = [(at, name) for name, at in state.wakes.items() if at <= now and not (held and _wake_key(name) in held)]
    return min(due)[1] if due else None


def _waits(state: CoreState) -> list[Held]:
    """Conversations in which this agent waits for an end, and whose Late event was not raised yet."""
    both = (*state.conversations.values(), *state.soft.conversations.values())
    return [held for held in both if not held.late and held.conversation.role is _INITIATOR]
