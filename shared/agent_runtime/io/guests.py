"""Guests of a design (topdown.model.elements.Guest): the door at which an agent's process takes
their words, and the visit of a program that is a guest.

Both hold conversations by the tables that agents follow. A guest's words are no messages to the
agent: the door judges each by the rules of the design, answers what must not be, and hands the
rest to a device of the agent. It numbers nothing; the design's rights bind a guest to its name,
and a recorder hears both sides at the router. Must not know: what is asked for.

A guest that writes the signal `missed` may have been away: the door keeps what it told that guest,
within bounds, and says it again on the signal `resaid`. That is no communicate: each was judged
when it was said. What the guest says is never said again, since it may have been done.
"""

import secrets
import threading
import time
from collections import OrderedDict, deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any, NamedTuple

import msgspec
import zenoh

from agent_runtime.core.wiring import communicate_key
from agent_runtime.io.devices import Post
from agent_runtime.io.sessions import close, open_client, put
from fipa_codec.communicate import Communicate, decode_strictly, encode
from fipa_codec.conversation import Conversation
from fipa_codec.errors import FipaError
from fipa_codec.languages import REASON, Kind, Languages, Reason
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import Role
from topdown.judge.verdicts import Admission
from topdown.model.design import Design

MINUTE_S = 60.0
MOST_OPEN = 64
"""Conversations of a guest with one agent; estimate: a person has a few under way."""
MISSED, RESAID = "missed", "resaid"
"""Signals of a design by which a guest asks for what it was told, and gets it."""
KEPT_WORDS = 32
"""Words of a conversation that are kept: the first one and the newest. Estimate: a task has ten."""
KEPT_BYTES = 4 * 1024 * 1024
"""Words that a door keeps in all; estimate: some hundred tasks, or four answers of the largest."""
KEPT_S = 600.0
"""An ended conversation is kept so long; estimate: whoever restarts a guest takes minutes."""


class Had(msgspec.Struct, frozen=True):
    """A conversation of a guest, the id of the last word that it heard there ("" for none), and
    whether it cancelled it.
    """

    conversation: str
    last: str = ""
    cancelled: bool = False


class Missed(msgspec.Struct, frozen=True):
    """What a guest asks an agent on the signal `missed`."""

    guest: str
    had: tuple[Had, ...]


class Resaid(msgspec.Struct, frozen=True):
    """What an agent answers on the signal `resaid`: words as they were sent, in their order; the
    conversations of which it knows nothing, since it began anew or never got the opening; those
    that go on, since it never got the cancel.
    """

    words: tuple[bytes, ...] = ()
    unknown: tuple[str, ...] = ()
    uncancelled: tuple[str, ...] = ()


class Words:
    """What a door told guests that may ask again. The oldest conversation that has ended goes
    first.
    """

    def __init__(self) -> None:
        self._said: OrderedDict[str, list[tuple[str, bytes]]] = OrderedDict()
        self._over: dict[str, float] = {}  # conversation that has ended -> when
        self._size = 0

    def keep(self, name: str, one: Communicate, ended: bool, now: float) -> None:
        """Keep a word of a conversation. `now` [unix s]."""
        words, data = self._said.setdefault(name, []), encode(one)
        words.append((one.id, data))
        self._size += len(data)
        if len(words) > KEPT_WORDS:
            self._size -= len(words.pop(1)[1])
        if ended:
            self._over[name] = now
        for old, at in tuple(self._over.items()):
            if at < now - KEPT_S or (self._size > KEPT_BYTES and old != name):
                self._forget(old)
        while self._size > KEPT_BYTES and len(self._said) > 1:
            self._forget(next(iter(self._said)))

    def after(self, name: str, last: str) -> list[bytes] | None:
        """The words behind one, all where that is not known; None: of no such conversation."""
        if name not in self._said:
            return None
        words = self._said[name]
        begin = next((n for n, (id, _) in enumerate(words, 1) if id == last), 0)
        return [data for _, data in words[begin:]]

    def _forget(self, name: str) -> None:
        self._size -= sum(len(data) for _, data in self._said.pop(name))
        self._over.pop(name, None)


SEEN_S = 1.0
"""Wait for the token of an agent that lives (estimate: it takes milliseconds)."""

# --- At the agent ---------------------------------------------------------------------------------


class Asked(NamedTuple):
    """A guest opened a conversation, or cancels one: its name, the guest, what it wants (None: the
    cancel).
    """

    conversation: str
    guest: str
    content: Any


