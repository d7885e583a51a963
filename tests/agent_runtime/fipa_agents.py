"""Agents that play FIPA's protocols, with content as SC00037J has it: two in every story, a crowd,
a broker's parties.

- `alice` opens each story of each protocol and `bob` answers: both know the script, each message is
  said only when the one before it has come, and one that should not come is kept in the memory as
  `wrong`.
- `caller` and a crowd in an iterated contract net: one call to all, a second round for the best,
  one award. `eager` proposes at once and wins, `modest` proposes and is rejected, `unwilling`
  refuses, `slow` proposes after the reply-by and is rejected for it.
- `asker` wants to know a weight, `broker` knows who weighs, two scales: first by brokering, then by
  recruiting, where the scales answer the asker themselves.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "fipa_codec"))

import msgspec
from dialogue import parsed
from msgspec.structs import replace
from stories import Story, stories_of
from toy_agents import single, wired

from agent_runtime.core.agent import Agent
from agent_runtime.core.events import Broken, Late, PeerChanged, Received, Started, Woken
from agent_runtime.core.turn import Turn
from agent_runtime.core.wiring import Delivery, Wiring
from fipa_codec import proxying
from fipa_codec.acts import (
    EXPRESSIONS,
    SHAPES,
    Action,
    Content,
    Descriptor,
    Embedded,
    Proposition,
    Quantifier,
    Variable,
    content_of,
    denotes,
)
from fipa_codec.communicate import Communicate
from fipa_codec.conversation import Conversation
from fipa_codec.languages import Kind, Languages
from fipa_codec.multicast import Multicast, Outgoing
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import PROTOCOLS
from fipa_codec.tables import Role

LANGUAGES = Languages([EXPRESSIONS])
TRUE = Proposition("true")
JAR = Descriptor(Quantifier.ANY, "x", Proposition("jar", (Variable("x"),)))
SAMPLES = {
    Action: Action("bob", "grasp", (JAR,)),
    Proposition: Proposition("reachable", (JAR,)),
    Descriptor: JAR,
    Embedded: Embedded(Communicate(performative=P.QUERY_REF, protocol="query", sender="alice")),
}


def spoken(story: Story) -> bool:
    """Whether two agents can play it by taking turns: nothing crosses, nothing is forgotten.

    News of an act that goes on is a word of a system's own language, which is not spoken here.
    """
    return all(word[1] == ":" and "[progress]" not in word for word in story.words)


SCRIPT = tuple(
    (protocol.name, story)
    for protocol in PROTOCOLS
    for story in stories_of(protocol.name)
    if spoken(story)
)


class Played(msgspec.Struct, frozen=True):
    """Next word of each story; the states in which the earlier stories ended here."""

    story: int = 0
    word: int = 0
    talk: str = ""
    ends: tuple[str, ...] = ()
    wrong: str = ""

    @property
    def next(self) -> str:
        """The word, "" after the last story."""
        return SCRIPT[self.story][1].words[self.word] if self.story < len(SCRIPT) else ""


def content(performative: P, kind: Kind) -> Content:
    """Return the content of an act: the first class that each of its places allows."""
    expressions = (SAMPLES[place[0]] for place in SHAPES[performative])
    return content_of(performative, *expressions, last=kind is Kind.FINAL)


def gone_on(played: Played, talk: Conversation) -> Played:
    """After a word was said or came."""
    word, (_, story) = played.word + 1, SCRIPT[played.story]
    if word < len(story.words):
        return replace(played, word=word, talk=talk.id)
    return Played(played.story + 1, ends=(*played.ends, talk.state), wrong=played.wrong)


def say(played: Played, turn: Turn, peer: str) -> Played:
    """One own word."""
    _, _, act, kind = parsed(played.next)
    assert act is not None
    said = content(act, kind)
    if played.word == 0:
        name = turn.open(peer, SCRIPT[played.story][0], act, said, reply_by_s=60.0)
        return gone_on(played, turn.conversation(name))
    cancel = Kind.CANCEL if kind is Kind.CANCEL else None
    return gone_on(played, turn.say(played.talk, act, said, kind=cancel))


def heard(played: Played, event: Received, mine: str) -> Played:
    """One word of the other."""
    act, expected = event.communicate.performative, played.next
    due = parsed(expected)[2] if expected else None
    if act is not due or expected.startswith(mine) or event.talk is None:
        return replace(played, wrong=f"{act}, expected {expected!r}")
    return gone_on(played, event.talk)


def player(name: str, mine: str, peer: str) -> Agent[Played]:
    """The agent that says the words beginning with `mine`."""

    def play(played: Played, turn: Turn) -> Played:
        match turn.event:
            case Received() as event:
                played = heard(played, event, mine)
            case Broken(reason=reason):
                played = replace(played, wrong=reason)
            case Started():
                pass
            case _:
                return played
        while played.next.startswith(mine) and not played.wrong:
            played = say(played, turn, peer)
        return played

    return single(name, Played(), play)


def alice() -> Agent[Played]:
    """The initiator of every story."""
    return player("alice", "i", "bob")


def bob() -> Agent[Played]:
    """The participant."""
    return player("bob", "p", "alice")


def wanted(role: Role) -> tuple[str, ...]:
    """The states in which all stories are to end."""
    place = 0 if role is Role.INITIATOR else 1
    return tuple(story.ends[place] for _, story in SCRIPT)


# --- a caller and a crowd -------------------------------------------------------------------------


CROWD = ("eager", "modest", "slow", "unwilling")
REPLY_BY_S = 4.0
TOO_SLOW_S = 5.0

CARRY = Action("anybody", "carry", ("jar",))
PRICE = Descriptor(Quantifier.ANY, "p", Proposition("price", (Variable("p"),)))
CONTENTS: dict[P, Content] = {
    P.CFP: content_of(P.CFP, CARRY, PRICE),
    P.PROPOSE: content_of(P.PROPOSE, CARRY, TRUE),
    P.REFUSE: content_of(P.REFUSE, CARRY, TRUE),
    P.ACCEPT_PROPOSAL: content_of(P.ACCEPT_PROPOSAL, CARRY, TRUE),
    P.REJECT_PROPOSAL: content_of(P.REJECT_PROPOSAL, CARRY, TRUE, TRUE),
    P.INFORM: content_of(P.INFORM, TRUE),
}


class Calling(msgspec.Struct, frozen=True):
    """The caller's memory; `outcomes` at the end."""

    group: Multicast | None = None
    rounds: int = 0
    late: tuple[str, ...] = ()
    outcomes: dict[str, str] = {}


