"""Liveness of peers, told apart from links that this agent closed itself: tokens in, PeerChanged
and LinkChanged out.

A token that vanishes is believed at once: each neighbour's comes by a link of its own. Where the
agent opens all its links again, with renewed keys, tokens come back by themselves; one that does
not within RETURN_S belongs to an agent that died meanwhile.

Believed is the highest incarnation whose token is there. Whoever has a peer's key may declare a
higher one than the peer itself: when that token is gone, the peer's own counts again. A journal's
name stays believed while a token with it is there or may come back; then the name that appeared
last is believed. Pure: time comes in as an argument.
"""

from collections.abc import Iterator, Set
from hashlib import blake2b

import msgspec

from agent_runtime.core.events import LinkChanged, Out, PeerChanged, Receipted
from agent_runtime.core.state import CoreState, Lost, Record
from agent_runtime.core.streams import forget_last, live_subscription, release
from agent_runtime.core.wiring import Delivery, Wiring
from fipa_codec.tables import Role

RETURN_S = 3.0
"""Reconnection is tried at least every 0.5 s, a cut-off peer is dropped after the lease of 2 s; a
little more.
"""
HASTE_S = 0.2
"""From one news of a peer to the next; a process takes 0.8 s to come back (measured), so only
floods wait.
"""
TOKENS = 1024
"""Tokens of a peer that are remembered; estimate: one or two are there, of others a memory is
needed.
"""


class Peers:
    """Of one agent; `known` are those it talks to. `alive`: the incarnation that is believed of
    each.
    """

    def __init__(self, known: tuple[str, ...]) -> None:
        self._known = frozenset(known)
        self.up = False
        self.alive: dict[str, int] = {}
        self._journal: dict[str, str] = {}
        self._tokens: dict[str, dict[str, set[int]]] = {}
        self._doubted: dict[str, float] = {}
        self._told: dict[str, float] = {}
        self._later: dict[str, float] = {}

    def token(
        self, agent: str, incarnation: int, alive: bool, now: float, journal: str = ""
    ) -> list[PeerChanged]:
        """A token appeared or vanished. `journal`: the name in it."""
        if agent not in self._known:
            return []
        lives = self._tokens.setdefault(agent, {})
        there = lives.get(journal, set())
        if alive and (incarnation in there or sum(map(len, lives.values())) < TOKENS):
            newest = incarnation >= max(there, default=0)
            if newest:  # this name is the one that appeared last
                lives.pop(journal, None)
            lives[journal] = there | {incarnation}
            return self._news(agent, now) if newest and journal == self._name(agent) else []
        if not alive and incarnation in there:
            there.discard(incarnation)
            if not there:
                del lives[journal]
            if (self._journal.get(agent), self.alive.get(agent)) == (
                journal,
                incarnation,
            ) and self.up:
                self._doubted.setdefault(agent, now)
        return []

    def links(self, up: bool, now: float) -> list[LinkChanged]:
        """The agent opened its links, or closed them."""
        if up == self.up:
            return []
        self.up = up
        self._doubted = dict.fromkeys(self.alive, now + RETURN_S) if up else {}
        if not up:  # all tokens come again
            self._tokens.clear()
            self._later.clear()
        return [LinkChanged(up)]

    def gone(self, now: float) -> list[PeerChanged]:
        """News that had to wait: whose token did not come back in time, and who had too much
        news.
        """
        news = []
        for agent in _due(self._later, now):
            del self._later[agent]
            news += self._settled(agent, now)
        for agent in _due(self._doubted, now):
            del self._doubted[agent]
            if self.alive[agent] not in self._tokens.get(agent, {}).get(self._journal[agent], ()):
                news += self._settled(agent, now)
        return news

    def _settled(self, agent: str, now: float) -> list[PeerChanged]:
        if self._tokens.get(agent):
            return self._news(agent, now)
        if agent not in self.alive or agent in self._doubted:
            return []
        # Its last token may have vanished while news of it had to wait: then no other look comes.
        del self.alive[agent], self._journal[agent]
        return [PeerChanged(agent, None)]

    def _news(self, agent: str, now: float) -> list[PeerChanged]:
        """Believe the highest life of the journal's name that counts, unless there was news just
        now: then later.
        """
        self._later.pop(agent, None)
        lives = self._tokens.get(agent, {})
        name = self._name(agent)
        if name is None:
            return []
        at = self._told.get(agent, now - HASTE_S) + HASTE_S
        if at > now:
            self._later[agent] = at
            return []
        self._told[agent] = now
        self._doubted.pop(agent, None)
        self._journal[agent], self.alive[agent] = name, max(lives[name])
        return [PeerChanged(agent, self.alive[agent], name)]

    def _name(self, agent: str) -> str | None:
        """The journal's name that counts: the believed one, else the last; None where neither is
        known yet.
        """
        lives, believed = self._tokens.get(agent, {}), self._journal.get(agent)
        if believed in lives:
            return believed
        awaited = agent in self._doubted or not self.up
        return None if believed is not None and awaited else next(reversed(lives), None)

    @property
    def look_at(self) -> float | None:
        """When to ask `gone` next."""
        return min((*self._doubted.values(), *self._later.values()), default=None)


