"""A design's guest that stands for the agents of other FIPA platforms: their ACL messages become
its conversations, and each answer an ACL message to whoever asked.

The name table (whose conversation is which of ours, and under which labels) and the answers that
are not delivered are in a journal, written before anything is said. So a gateway that was killed
goes on: it has the agents say again what it missed (agent_runtime.io.guests), and never says an
opening twice, since that may have been done. The names that foreign agents give prove nothing: all
of them have the rights of one guest. Must not know: sockets, what is asked for.
"""

import asyncio
import re
import threading
import time
from collections import deque
from collections.abc import Callable, Coroutine, Sequence
from functools import partial
from typing import Any, NamedTuple, Protocol

import msgspec
from msgspec.structs import replace

from agent_runtime.io.guests import MOST_OPEN, Answer, Visit
from agent_runtime.io.journal import Journal
from fipa_codec.acl_string import AclMessage, Aid, At, from_acl, parse, render, render_aid, to_acl
from fipa_codec.envelope import Envelope, pack, unpack
from fipa_codec.errors import FipaError, RemoteProtocolError
from fipa_codec.languages import REASON, Kind, Languages, Reason
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import Profile
from operate.guests.fipa_http import AddressError, Reply
from operate.guests.hosting import STOP
from topdown.model.design import Design
from topdown.model.elements import GuestUse

ANSWER_S = 15.0
"""Longest wait for an agent's first word; estimate, as of errands."""
LOOK_S = 10.0
"""Between two looks for what agents said and was not heard (estimate)."""
GIVE_UP_S = 60.0
"""Nobody is tried for longer: its conversations are cancelled (estimate: a platform starts again
within seconds).
"""
FIRST_TRY_S, LAST_TRY_S = 0.5, 8.0
"""Pause after the first failed try, and the longest one (estimates)."""
MOST_BYTES = 8 * 1024 * 1024
"""Answers that wait; whose answer does not fit is given up. Estimate: two of the largest."""
PAST = 256
"""Ended conversations whose opening is recognised when it is posted again (estimate)."""
POSTS_OF_AN_OPENING = 4
"""Messages a minute are taken for each opening that the design allows; estimate: opening, cancel,
two that are wrong.
"""
UNANSWERED = frozenset({P.NOT_UNDERSTOOD, P.FAILURE, P.REFUSE, P.AGREE, P.INFORM, P.CONFIRM})
"""Acts that open nothing. They are never answered: two agents could do so for ever."""
AMS = "ams"
Told = Callable[..., None]
"""Gets an event and its fields."""


class Outlet(Protocol):
    """How messages leave (operate.guests.fipa_http.Poster)."""

    async def usable(self, addresses: Sequence[str]) -> tuple[str, ...]:
        """Those to which something may be posted. Raise AddressError."""

    async def post(self, addresses: Sequence[str], what: str, body: bytes) -> None:
        """Raise OSError where no address takes it."""


# --- what is in the journal -----------------------------------------------------------------------


class Talk(msgspec.Struct):
    """A conversation under its names here and there: a row of the name table.

    `name`: of ours. `to`: who gets the answers, and where. `protocol`, `conversation`, `label`: as
    the peer named them. `cancel`: the label of its cancel, None while there is none. `told`: ids of
    the words that were passed on; `heard`: whether the agent said anything. `gone`: the peer is
    lost, and nothing is passed on any more.
    """

    name: str
    use: str
    agent: str
    act: P
    peer: str
    to: Aid
    protocol: str | None
    conversation: str
    label: str | None
    since: float
    cancel: str | None = None
    told: tuple[str, ...] = ()
    heard: bool = False
    gone: bool = False

    @property
    def key(self) -> tuple[str, str, str]:
        """By whom it was opened, under which name, with which agent."""
        return self.peer, self.conversation, self.agent


class Letter(msgspec.Struct, frozen=True):
    """A message on its way. `text`: of ACL; `talk`: our conversation, "" for none."""

    sender: Aid
    to: Aid
    text: bytes
    talk: str
    since: float