def call(memory: Calling, turn: Turn) -> Calling:
    """The caller's only behaviour: it calls when all are there, since reply-by runs from the
    call.
    """
    group = memory.group
    match turn.event:
        case Started() | PeerChanged() if group is None and turn.peers.keys() >= set(CROWD):
            group = turn.open_all(CROWD, "icfp", P.CFP, CONTENTS[P.CFP], reply_by_s=REPLY_BY_S)
            return Calling(group, rounds=1)
        case Received(talk=talk) if talk is not None and group is not None:
            return decide(memory, group.noted(talk, turn.now), turn)
        case Late(peer=peer) if group is not None:
            return decide(replace(memory, late=(*memory.late, peer)), group, turn)
        case Broken(peer=peer) if group is not None:
            return decide(memory, group.broken(peer), turn)
    return memory


def decide(memory: Calling, group: Multicast, turn: Turn) -> Calling:
    """Reject what came late; when all have had their time call the first that offered again, then
    award it.
    """
    group, rounds = tell(group, group.rejections, turn), memory.rounds
    if not group.awaited(turn.now) and group.offers and not group.awarded:
        best = group.offers[0]
        told = group.call_again(best) if rounds == 1 else group.award(best)
        group, rounds = tell(group, told, turn), 2
    over = CROWD if group.over(turn.now) else ()
    outcomes = {peer: group.outcome(peer, turn.now) for peer in over}
    return replace(memory, group=group, rounds=rounds, outcomes=outcomes)


def tell(group: Multicast, told: Outgoing, turn: Turn) -> Multicast:
    """Say it, and note what became of each conversation."""
    for peer, act in told:
        reply_by_s = REPLY_BY_S if act is P.CFP else None
        talk = turn.say(group.talks[0].id, act, CONTENTS[act], to=peer, reply_by_s=reply_by_s)
        group = group.noted(talk, turn.now)
    return group