def _due(times: dict[str, float], now: float) -> list[str]:
    return [agent for agent, at in times.items() if at <= now]


# --- Detects peers that are alive but do not receive this agent: Zenoh reports no denied put to its
# sender
# The signs are the agent's own: a communicate without a receipt, a ping without a pong, a question
# that is asked again and again, while the peer's liveliness token is there. A peer that hangs gives
# the same signs, and is reported as well. Pure: time comes in as an argument; the shell looks once
# a second.


PATIENCE_S = {"said": 3.0, "pinged": 10.0, "asked": 30.0}
"""A receipt takes ms, and re-sending goes up to every 2 s; on a loaded machine a first pong is
late; km may have to wait with an answer for ex's first look around (estimates).
"""


class Unheard(msgspec.Struct, frozen=True):
    """Messages to `peer` on `channel` have had no effect since `since` [unix s]. `what`: "said",
    "asked", "pinged".
    """

    peer: str
    channel: str
    what: str
    since: float


_TEXTS = {
    "said": "what {agent} says to {peer} on {channel} is not received since {s:.0f} s",
    "pinged": "{agent} and {peer} do not hear each other on {channel} since {s:.0f} s",
    "asked": "what {agent} asks {peer} on {channel} is not answered since {s:.0f} s",
}
WHY = "perhaps the rules of {peer} deny it, or {peer} hangs"


def unheard_text(agent: str, one: Unheard, now: float) -> str:
    """A sentence for people: sender, receiver, duration, possible cause."""
    s = max(0.0, now - one.since)
    said = _TEXTS[one.what].format(agent=agent, peer=one.peer, channel=one.channel, s=s)
    return f"{said}: {WHY.format(peer=one.peer)}"


