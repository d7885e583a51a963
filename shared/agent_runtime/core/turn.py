"""One elementary action as seen by a behaviour: its event, its time, and the messages it may send.

A turn has no clock, no socket and no file; a message leaves the agent only after the step's record
is on the disk.
"""

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import msgspec
from msgspec.structs import replace

from agent_runtime.core import streams
from agent_runtime.core.errors import BehaviourError
from agent_runtime.core.events import (
    Broken,
    Late,
    Local,
    Ordered,
    Out,
    PeerChanged,
    Received,
    Settled,
    Started,
    Woken,
)
from agent_runtime.core.outside import GuestSays
from agent_runtime.core.state import CoreState, Due, Held, anybodys
from agent_runtime.core.wiring import Delivery, Link, Wiring
from fipa_codec.communicate import Communicate
from fipa_codec.conversation import Conversation
from fipa_codec.errors import LocalProtocolError
from fipa_codec.languages import Kind
from fipa_codec.multicast import Multicast
from fipa_codec.performatives import Performative
from fipa_codec.tables import Role

V = TypeVar("V", bool, int, float, str)
Seen = Received | Late | Broken | Woken | Local | PeerChanged | Settled | Started | Ordered
"""Types of `turn.event`, besides None (the state was just entered)."""
# Before Python 3.12 a member found by its class takes 0.1 us.
_DURABLE, _LATEST = Delivery.DURABLE, Delivery.LATEST
_INITIATOR, _PARTICIPANT = Role.INITIATOR, Role.PARTICIPANT
_PLAIN = Kind.PLAIN
_OF_A_TALK = (Received, Late, Broken)