def caller() -> Agent[Calling]:
    """The initiator."""
    return single("caller", Calling(), call)


class Working(msgspec.Struct, frozen=True):
    """State of a participant's conversation, "" before the call."""

    state: str = ""


def worker(name: str) -> Agent[Working]:
    """A participant of the crowd."""
    offer = P.REFUSE if name == "unwilling" else P.PROPOSE
    answers = {P.CFP: offer, P.ACCEPT_PROPOSAL: P.INFORM}

    def work(memory: Working, turn: Turn) -> Working:
        match turn.event:
            case Received(communicate=heard, talk=talk) if talk is not None:
                if name == "slow" and heard.performative is P.CFP:
                    turn.wake(talk.id, turn.now + TOO_SLOW_S)
                elif act := answers.get(heard.performative):
                    talk = turn.say(talk.id, act, CONTENTS[act])
                return Working(talk.state)
            case Woken(name=conversation):
                return Working(turn.say(conversation, P.PROPOSE, CONTENTS[P.PROPOSE]).state)
        return memory

    return single(name, Working(), work)


OUTCOMES = {"eager": "done", "modest": "rejected", "slow": "refused", "unwilling": "refused"}
"""Outcomes that the caller must know at the end."""
ENDS = {"eager": "done", "modest": "rejected", "slow": "rejected", "unwilling": "refused"}
"""Final states of the participants."""


# --- a broker and its parties ---------------------------------------------------------------------


SCALES = ("left-scale", "right-scale")
SCALE = Descriptor(Quantifier.ALL, "x", Proposition("scale", (Variable("x"),)))
WEIGHT = Descriptor(Quantifier.IOTA, "w", Proposition("weight", ("jar", Variable("w"))))
AGREED = content_of(P.AGREE, Action("broker", "proxy"), TRUE)
PROXIED = content_of(P.INFORM, Proposition("proxied", SCALES))
WEIGHTS = {"left-scale": 0.4, "right-scale": 0.5}


class Asking(msgspec.Struct, frozen=True):
    """Answers by protocol: who weighed what; `direct`: the conversation the scales answer in."""

    proxy: str = ""
    direct: str = ""
    relayed: tuple[tuple[str, float], ...] = ()
    answered: tuple[tuple[str, float], ...] = ()
    ends: tuple[str, ...] = ()


def ask(memory: Asking, turn: Turn) -> Asking:
    """First brokering, then recruiting."""
    everybody = {"broker", *SCALES}
    match turn.event:
        case Started() | PeerChanged() if not memory.proxy and turn.peers.keys() >= everybody:
            return proxy(memory, turn, "brokering")
        case Received(communicate=heard, talk=talk) if talk is not None and heard.sender in SCALES:
            memory = replace(memory, answered=(*memory.answered, weighed(heard)))
            if len(memory.answered) == len(SCALES):
                turn.leave(memory.direct)
        case Received(content=content, talk=talk) if talk is not None:
            if answer := proxying.relayed_answer(content):
                memory = replace(memory, relayed=(*memory.relayed, weighed(answer)))
            if talk.ended:
                memory = replace(memory, ends=(*memory.ends, f"{talk.protocol} {talk.state}"))
                return proxy(memory, turn, "recruiting") if talk.protocol == "brokering" else memory
    return memory


def proxy(memory: Asking, turn: Turn, protocol: str) -> Asking:
    """Ask the broker; in recruiting, wait for whoever answers before that."""
    name = f"{turn.me}-{turn.incarnation}-{protocol}"
    content = EXPRESSIONS.encode(content_of(P.QUERY_REF, WEIGHT))
    words = {"conversation": name, "content": content, "language": EXPRESSIONS.name}
    message = proxying.embedded_message(
        "query", P.QUERY_REF, receiver=turn.me, id=f"{name}-m", now=turn.now, **words
    )
    if protocol == "recruiting":
        turn.join(proxying.receiver_conversation(message, ""))
    wish = proxying.proxy_content(P.PROXY, SCALE, message, TRUE)
    asked = turn.open("broker", protocol, P.PROXY, wish)
    return replace(memory, proxy=asked, direct=name)