class Watch:
    """State of one agent. `now`: unheard messages; `look` returns the changes: (what, whether it is
    still so).
    """

    def __init__(self, wiring: Wiring) -> None:
        self.now: tuple[Unheard, ...] = ()
        self._wiring = wiring
        self._waits: dict[tuple[str, str, str], tuple[object, float]] = {}
        self._receipts: dict[str, int] = {}

    def receipted(self, peer: str) -> None:
        """Note a receipt: the peer hears this agent. The peer may still wait with messages it does
        not take now.
        """
        self._receipts[peer] = self._receipts.get(peer, 0) + 1

    def look(
        self, state: CoreState, unanswered: Set[tuple[str, bytes]], peers: Peers, now: float
    ) -> list[tuple[Unheard, bool]]:
        """Compare waiting messages with those of the last look; what still waits is reported when
        old enough.
        """
        before = {(one.peer, one.channel, one.what): one for one in self.now}
        waits: dict[tuple[str, str, str], tuple[object, float]] = {}
        for peer, channel, what, mark in self._waiting(state, unanswered) if peers.up else ():
            if peer in peers.alive:
                receipts = self._receipts.get(peer) if what == "said" else None
                sign = (peers.alive[peer], mark, receipts)
                last = self._waits.get((peer, channel, what))
                waits[peer, channel, what] = (
                    last if last is not None and last[0] == sign else (sign, now)
                )
        self._waits = waits
        begun = ((place, since) for place, (_, since) in waits.items())
        late = ((place, since) for place, since in begun if now - since >= PATIENCE_S[place[2]])
        self.now = tuple(Unheard(*place, since) for place, since in late)
        still = {(one.peer, one.channel, one.what) for one in self.now}
        fresh = [(one, True) for one in self.now if (one.peer, one.channel, one.what) not in before]
        return fresh + [(one, False) for place, one in before.items() if place not in still]

    def _waiting(
        self, state: CoreState, unanswered: Set[tuple[str, bytes]]
    ) -> Iterator[tuple[str, str, str, object]]:
        """Peer, channel, what, and the oldest waiting message of its kind."""
        for peer, channel in unanswered:
            yield peer, channel.decode(), "pinged", None
        for peer, sent in state.outbox.items():
            yield peer, self._channel(peer, sent[0].communicate.protocol), "said", sent[0].number
        for peer, due in state.due.items():
            held = live_subscription(state, peer) if due else None
            if held is not None:
                oldest = min(one.version for one in due.values())
                yield peer, self._channel(peer, held.conversation.protocol), "said", oldest
        oldest_of: dict[str, tuple[float, str, str]] = {}
        for name, ask in state.soft.asks.items():
            one = (ask.communicate.sent or 0.0, name, ask.communicate.protocol)
            oldest_of[ask.communicate.receiver] = min(
                one, oldest_of.get(ask.communicate.receiver, one)
            )
        for peer, (_, name, protocol) in oldest_of.items():
            yield peer, self._channel(peer, protocol), "asked", name

    def _channel(self, peer: str, protocol: str) -> str:
        link = self._wiring.link(peer, protocol)
        return link.channel if link is not None else "?"


# --- Lineage of a stream's numbers: each journal has a random name --------------------------------
# A stream is between two journals.
# A journal that is deleted takes the numbers of its streams with it. So messages and receipts of
# streams carry the name of the sender's journal and of the one that the sender believes the
# receiver to have; what is meant for another journal is neither taken nor receipted. A peer's
# liveliness token names its journal. Under another name than before, the peer has lost its memory:
# both streams begin at 1 again, and the conversations with it are over. A name that was given up is
# never believed again, since its token may outlive it by a lease.
# A journal of which only the end is lost, or an old copy of it that was put back, keeps its name.
# So an agent tells a peer that appears how many of its messages the peer had receipted, until the
# peer answers. A peer that remembers less gives its journal another name: its memory is not what
# the others know.


GIVEN_UP = 16
"""Names of lost journals that are remembered; estimate: tokens of that many lives last a lease (2
s) at most.
"""
TOLD = 16
"""Lost conversations that are remembered after the behaviour was told; estimate: its answers under
way.
"""
ANOTHER = "of another journal"
SHORTENED = "journal shortened"
_DURABLE, _LATEST = Delivery.DURABLE, Delivery.LATEST


def fits(state: CoreState, out: Out, peer: str, journal: str, believed: str) -> bool:
    """Whether a message or receipt is between the present journals of both; the first name of a
    peer is learnt.
    """
    known = state.journals.get(peer)
    if known is None and journal not in state.given_up:
        learn(state, out, peer, journal)
        known = journal
    if journal == known and believed == state.journal:
        return True
    if ANOTHER not in state.counts:
        why = f"{peer} means another journal than this one; it is not taken"
        out.log(ANOTHER, peer=peer, why=why)
    state.count(ANOTHER)
    return False


def learn(state: CoreState, out: Out, peer: str, journal: str) -> None:
    """Note the name of a peer's journal, durably: the numbers that follow count for it."""
    state.journals = state.journals | {peer: journal}
    out.durable = True