class Table(msgspec.Struct):
    """All that a gateway knows. `past`: ended conversations, and the label of each opening."""

    talks: dict[str, Talk] = {}
    letters: list[Letter] = []
    past: list[tuple[tuple[str, str, str], str | None]] = []


# --- the gateway ----------------------------------------------------------------------------------


class Rights(NamedTuple):
    """What a gateway may do for its guest. `agreed`: whoever started it agrees to all that a person
    has to agree to. `stop` stops the robot, and says what came of it.
    """

    guest: str
    agreed: bool
    stop: Callable[[], str]


class Gateway:
    """Made and used in one event loop; agents' words come on Zenoh's threads."""

    def __init__(
        self,
        design: Design,
        languages: Languages,
        rights: Rights,
        visit: Visit,
        outlet: Outlet,
        journal: Journal,
        platform: str,
        address: str,
        told: Told,
        now: Callable[[], float] = time.time,
    ) -> None:
        """`platform`: its name behind the @ of ours; `address`: where it takes messages."""
        self._design, self._languages, self._rights = design, languages, rights
        self._visit, self._outlet, self._journal = visit, outlet, journal
        self._told, self._now = told, now
        self._loop = asyncio.get_running_loop()
        self._tasks, self._closed = set[asyncio.Task[None]](), False
        self._carried = set[str]()
        self._lock = threading.RLock()
        self.guest = design.guests[rights.guest]
        self._posts = deque[float]()
        self._own: dict[str, Callable[[AclMessage], None]] = {}
        self.names = {
            use.agent: Aid(f"{use.agent}@{platform}", (address,)) for use in self.guest.use
        }
        self._uses = {
            (use.agent, design.guest_uses[use.name].follows): use for use in self.guest.use
        }
        self._agents = {aid.name: agent for agent, aid in self.names.items()}
        self._ams = Aid(f"{AMS}@{platform}", (address,))
        last = journal.last
        self._table = msgspec.msgpack.decode(last, type=Table) if last else Table()

    def begin(self) -> None:
        """Go on with what is in the journal."""
        with self._lock:
            for talk in self._table.talks.values():
                on_answer = partial(self._heard, talk.name)
                self._visit.resume(talk.use, talk.act, None, on_answer, talk.name)
                if talk.cancel is not None:
                    self._visit.cancel(talk.name, again=True)
            left = {letter.to.name for letter in self._table.letters}
            count = len(self._table.talks)
        self._visit.missed()
        if count or left:
            self._told("goes on", conversations=count, waiting=len(left))
        for name in left:
            self._carry(name)
        self._run(self._look())

    async def close(self) -> None:
        """Leave; what goes on is in the journal."""
        with self._lock:
            self._closed = True
        for task in tuple(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self._journal.close()

    @property
    def open(self) -> int:
        """Conversations that go on."""
        return len(self._table.talks)

    # --- in: what is posted -----------------------------------------------------------------------

    async def receive(self, what: str, body: bytes) -> Reply:
        """Take what was posted. 200: it was received, which says nothing of what it asks for."""
        try:
            envelope, text = unpack(what, body)
            message = parse(text)
        except FipaError as error:
            if not self._taken():
                return _too_many()
            self._told("not read", why=str(error))
            return Reply(400, str(error))
        sender = message.sender or envelope.sender
        message, stops = replace(message, sender=sender), _stops(message)
        if not stops and not self._taken():
            return _too_many()
        try:
            to = await self._answers_to(envelope, message)
        except AddressError as error:
            self._told("no address", peer=sender.name, why=str(error))
            to = None
        if stops:
            await asyncio.to_thread(self._stop, message, to)
            return Reply(200)
        if to is None and message.performative not in UNANSWERED:
            return Reply(403, "no address of the sender may be answered to; see the gateway's log")
        try:
            await asyncio.to_thread(self._take, envelope, message, to or sender)
        except OSError as error:  # of the journal: what is not in it is not done
            self._told("journal", why=str(error))
            return Reply(503, "the journal takes nothing now")
        return Reply(200)

    def _taken(self) -> bool:
        """Whether one more message is taken within this minute."""
        now, most = self._now(), self.guest.each_minute * POSTS_OF_AN_OPENING
        while self._posts and self._posts[0] <= now - 60.0:
            self._posts.popleft()
        if len(self._posts) >= most:
            return False
        self._posts.append(now)
        return True

    async def _answers_to(self, envelope: Envelope, message: AclMessage) -> Aid:
        """Whom answers go to, with the addresses that may be used. Raise AddressError."""
        sender = message.sender or envelope.sender
        to = message.reply_to[0] if message.reply_to else sender
        addresses = to.addresses or (
            envelope.sender.addresses if to.name == envelope.sender.name else ()
        )
        return Aid(to.name, await self._outlet.usable(addresses))

    def _take(self, envelope: Envelope, message: AclMessage, to: Aid) -> None:
        for receiver in envelope.receivers:
            with self._lock:
                self._of_one(receiver, message, to)

    def _of_one(self, receiver: Aid, message: AclMessage, to: Aid) -> None:
        """One receiver's copy of a message. Raise OSError of the journal."""
        agent = self._agents.get(receiver.name)
        if own := self._own.get(message.conversation_id or ""):
            own(message)
            return
        if agent is None:
            if message.performative not in UNANSWERED:
                why = f"no agent {receiver.name} is here; there are {', '.join(self._agents)}"
                content = mts_error(to, receiver, why)
                words = {"content": content, "language": "fipa-sl"}
                self._say(message, self._ams, to, P.FAILURE, words)
            return
        peer = message.sender.name if message.sender else ""
        here = (peer, message.conversation_id or "", agent)
        talk = next((one for one in self._table.talks.values() if one.key == here), None)
        act = message.performative
        if act is P.CANCEL:
            self._cancel(talk, message, to, agent)
        elif act is P.FAILURE and (lost := lost_receiver(message)) is not None:
            self._mts_error((lost, *here[1:]))
        elif act in UNANSWERED:
            if talk is not None and act is P.NOT_UNDERSTOOD:
                self._give_up(talk, f"{peer} did not understand an answer")
        else:
            self._open(talk, message, to, agent)

    # --- openings ---------------------------------------------------------------------------------

    def _open(self, talk: Talk | None, message: AclMessage, to: Aid, agent: str) -> None:
        """Journal it, then have it asked. Raise OSError."""
        here = (message.sender.name if message.sender else "", message.conversation_id or "", agent)
        again = talk.label if talk else dict(self._table.past).get(here, False)
        if again is not False and again == message.reply_with:
            self._told("posted again", peer=here[0], conversation=here[1])
            return  # its answer comes, or went: it is never asked twice
        if talk is not None:
            self._reason(message, agent, to, P.NOT_UNDERSTOOD, "this conversation goes on already")
            return
        try:
            use, content = self._content(message, agent)
        except FipaError as error:
            self._reason(message, agent, to, P.NOT_UNDERSTOOD, str(error))
            return
        if use.consent and not self._rights.agreed:
            why = "a person must agree to this, and nobody did; see docs/jade.md"
            self._reason(message, agent, to, P.REFUSE, why)
            return
        if len(self._table.talks) >= MOST_OPEN * len(self.names):
            self._reason(message, agent, to, P.REFUSE, "too many conversations are open; end one")
            return
        name = self._visit.new_name()
        self._table.talks[name] = talk = Talk(
            name, use.name, agent, message.performative, here[0], to, message.protocol, here[1],
            message.reply_with, self._now(),
        )  # fmt: skip
        try:
            self._save()
        except OSError:
            del self._table.talks[name]
            raise
        self._told("opened", peer=here[0], conversation=here[1], receiver=agent, name=name)
        on_answer = partial(self._heard, name)
        try:
            self._visit.ask(use.name, message.performative, content, on_answer, name)
        except FipaError as error:  # it is too long, say
            self._reason(message, agent, to, P.NOT_UNDERSTOOD, str(error))
            self._end(talk)

    def _content(self, message: AclMessage, agent: str) -> tuple[GuestUse, Any]:
        """The use, and what is asked for in it. Raise FipaError. JADE's createReply has no
        `:encoding`, so it is the language that tells that content is JSON. The door of the agent
        judges the rest.
        """
        if message.encoding is None and message.language in self._languages.names:
            message = replace(message, encoding="json")
        # names and labels of others stay here: they may be longer than ours
        bare = AclMessage(
            performative=message.performative,
            content=message.content,
            language=message.language,
            encoding=message.encoding,
            protocol=message.protocol,
            user=message.user,
        )
        one = from_acl(bare, self._now(), profile=Profile.PAPER)
        opens = self._acts(agent, one.protocol) - {P.CANCEL, P.NOT_UNDERSTOOD}
        for field, given, wanted in (
            ("protocol", one.protocol, [follows for to, follows in self._uses if to == agent]),
            ("performative", one.performative, opens),
        ):
            if given not in wanted:
                raise RemoteProtocolError(field, f"is {given}; {agent} takes {', '.join(wanted)}")
        if not message.conversation_id:
            raise RemoteProtocolError("conversation-id", "is absent, so nothing can be answered")
        return self._uses[agent, one.protocol], self._languages.read(one)[0]

    def _acts(self, agent: str, follows: str) -> frozenset[P]:
        """What the guest may say to an agent in a protocol."""
        return self._design.allowed(self.guest.name, agent, follows)

    def _cancel(self, talk: Talk | None, message: AclMessage, to: Aid, agent: str) -> None:
        if talk is None:
            why = "no such conversation goes on here"
            self._reason(message, agent, to, P.FAILURE, why)
            return
        if talk.cancel is not None:
            return  # posted again
        if P.CANCEL not in self._acts(agent, self._design.guest_uses[talk.use].follows):
            self._reason(message, agent, to, P.FAILURE, "this has no cancel: its answer comes")
            return
        talk.cancel = message.reply_with or ""
        self._kept()  # also where the disk is full: the robot is to stop
        self._visit.cancel(talk.name)

    # --- out: what agents say ---------------------------------------------------------------------

    def _heard(self, name: str, answer: Answer) -> None:
        with self._lock:
            talk = self._table.talks.get(name)
            if talk is None or self._closed:  # the agent says it again to the next life
                return
            talk.heard = True
            said = answer.said
            if said is None:
                self._lost(talk, answer)
            elif said.id not in talk.told and not _progress(answer):
                talk.told = (*talk.told, said.id)
                self._pass_on(talk, to_acl(said, profile=Profile.PAPER), answer.cancelled)
            if answer.ended:
                self._end(talk)

    def _lost(self, talk: Talk, answer: Answer) -> None:
        """The agent knows nothing of it: the peer hears so, in answer to all that it asked."""
        for cancelled in (False, True) if talk.cancel is not None else (False,):
            self._pass_on(talk, _reasoned(P.FAILURE, answer.content.text), cancelled)

    def _pass_on(self, talk: Talk, message: AclMessage, cancelled: bool) -> None:
        if talk.gone:
            return
        sender = self.names[talk.agent]
        message = replace(
            message,
            sender=sender,
            receiver=(talk.to,),
            protocol=talk.protocol,
            conversation_id=talk.conversation,
            reply_with=None,
            in_reply_to=(talk.cancel if cancelled else talk.label) or None,
        )
        self._post(sender, talk.to, message, talk.name)

    def _end(self, talk: Talk) -> None:
        """It is over: its opening is recognised for a while."""
        self._table.talks.pop(talk.name, None)
        self._table.past = [*self._table.past, (talk.key, talk.label)][-PAST:]
        self._visit.forget(talk.name)
        self._kept()

    def _give_up(self, talk: Talk, why: str) -> None:
        """The peer is lost: the agent is to cancel, and nothing is passed on any more."""
        self._told("peer lost", peer=talk.peer, conversation=talk.conversation, why=why)
        talk.gone = True
        if talk.cancel is None:
            talk.cancel = ""
            if not self._visit.cancel(talk.name):
                self._end(talk)
        self._kept()

    def _mts_error(self, key: tuple[str, str, str]) -> None:
        """A platform says that it has no such agent: the conversation is that one's, not the
        AMS's.
        """
        for talk in tuple(self._table.talks.values()):
            if talk.key == key or (talk.to.name, *talk.key[1:]) == key:
                self._give_up(talk, "its platform has no such agent")

    def _stop(self, message: AclMessage, to: Aid | None) -> None:
        """Stop the robot; the sender hears of it, if it has an address."""
        try:
            act, text = P.INFORM, self._rights.stop()
        except Exception as error:  # whatever it is, the peer must hear of it
            act, text = P.FAILURE, f"the robot was not stopped: {error}"
        self._told("stop", peer=message.sender.name if message.sender else "", what=text)
        if to is not None:
            with self._lock:
                agent = next(iter(self.names))
                self._reason(message, agent, to, act, text)

    def _reason(self, message: AclMessage, agent: str, to: Aid, act: P, why: str) -> None:
        """Answer a message that is not of a conversation with an agent."""
        self._told(str(act), peer=to.name, conversation=message.conversation_id or "", why=why)
        fields = {n: getattr(_reasoned(act, why), n) for n in ("content", "language", "encoding")}
        self._say(message, self.names[agent], to, act, fields)

    def _say(
        self, to_this: AclMessage, sender: Aid, to: Aid, act: P, words: dict[str, Any]
    ) -> None:
        answer = AclMessage(
            performative=act,
            sender=sender,
            receiver=(to,),
            protocol=to_this.protocol,
            conversation_id=to_this.conversation_id,
            in_reply_to=to_this.reply_with,
            **words,
        )
        self._post(sender, to, answer, "")

    # --- the post ---------------------------------------------------------------------------------

    def ask(self, to: Aid, message: AclMessage, answered: Callable[[AclMessage], None]) -> None:
        """Ask somebody of another platform for ourselves; `answered` gets each answer."""
        with self._lock:
            assert message.sender is not None
            self._own[message.conversation_id or ""] = answered
            self._post(message.sender, to, message, "")

    def _post(self, sender: Aid, to: Aid, message: AclMessage, talk: str) -> None:
        """Journal a message, then have it carried."""
        try:
            letter = Letter(sender, to, render(message), talk, self._now())
            self._packed(letter)
        except FipaError as error:
            self._told("not written", peer=to.name, why=str(error))
            return
        size = sum(len(one.text) for one in self._table.letters)
        if size + len(letter.text) > MOST_BYTES:
            self._undelivered(to.name, "too many answers wait")
            return
        self._table.letters.append(letter)
        self._kept()
        self._loop.call_soon_threadsafe(self._carry, to.name)

    def _carry(self, name: str) -> None:
        """Deliver what there is for one agent, in order."""
        if name not in self._carried:
            self._carried.add(name)
            self._run(self._delivered(name))

    async def _delivered(self, name: str) -> None:
        pause = FIRST_TRY_S
        try:
            while (letter := self._next(name)) is not None:
                try:
                    await self._outlet.post(letter.to.addresses, *self._packed(letter))
                except OSError as error:
                    if self._now() > letter.since + GIVE_UP_S:
                        self._undelivered(name, str(error))
                        continue
                    self._told("not delivered yet", peer=name, why=str(error))
                    await asyncio.sleep(pause)
                    pause = min(2 * pause, LAST_TRY_S)
                else:
                    pause = FIRST_TRY_S
                    with self._lock:
                        if letter in self._table.letters:
                            self._table.letters.remove(letter)
                        self._kept()
        finally:
            self._carried.discard(name)

    def _next(self, name: str) -> Letter | None:
        with self._lock:
            return next((one for one in self._table.letters if one.to.name == name), None)

    def _packed(self, letter: Letter) -> tuple[str, bytes]:
        to, date = (letter.to,), At(int(letter.since * 1000))
        return pack(Envelope(to=to, sender=letter.sender, intended=to, date=date), letter.text)

    def _undelivered(self, name: str, why: str) -> None:
        """Nobody takes what is for this agent: it is dropped, and its conversations end."""
        with self._lock:
            letters = [one for one in self._table.letters if one.to.name == name]
            self._table.letters = [one for one in self._table.letters if one.to.name != name]
            self._told("undelivered", peer=name, messages=len(letters), why=why)
            for talk in tuple(self._table.talks.values()):
                if talk.to.name == name and not talk.gone:
                    self._give_up(talk, why)
            self._kept()

    # --- what goes on -----------------------------------------------------------------------------

    async def _look(self) -> None:
        """Have agents say again what was not heard; give up those that say nothing."""
        while True:
            await asyncio.sleep(LOOK_S)
            await asyncio.to_thread(self.look)

    def look(self) -> None:
        """Once."""
        with self._lock:
            for talk in tuple(self._table.talks.values()):
                if not talk.heard and self._now() > talk.since + ANSWER_S:
                    self._visit.cancel(talk.name)
                    why = f"{talk.agent} does not answer within {ANSWER_S:g} s"
                    self._pass_on(talk, _reasoned(P.FAILURE, why), False)
                    self._end(talk)
        self._visit.missed()

    def _run(self, work: Coroutine[Any, Any, None]) -> None:
        task = self._loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _save(self) -> None:
        """Raise OSError where the disk does not take it."""
        self._journal.append(msgspec.msgpack.encode(self._table))

    def _kept(self) -> None:
        """Save; on a full disk the answer goes out all the same, and perhaps twice."""
        try:
            self._save()
        except OSError as error:
            self._told("journal", why=str(error))


# --- words ----------------------------------------------------------------------------------------


def _progress(answer: Answer) -> bool:
    """Whether it is told on the way. For JADE the first inform of a request is its result, so it
    gets none of these.
    """
    return answer.performative is P.INFORM and answer.kind is Kind.PROGRESS and not answer.cancelled


def _too_many() -> Reply:
    return Reply(429, "too many messages within a minute; try again later")


def _reasoned(act: P, why: str) -> AclMessage:
    content = msgspec.json.encode(Reason(why)).decode()
    return AclMessage(performative=act, content=content, language=REASON.name, encoding="json")


def _stops(message: AclMessage) -> bool:
    """Whether a message stops the robot: any request for just that, in whatever language."""
    content = message.content if isinstance(message.content, str) else ""
    word = content.strip("()\"' \t\r\n.!").casefold()
    return message.performative is P.REQUEST and word == STOP


def mts_error(sender: Aid, lost: Aid, why: str) -> str:
    """What an AMS says of a message that cannot be delivered (SC00023K): as JADE's does."""
    quoted = why.replace('"', "'")
    return (
        f"((action {render_aid(sender)} (ACLMessage)) (MTS-error {render_aid(lost)}"
        f' (internal-error "{quoted}")))'
    )


_LOST = re.compile(
    r'\(\s*MTS-error\s*\(\s*agent-identifier\s+:name\s+(?:"([^"]+)"|([^\s()"]+))', re.IGNORECASE
)


def lost_receiver(message: AclMessage) -> str | None:
    """The name of the receiver that an AMS does not find; None for another message. An AMS may say
    so of agents of its own platform.
    """
    found = _LOST.search(message.content) if isinstance(message.content, str) else None
    name, _, platform = (message.sender.name if message.sender else "").partition("@")
    lost = (found[1] or found[2]) if found else ""
    if name != AMS or lost.partition("@")[2] != platform:
        return None
    return lost