class Turn(msgspec.Struct, eq=False):
    """`event`: None where the state was just entered; `now`: unix seconds."""

    _state: CoreState
    _wiring: Wiring
    _out: Out
    event: Seen | None
    now: float

    # --- communicates -----------------------------------------------------------------------------

    def open(
        self,
        to: str,
        protocol: str,
        performative: Performative,
        content: Any = None,
        *,
        reply_by_s: float | None = None,
        parent: str = "",
    ) -> str:
        """Open a conversation with `to` as its initiator; return its id.

        `reply_by_s`: seconds from now after which Late comes, unless the conversation has ended. A
        durable one then stays open until the peer's last word; a volatile question is given up.
        LocalProtocolError where the design has no such link. `parent`: the conversation for whose
        sake it is opened; only the step log has it (`roco trace`).
        """
        return self._open(
            self._state.name(), to, protocol, performative, content, reply_by_s, parent
        ).id

    def open_all(
        self,
        to: Sequence[str],
        protocol: str,
        performative: Performative,
        content: Any = None,
        *,
        reply_by_s: float | None = None,
        parent: str = "",
    ) -> Multicast:
        """Open one conversation-id with several participants, each with a state machine; the
        Multicast tracks them.

        Name the participant (`to`) wherever you say something in it later, and note in the
        Multicast what became of it: `group.noted(event.talk, turn.now)`,
        `group.noted(turn.say(...), turn.now)`. Late and Broken come for each participant. Only over
        durable links: LocalProtocolError elsewhere, and where nobody or one twice is named.
        """
        name = self._state.name()
        for peer in to:
            if self._wiring.required(peer, protocol).delivery is not _DURABLE:
                raise LocalProtocolError(
                    "protocol", f"{protocol} with {peer!r} is not durable; open it with one peer"
                )
        said = (protocol, performative, content, reply_by_s, parent)
        return Multicast.opened([self._open(name, peer, *said, several=True) for peer in to])

    def join(self, talk: Conversation) -> None:
        """Take part in a conversation that was opened for this agent by another (recruiting:
        fipa_codec.proxying).

        A target joins a conversation it has accepted; a client joins one whose answers it awaits,
        best before it asks, with peer "": then each agent that answers has its own conversation,
        until `leave`, and no Late comes. Raises LocalProtocolError where the design has no durable
        link for it in that role.
        """
        link = self._wiring.required(talk.peer, talk.protocol) if talk.peer else None
        if link and (link.role is not talk.role or link.delivery is not _DURABLE):
            wanted = f"a durable link as {talk.role} of {talk.protocol} with {talk.peer!r}"
            raise LocalProtocolError(
                "protocol", f"{self.me!r} has no {wanted}, but {link.delivery} as {link.role}"
            )
        initiates = talk.role is _INITIATOR
        reply_by = talk.deadline if initiates and talk.peer else None
        self._state.keep(Held(talk, Delivery.DURABLE, reply_by=reply_by, several=initiates))
        self._out.durable = True

    def leave(self, conversation: str) -> None:
        """Accept no more answerers in a conversation that was joined with peer ""; those under way
        go on.
        """
        self._state.conversations.pop(anybodys(conversation), None)
        self._out.durable = True

    def say(
        self,
        conversation: str,
        performative: Performative,
        content: Any = None,
        *,
        in_reply_to: str | None = None,
        kind: Kind | None = None,
        reply_by_s: float | None = None,
        to: str = "",
    ) -> Conversation:
        """Say something in an open conversation and return it; the language is that of the
        content's class.

        `in_reply_to` None: what the protocol says. `kind=Kind.CANCEL`: this answers the peer's
        cancel. `reply_by_s` sets a new time for Late. `to`: which participant, where there are
        several. BehaviourError where the conversation is not open, LocalProtocolError where the
        protocol forbids it. In one that ended because the peer lost its journal nothing is sent.
        """
        lost = self._state.lost.get(conversation) or self._state.lost.get(f"{conversation} {to}")
        if lost is not None and not self.holds(conversation, to):
            return lost.held.conversation
        held = self._held(conversation, to, f"said {performative}, but ")
        link = self._wiring.required(held.conversation.peer, held.conversation.protocol)
        reply_by = None if reply_by_s is None else self.now + reply_by_s
        if reply_by is not None:
            held = replace(held, reply_by=reply_by, late=False)
        return self._speak(
            held, link, performative, content, in_reply_to=in_reply_to, kind=kind, reply_by=reply_by
        )

    def drop(self, conversation: str) -> None:
        """Give up a volatile conversation silently: nothing is asked again, later answers are
        ignored.

        Nothing happens where it is over already; BehaviourError for a durable one, which ends by
        its protocol only.
        """
        if conversation in self._state.conversations:
            raise self._error(
                f"dropped durable conversation {conversation!r}", "say cancel, and wait for the end"
            )
        self._state.soft.conversations.pop(conversation, None)
        self._state.soft.asks.pop(conversation, None)

    def holds(self, conversation: str, to: str = "") -> bool:
        """Whether the conversation is open (with this participant, where there are several)."""
        return self._state.held(conversation, to) is not None

    def conversation(self, conversation: str, to: str = "") -> Conversation:
        """The open conversation: protocol, role, peer, state, `.cancel`. BehaviourError where it is
        not open.
        """
        return self._held(conversation, to).conversation

    def conversations(self, peer: str = "", protocol: str = "") -> tuple[Conversation, ...]:
        """All open conversations, or those with a peer or of a protocol, oldest first."""
        both = (*self._state.conversations.values(), *self._state.soft.conversations.values())
        talks = (held.conversation for held in both)
        return tuple(
            talk for talk in talks if peer in ("", talk.peer) and protocol in ("", talk.protocol)
        )

    # --- observations -----------------------------------------------------------------------------

    def observe(self, to: str, subject: str, content: Any, *, last: bool = False) -> None:
        """Queue this newest observation of `subject` for `to` until it is receipted, subscribed at
        present or not.

        `to` is the subscriber, not the conversation: a renewed subscription gets what is due.
        `last`: it is sent when every other one due is receipted, so a subscriber that has it has
        the others, whatever was lost on the way.
        """
        if not subject or not subject.isascii() or not subject.isprintable() or " " in subject:
            raise self._error(
                f"observed subject {subject!r}", "a subject is printable ASCII without blanks"
            )
        if not any(link.peer == to and link.delivery is _LATEST for link in self._wiring.links):
            raise self._error(
                f"observed for {to!r}",
                "only a peer with a latest-value subscription is owed observations",
            )
        language = self._wiring.language(content)
        self._state.counter += 1
        version = (self._state.incarnation, self._state.counter)
        due = Due(version, language.name, language.encode(content), last)
        streams.observed(self._state, self._out, to, subject, due, self.now)
        if not (last and streams.last_waits(self._state, to)):
            state = self._state
            streams.send_observation(state, self._out, self._wiring, to, subject, due, self.now)

    @property
    def due(self) -> tuple[tuple[str, str], ...]:
        """(subscriber, subject) of every unreceipted observation; the event Settled reports the
        last receipt.
        """
        return tuple((peer, subject) for peer, due in self._state.due.items() for subject in due)

    # --- the own side -----------------------------------------------------------------------------

    def tell(self, content: Any) -> None:
        """Hand a Struct to the agent's own devices (worker, loop, HTTP), after the record is on the
        disk. GuestSays is said in a use of an included system.
        """
        self._out.tells.append(content)
        if isinstance(content, GuestSays):
            self._out.said.append((content.use, content.act, _PLAIN))

    def wake(self, name: str, at: float) -> None:
        """Raise Woken(name) at `at` [unix s]; a second call with the name moves it. It survives a
        death.
        """
        self._state.wakes[name] = at

    def unwake(self, name: str) -> None:
        self._state.wakes.pop(name, None)

    def keep(self) -> None:
        """Ask for a journal record of this step, though nothing durable happened in it."""
        self._out.durable = True

    def log(self, event: str, level: str = "info", **fields: Any) -> None:
        """Write one structured line; the conversation of the present event goes with it unless
        another is given.
        """
        self._out.log(event, level, **({"conversation": conversation_of(self.event)} | fields))

    def count(self, what: str) -> None:
        self._state.count(what)

    def parameter(self, name: str, kind: type[V]) -> V:
        """Value of a parameter of the design now: as the operator set it, else its default.

        `kind`: int, float, str or bool, as the design's type is integer, number, text or boolean.
        """
        found = self._state.soft.parameters
        if name not in found:
            raise self._error(
                f"parameter {name!r} is not in the design",
                f"there are {', '.join(found) or 'none'}",
            )
        value = found[name]
        if type(value) is not kind:
            raise self._error(
                f"parameter {name!r} was read as {kind.__name__}", f"it is {type(value).__name__}"
            )
        return value

    @property
    def me(self) -> str:
        return self._state.agent

    @property
    def incarnation(self) -> int:
        """Boot counter of this agent."""
        return self._state.incarnation

    @property
    def peers(self) -> Mapping[str, int]:
        """The incarnation of every peer that is known to be alive."""
        return self._state.soft.peers

    # ----------------------------------------------------------------------------------------------

    def _open(
        self,
        name: str,
        to: str,
        protocol: str,
        performative: Performative,
        content: Any,
        reply_by_s: float | None,
        parent: str,
        *,
        several: bool = False,
    ) -> Conversation:
        if parent:
            self._out.parents.append((name, parent))
        link = self._wiring.required(to, protocol)
        talk = Conversation.open(protocol, _INITIATOR, id=name, me=self._state.agent, peer=to)
        reply_by = None if reply_by_s is None else self.now + reply_by_s
        if reply_by is None:
            self._out.unlimited.append(link.use)
        held = Held(talk, link.delivery, reply_by=reply_by, several=several)
        return self._speak(held, link, performative, content, reply_by=reply_by)

    def _speak(
        self,
        held: Held,
        link: Link,
        performative: Performative,
        content: Any,
        *,
        in_reply_to: str | None = None,
        kind: Kind | None = None,
        reply_by: float | None = None,
    ) -> Conversation:
        language, name = (None, "") if content is None else self._wiring.spoken(content)
        link.require_said(performative, name)
        if kind is None:
            kind = _PLAIN if language is None else language.kind(content)
        talk, communicate = held.conversation.send(
            performative,
            id=streams.next_id(self._state, link.peer, link.delivery is _DURABLE),
            now=self.now,
            content=None if language is None else language.encode(content, performative),
            language=link.silent if language is None else language.name,
            ontology=link.ontology,
            kind=kind,
            in_reply_to=in_reply_to,
            reply_by=reply_by,
        )
        use_kind = held.conversation.kind_of(performative, communicate.in_reply_to, kind)
        self._out.said.append((link.use, performative, use_kind))
        state, out = self._state, self._out
        dispatch(state, out, self._wiring, replace(held, conversation=talk), communicate, self.now)
        return talk

    def _held(self, conversation: str, to: str = "", did: str = "") -> Held:
        held = self._state.held(conversation, to)
        if held is None:
            known = ", ".join(talk.id for talk in self.conversations()) or "none"
            raise self._error(
                f"{did}conversation {conversation!r} is not open",
                f"open are {known}; ask turn.holds() first",
            )
        return held

    def _error(self, what: str, hint: str) -> BehaviourError:
        return BehaviourError(self._state.agent, self._state.state, what, hint)


def conversation_of(event: Seen | None) -> str:
    """The conversation an event belongs to; "" where there is none."""
    return event.conversation if isinstance(event, _OF_A_TALK) else ""


def dispatch(
    state: CoreState, out: Out, wiring: Wiring, held: Held, communicate: Communicate, now: float
) -> None:
    """Keep the conversation and send its newest communicate as its delivery demands."""
    talk = held.conversation
    if held.delivery is _DURABLE:
        streams.issue(state, out, communicate, now)
    elif talk.role is _INITIATOR and not talk.ended:
        streams.ask(state, out, communicate, now)
    # it was answered before: nobody asks again, so it is said again
    elif talk.ended and held.answer is not None:
        streams.say_last(state, out, communicate, now)
    else:
        if not talk.ended:  # an ended one is forgotten, and its answer with it
            held = replace(held, answer=communicate)
        streams.send(state, out, communicate)
    state.keep(held)
    if held.delivery is _LATEST and talk.role is _PARTICIPANT and talk.state in talk.table.resting:
        streams.send_due(state, out, wiring, talk.peer, now)