class Door:
    """Takes the words of the guests of one agent.

    `on_asked` gets what is as designed, on Zenoh's threads, one at a time.
    """

    def __init__(
        self,
        design: Design,
        languages: Languages,
        agent: str,
        post: Post,
        on_asked: Callable[[Asked], None],
        now: Callable[[], float] = time.time,
    ) -> None:
        self._design, self._languages, self._agent = design, languages, agent
        self._post, self._on_asked, self._now = post, on_asked, now
        self._admission = Admission(design, languages)
        self._talks: dict[str, Conversation] = {}
        self._opened: dict[str, deque[float]] = {name: deque() for name in design.guests}
        self._numbers = 0
        self._lock = threading.RLock()
        missed = design.signals.get(MISSED)
        self._keeps = {who for who, to in missed.reach if to == agent} if missed else set()
        self._words, self._looked = Words(), dict[str, deque[float]]()
        post.hear_guests(self._heard)
        if self._keeps:
            post.hear(MISSED, self._missed)

    def say(
        self, conversation: str, performative: P, content: Any, kind: Kind = Kind.PLAIN
    ) -> bool:
        """Say something to the guest of a conversation. Return whether its table allows that."""
        with self._lock:
            talk = self._talks.get(conversation)
            if talk is None:
                return False
            try:
                talk, said = self._said(talk, performative, content, kind)
            except FipaError:
                return False
            self._keep(conversation, talk)
            self._remember(said, talk)
        self._post.say_to_guest(said)
        return True

    def cancelling(self, conversation: str) -> bool:
        """Whether the guest waits for the end of its cancel."""
        talk = self._talks.get(conversation)
        return talk is not None and bool(talk.cancel)

    def _said(
        self, talk: Conversation, performative: P, content: Any, kind: Kind
    ) -> tuple[Conversation, Communicate]:
        use = self._design.guest_use(talk.peer, talk.me, talk.protocol)
        reason = isinstance(content, Reason)
        language = REASON if reason else self._languages.named(use.message[0].language)
        self._numbers += 1
        return talk.send(
            performative,
            id=f"{talk.me}-{self._numbers}",
            now=self._now(),
            content=language.encode(content, performative),
            language=language.name,
            ontology="" if performative is P.NOT_UNDERSTOOD else use.ontology,
            kind=kind,
        )

    def _keep(self, name: str, talk: Conversation) -> None:
        if talk.ended:
            self._talks.pop(name, None)
        else:
            self._talks[name] = talk

    def _heard(self, key: str, data: bytes) -> None:
        with self._lock, suppress(FipaError):  # what cannot be read, nobody can answer
            one = decode_strictly(data)
            admitted = self._admission.check(key, one, len(data))
            if admitted.rule is None or one.receiver != self._agent:
                return
            # a guest chooses names of conversations: those of another one are none of its business
            name = f"{one.sender}/{one.conversation}"
            talk = self._talks.get(name)
            opens = talk is None
            talk = talk or Conversation.answering(one, self._agent)
            talk = talk.receive(one)
            wrong = "; ".join(fault.why for fault in admitted.faults)
            if wrong:
                self._refuse(talk, P.NOT_UNDERSTOOD, wrong)
                return
            if not opens:
                self._keep(name, talk)
                if one.performative is P.CANCEL:
                    self._on_asked(Asked(name, one.sender, None))
                return
            if talk.owes or talk.ended:  # a cancel that came too late
                self._refuse(talk, P.FAILURE, "it is over already", Kind.CANCEL)
                return
            content = self._languages.read(one)[0]
            if why := self._unwanted(one.sender, content):
                self._refuse(talk, P.REFUSE, why)
                return
            self._talks[name] = talk
            self._on_asked(Asked(name, one.sender, content))

    def _refuse(self, talk: Conversation, act: P, why: str, kind: Kind = Kind.PLAIN) -> None:
        talk, said = self._said(talk, act, Reason(why), kind)
        self._remember(said, talk)
        self._post.say_to_guest(said)

    def _remember(self, said: Communicate, talk: Conversation) -> None:
        if said.receiver in self._keeps:
            name = f"{said.receiver}/{said.conversation}"
            self._words.keep(name, said, talk.ended, self._now())

    def _missed(self, data: bytes) -> None:
        """Say again what a guest missed, as often as it may open conversations."""
        with self._lock, suppress(msgspec.MsgspecError):
            asks = msgspec.msgpack.decode(data, type=Missed)
            if asks.guest not in self._keeps or len(asks.had) > MOST_OPEN:
                return
            if not self._counted(self._looked.setdefault(asks.guest, deque()), asks.guest):
                return
            words: list[bytes] = []
            unknown: list[str] = []
            uncancelled: list[str] = []
            for one in asks.had:
                name = f"{asks.guest}/{one.conversation}"
                found, talk = self._words.after(name, one.last), self._talks.get(name)
                if found is None and talk is None:
                    unknown.append(one.conversation)
                elif one.cancelled and talk is not None and not talk.cancel:
                    uncancelled.append(one.conversation)
                words += found or ()
            told = Resaid(tuple(words), tuple(unknown), tuple(uncancelled))
            self._post.publish(RESAID, msgspec.msgpack.encode(told), asks.guest)

    def _counted(self, times: deque[float], name: str) -> bool:
        """Note a time, unless there are too many within a minute; return whether it was noted."""
        now = self._now()
        while times and times[0] <= now - MINUTE_S:
            times.popleft()
        if len(times) >= self._design.guests[name].each_minute:
            return False
        times.append(now)
        return True

    def _unwanted(self, name: str, content: Any) -> str:
        """Why a guest may not have this; "" if it may."""
        guest = self._design.guests[name]
        for field in msgspec.structs.fields(content):
            if field.name in guest.withheld and getattr(content, field.name) != field.default:
                return f"{name} may not set {field.name}"
        if sum(talk.peer == name for talk in self._talks.values()) >= MOST_OPEN:
            return f"{name} has {MOST_OPEN} conversations open; end one"
        if not self._counted(self._opened[name], name):
            return f"{name} may ask {guest.each_minute} times a minute; try again later"
        return ""