def weighed(answer: Communicate) -> tuple[str, float]:
    """Return the sender and the jar's weight from its answer."""
    (proposition,) = LANGUAGES.read(answer)[0].expressions
    return answer.sender, proposition.terms[1]


class Broking(msgspec.Struct, frozen=True):
    """`outer`: the brokering that waits for the answers of `inner`."""

    outer: str = ""
    inner: Multicast | None = None


def broke(memory: Broking, turn: Turn) -> Broking:
    """Find the scales: ask them in brokering, pass the message on in recruiting."""
    match turn.event:
        case Received(communicate=heard, content=Content() as content, talk=talk) if talk:
            if heard.performative is P.PROXY:
                return found(memory, turn, proxying.proxy_request(content), talk.id, heard.protocol)
            if memory.inner is not None:
                group = memory.inner.noted(talk, turn.now)
                over = group.over(turn.now)
                turn.say(memory.outer, P.INFORM, proxying.relay_content(heard, last=over))
                return Broking() if over else Broking(memory.outer, group)
    return memory


def found(
    memory: Broking, turn: Turn, errand: proxying.ProxyRequest, outer: str, protocol: str
) -> Broking:
    """All scales fit."""
    message = errand.message
    turn.say(outer, P.AGREE, AGREED)
    if protocol == "brokering":
        content = EXPRESSIONS.decode(message.content)
        inner = turn.open_all(SCALES, message.protocol, message.performative, content)
        memory = Broking(outer, inner)
    for name in () if protocol == "brokering" else SCALES:
        sent = proxying.addressed(message, name)
        passed = proxying.proxy_content(P.PROPAGATE, errand.targets, sent, TRUE)
        turn.open(name, "propagate", P.PROPAGATE, passed)
    turn.say(outer, P.INFORM, PROXIED)
    return memory


class Weighing(msgspec.Struct, frozen=True):
    """The callers that it has answered."""

    told: tuple[str, ...] = ()


def scale(name: str) -> Agent[Weighing]:
    """Answers whoever asks: the broker, or the sender of a message that was passed on."""

    def weigh(memory: Weighing, turn: Turn) -> Weighing:
        match turn.event:
            case Received(communicate=heard, content=Content() as content, talk=talk) if talk:
                if heard.performative is P.PROPAGATE:
                    message = proxying.proxy_request(content).message
                    talk = proxying.target_conversation(message, turn.me)
                    turn.join(talk)
                turn.say(talk.id, P.INFORM, content_of(P.INFORM, denotes(WEIGHT, WEIGHTS[name])))
                return Weighing((*memory.told, talk.peer))
        return memory

    return single(name, Weighing(), weigh)


def asker() -> Agent[Asking]:
    """The initiator, and the receiver of the answers."""
    return single("asker", Asking(), ask)


def broker() -> Agent[Broking]:
    """Return the agent that knows the scales."""
    return single("broker", Broking(), broke)


# --- all of them ----------------------------------------------------------------------------------


PARTIES = [
    *(("caller", name, "T1", "icfp") for name in CROWD),
    *(("asker", "broker", "asker-broker", protocol) for protocol in ("brokering", "recruiting")),
    *(("broker", name, f"broker-{name}", use) for name in SCALES for use in ("query", "propagate")),
    *(("asker", name, f"asker-{name}", "query") for name in SCALES),
]
USES = [(*use, Delivery.DURABLE) for use in PARTIES]


def wiring(name: str, *, query: Delivery = Delivery.DURABLE) -> Wiring:
    """Of each agent by name; between alice and bob all protocols on one channel."""
    deliveries = {"query": query}
    uses = [
        ("alice", "bob", "T1", one.name, deliveries.get(one.name, Delivery.DURABLE))
        for one in PROTOCOLS
    ]
    return wired(name, [*uses, *USES], LANGUAGES, "fipa")


def made(name: str) -> Agent[Any]:
    """The agent of this name."""
    single: dict[str, Callable[[], Agent[Any]]] = {
        "alice": alice, "bob": bob, "caller": caller, "asker": asker, "broker": broker,
    }  # fmt: skip
    if name in single:
        return single[name]()
    return scale(name) if name in SCALES else worker(name)