def met(state: CoreState, out: Out, peer: str, journal: str) -> bool:
    """Note the journal in a peer's token. Return whether it is news; streams with a peer that lost
    its memory end.
    """
    known = state.journals.get(peer)
    if not journal or journal == known or journal in state.given_up:
        return False
    if known is not None:
        lost = f"{peer} lost its memory: its journal is gone, and with it this"
        begin_again(state, peer, f"{lost} conversation")
        forget_soft(state, peer, f"{lost} subscription")
        state.given_up = (*state.given_up, known)[-GIVEN_UP:]
        ended = sum(
            not one.told and one.held.conversation.peer == peer for one in state.lost.values()
        )
        why = (
            f"{peer} has another journal than before; {ended} conversations with it end, messages"
            " are numbered from 1"
        )
        out.log("lost its memory", level="warning", peer=peer, why=why)
        state.count("peer lost its memory")
    learn(state, out, peer, journal)
    return True


def shortened(state: CoreState, out: Out, peer: str, heard: int, now: float) -> bool:
    """Whether the peer's messages up to `heard` were taken, and that was forgotten: the journal
    gets another name.
    """
    taken = state.taken.get(peer, 0)
    if heard > taken:
        _rename(state, out, peer, f"it took {heard} messages of {peer} and remembers {taken}", now)
    return heard > taken


def renamed(state: CoreState, out: Out, event: Receipted, now: float) -> None:
    """Give the journal another name if the peer believes this life to have another one: an old
    journal was put back.
    """
    if event.journal == state.journals.get(event.peer) and event.believed not in (
        "",
        state.journal,
    ):
        _rename(state, out, event.peer, f"{event.peer} knows a newer one", now)


def _rename(state: CoreState, out: Out, peer: str, what: str, now: float) -> None:
    """Give the journal another name, and end all conversations. Nothing may be said before the
    agent's next life, whose token has that name.
    """
    why = f"a part of {state.agent}'s journal was lost: {what}"
    out.log(SHORTENED, level="error", peer=peer, why=f"{why}; all conversations end")
    state.count(SHORTENED)
    talks = [*state.conversations.values(), *state.soft.conversations.values()]
    for other in {held.conversation.peer for held in talks} | {*state.issued, *state.taken}:
        begin_again(state, other, why)
        forget_soft(state, other, why)
    name = f"{state.journal} {state.incarnation} {now}".encode()
    state.journal = blake2b(name, digest_size=len(state.journal) // 2 or 1).hexdigest()
    out.durable = True


def begin_again(record: Record, peer: str, why: str) -> None:
    """Let the streams with a peer begin at 1, and mark the conversations with it as lost."""
    for key, held in list(record.conversations.items()):
        if held.conversation.peer == peer:
            record.lost[key] = Lost(held, why)
            del record.conversations[key]
    for table in (
        record.taken,
        record.recent,
        record.issued,
        record.heard,
        record.outbox,
        record.versions,
    ):
        table.pop(peer, None)


def forget_soft(state: CoreState, peer: str, why: str) -> None:
    """Forget what waits of a stream that begins again, and the peer's subscription; one to it is
    lost, too.
    """
    soft = state.soft
    soft.inbox = tuple(
        one for one in soft.inbox if one.peer != peer or not (one.number or one.subject)
    )
    soft.resend.pop(peer, None)
    soft.untold.pop(peer, None)
    forget_last(state, peer)
    release(state)
    for key, held in list(soft.conversations.items()):
        if held.conversation.peer != peer or held.delivery is not _LATEST:
            continue
        del soft.conversations[key]
        soft.asks.pop(key, None)
        if held.conversation.role is Role.INITIATOR:
            state.lost[key] = Lost(held, why)


def note_lost(state: CoreState, key: str) -> Lost:
    """Note that the behaviour is told of a lost conversation now, and forget the oldest ones it was
    told of.
    """
    lost = state.lost.pop(key)
    old = [name for name, one in state.lost.items() if one.told]
    for name in old[: max(0, len(old) - TOLD + 1)]:
        del state.lost[name]
    state.lost[key] = Lost(lost.held, lost.why, told=True)
    return lost