# --- At the guest ---------------------------------------------------------------------------------


class Answer(NamedTuple):
    """What an agent said in a conversation. `ended`: it was the last word; `cancelled`: it answers
    the guest's cancel. `kind`: as its language has it; `said`: the word itself, None where the
    agent knows nothing of the conversation (it began anew, or never got the opening).
    """

    performative: P
    content: Any
    ended: bool
    cancelled: bool
    kind: Kind = Kind.PLAIN
    said: Communicate | None = None


OnAnswer = Callable[[Answer], None]


class _Talk:
    """A conversation of a guest; `last`: id of the last word that it heard; `cancel`: what it said
    to cancel it.
    """

    def __init__(self, conversation: Conversation, on_answer: OnAnswer) -> None:
        self.conversation, self.on_answer = conversation, on_answer
        self.last = ""
        self.cancel: Communicate | None = None


class Visit:
    """A session of a guest at the router: it opens conversations and cancels them.

    `on_answer` of a conversation gets each word of the agent, on Zenoh's threads.
    """

    def __init__(
        self,
        design: Design,
        languages: Languages,
        guest: str,
        system: str,
        endpoint: str,
        tls: dict[str, Any] | None,
        patience_s: float = 5.0,
    ) -> None:
        """Raise OSError where no router answers in time."""
        self._design, self._languages = design, languages
        self._guest, self._system = guest, system
        self._lock = threading.RLock()
        self._talks: dict[str, _Talk] = {}
        until = time.monotonic() + patience_s
        session = open_client(endpoint, lambda: time.monotonic() > until, tls=tls)
        if session is None:
            raise OSError(f"no router answers at {endpoint}")
        self.session: zenoh.Session = session
        heard = design.keys_to(system, guest)
        self._declared: list[Any] = [session.declare_subscriber(heard, self._heard)]
        missed = design.signals.get(MISSED)
        self._may_ask = missed is not None and guest in missed.writers
        if self._may_ask:
            key = design.signal_key(RESAID, system=system, owner="*", peer=guest)
            self.hear(key, self._resaid)

    def hear(self, key: str, on_data: Callable[[bytes], None]) -> None:
        """Have `on_data` called with what is put on a key, on Zenoh's threads."""
        self._declared.append(
            self.session.declare_subscriber(key, lambda sample: on_data(sample.payload.to_bytes()))
        )

    def new_name(self) -> str:
        """A name for a conversation, as no other has."""
        return f"{self._guest}-{secrets.token_hex(6)}"

    def ask(self, use: str, act: P, content: Any, on_answer: OnAnswer, name: str = "") -> str:
        """Open a conversation of a use; its name. Raise FipaError for what the language has not."""
        name = name or self.new_name()
        self._put(
            self._design.guest_uses[use].channel, self._open(use, act, content, on_answer, name)
        )
        return name

    def resume(self, use: str, act: P, content: Any, on_answer: OnAnswer, name: str) -> None:
        """Go on with a conversation that an earlier life of this guest has opened: nothing is said.
        `missed` then brings every word of the agent, from the first.
        """
        self._open(use, act, content, on_answer, name)

    def _open(self, use: str, act: P, content: Any, on_answer: OnAnswer, name: str) -> Communicate:
        entry = self._design.guest_uses[use]
        talk = Conversation.open(
            entry.follows, Role.INITIATOR, id=name, me=self._guest, peer=entry.participant
        )
        language = self._languages.named(entry.message[0].language)
        talk, said = talk.send(
            act,
            id=f"{name}-1",
            now=time.time(),
            content=None if content is None else language.encode(content, act),
            language=language.name,
            ontology=entry.ontology,
        )
        with self._lock:
            self._talks[name] = _Talk(talk, on_answer)
        return said

    def call_off(self, use: str, conversation: str) -> None:
        """Cancel a conversation that an earlier visit opened; what becomes of it is not heard."""
        entry = self._design.guest_uses[use]
        opened = next(one for one in entry.message if one.sender == self._guest)
        self.resume(use, opened.performative, None, lambda _: None, conversation)
        self.cancel(conversation)
        self.forget(conversation)

    def lives(self, agent: str) -> str:
        """The key by which an agent says at the router that it lives, with its incarnation; "" for
        one that does not, or cannot be seen.
        """
        key = self._design.signal_key("alive", system=self._system, owner=agent)
        for reply in self.session.liveliness().get(key, timeout=SEEN_S):
            if reply.ok is not None:
                return str(reply.ok.key_expr)
        return ""

    def cancel(self, conversation: str, *, again: bool = False) -> bool:
        """Cancel a conversation, once, if it goes on and its protocol has a cancel; where it has
        none, its answer is waited for no longer. Return whether the agent is to cancel.

        `again`: an earlier life has said so; nothing is said, but `missed` finds where it got lost.
        """
        with self._lock:
            talk = self._talks.get(conversation)
            if talk is None or talk.conversation.cancel:
                return False
            here = talk.conversation
            entry = self._design.guest_use(here.me, here.peer, here.protocol)
            try:
                talk.conversation, said = here.send(
                    P.CANCEL,
                    id=f"{conversation}-2",
                    now=time.time(),
                    language=entry.message[0].language,
                )
            except FipaError:  # a query has none: its answer comes and is not wanted
                self._talks.pop(conversation)
                return False
            talk.cancel = said
        if not again:
            self._put(entry.channel, said)
        return True

    def missed(self) -> None:
        """Ask each agent of an open conversation for what was not heard, if the design has that."""
        had: dict[str, list[Had]] = {}
        with self._lock:
            if not self._may_ask:
                return
            for name, talk in self._talks.items():
                one = Had(name, talk.last, talk.cancel is not None)
                had.setdefault(talk.conversation.peer, []).append(one)
        for agent, conversations in had.items():
            key = self._design.signal_key(
                MISSED, system=self._system, owner=self._guest, peer=agent
            )
            asks = Missed(self._guest, tuple(conversations[:MOST_OPEN]))
            put(self.session, key, msgspec.msgpack.encode(asks))

    def forget(self, conversation: str) -> None:
        """Wait for no answer any more."""
        with self._lock:
            self._talks.pop(conversation, None)

    def close(self) -> None:
        """Leave."""
        close(self.session)

    def _put(self, channel: str, one: Communicate) -> None:
        key = communicate_key(
            self._system, channel, one.sender, one.receiver, one.protocol, one.performative
        )
        put(self.session, key, encode(one))

    def _heard(self, sample: zenoh.Sample) -> None:
        self._take(sample.payload.to_bytes())

    def _take(self, data: bytes) -> None:
        with suppress(FipaError):
            one = decode_strictly(data)
            with self._lock:
                talk = self._talks.get(one.conversation)
                if talk is None:
                    return
                content, kind = self._languages.read(one)
                here = talk.conversation
                cancelled = here.kind_of(one.performative, one.in_reply_to, kind) is Kind.CANCEL
                talk.conversation = here = here.receive(one, kind)
                talk.last = one.id
                if here.ended:
                    self._talks.pop(one.conversation)
            talk.on_answer(Answer(one.performative, content, here.ended, cancelled, kind, one))

    def _resaid(self, data: bytes) -> None:
        with suppress(msgspec.MsgspecError):
            told = msgspec.msgpack.decode(data, type=Resaid)
            for word in told.words:
                self._take(word)
            for name in told.uncancelled:
                with self._lock:
                    talk = self._talks.get(name)
                if talk is not None and talk.cancel is not None:
                    here = talk.conversation
                    use = self._design.guest_use(here.me, here.peer, here.protocol)
                    self._put(use.channel, talk.cancel)
            for name in told.unknown:
                with self._lock:
                    talk = self._talks.pop(name, None)
                if talk is not None:
                    agent = talk.conversation.peer
                    why = f"{agent} knows nothing of it: it began anew, or never heard of it"
                    cancelled = bool(talk.conversation.cancel)
                    talk.on_answer(Answer(P.FAILURE, Reason(why), True, cancelled))
