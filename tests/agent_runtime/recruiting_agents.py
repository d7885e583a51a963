"""Brokering and recruiting with all parties: `asker` wants to know a weight, `broker` knows who weighs, two `scales`.

The asker asks first for brokering, then for recruiting; in the second the scales answer it themselves.
"""

import msgspec

from agent_runtime.core.agent import Agent, Behaviour
from agent_runtime.core.events import PeerChanged, Received, Started
from agent_runtime.core.turn import Turn
from agent_runtime.core.wiring import Delivery, Link, Wiring
from fipa_codec import proxying
from fipa_codec.acts import (
    EXPRESSIONS,
    Action,
    Content,
    Descriptor,
    Proposition,
    Quantifier,
    Variable,
    content_of,
    denotes,
)
from fipa_codec.communicate import Communicate
from fipa_codec.languages import Languages
from fipa_codec.multicast import Multicast
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import Role

LANGUAGES = Languages([EXPRESSIONS])
SCALES = ("left-scale", "right-scale")
TRUE = Proposition("true")
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
    match turn.event:
        case Started() | PeerChanged() if not memory.proxy and turn.peers.keys() >= {"broker", *SCALES}:
            return proxy(memory, turn, "brokering")
        case Received(communicate=heard, content=content, talk=talk) if talk is not None:
            if heard.sender != "broker":
                memory = msgspec.structs.replace(memory, answered=(*memory.answered, weighed(heard)))
                if len(memory.answered) == len(SCALES):
                    turn.leave(memory.direct)
            elif answer := proxying.relayed_answer(content):
                memory = msgspec.structs.replace(memory, relayed=(*memory.relayed, weighed(answer)))
            if talk.ended and heard.sender == "broker":
                memory = msgspec.structs.replace(memory, ends=(*memory.ends, f"{talk.protocol} {talk.state}"))
                return proxy(memory, turn, "recruiting") if talk.protocol == "brokering" else memory
    return memory


def proxy(memory: Asking, turn: Turn, protocol: str) -> Asking:
    """Ask the broker; in recruiting, wait for whoever answers before that."""
    name = f"{turn.me}-{turn.incarnation}-{protocol}"
    message = proxying.embedded_message(
        "query",
        P.QUERY_REF,
        receiver=turn.me,
        conversation=name,
        id=f"{name}-m",
        now=turn.now,
        content=EXPRESSIONS.encode(content_of(P.QUERY_REF, WEIGHT)),
        language=EXPRESSIONS.name,
    )
    if protocol == "recruiting":
        turn.join(proxying.receiver_conversation(message, ""))
    asked = turn.open("broker", protocol, P.PROXY, proxying.proxy_content(P.PROXY, SCALE, message, TRUE))
    return msgspec.structs.replace(memory, proxy=asked, direct=name)


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
        case Received(communicate=heard, content=Content() as content, talk=talk) if talk is not None:
            if heard.performative is P.PROXY:
                return found(memory, turn, proxying.proxy_request(content), talk.id, heard.protocol)
            if memory.inner is not None:
                group = memory.inner.noted(talk, turn.now)
                turn.say(memory.outer, P.INFORM, proxying.relay_content(heard, last=group.over(turn.now)))
                return Broking() if group.over(turn.now) else Broking(memory.outer, group)
    return memory


def found(memory: Broking, turn: Turn, errand: proxying.ProxyRequest, outer: str, protocol: str) -> Broking:
    """All scales fit."""
    message = errand.message
    turn.say(outer, P.AGREE, AGREED)
    if protocol == "brokering":
        content = EXPRESSIONS.decode(message.content)
        inner = turn.open_all(SCALES, message.protocol, message.performative, content)
        turn.say(outer, P.INFORM, PROXIED)
        return Broking(outer, inner)
    for name in SCALES:
        passed = proxying.proxy_content(P.PROPAGATE, errand.targets, proxying.addressed(message, name), TRUE)
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
            case Received(communicate=heard, content=Content() as content, talk=talk) if talk is not None:
                if heard.performative is P.PROPAGATE:
                    talk = proxying.target_conversation(proxying.proxy_request(content).message, turn.me)
                    turn.join(talk)
                turn.say(talk.id, P.INFORM, content_of(P.INFORM, denotes(WEIGHT, WEIGHTS[name])))
                return Weighing((*memory.told, talk.peer))
        return memory

    return Agent(name=name, start="weighing", memory=Weighing(), behaviours={"weighing": Behaviour(weigh)})


def asker() -> Agent[Asking]:
    """The initiator, and the receiver of the answers."""
    return Agent(name="asker", start="asking", memory=Asking(), behaviours={"asking": Behaviour(ask)})


def broker() -> Agent[Broking]:
    """Return the agent that knows the scales."""
    return Agent(name="broker", start="broking", memory=Broking(), behaviours={"broking": Behaviour(broke)})


def wiring(name: str) -> Wiring:
    """Of each agent by name."""
    lines = [("asker", "broker", "brokering"), ("asker", "broker", "recruiting")]
    for one in SCALES:
        lines += [("broker", one, "query"), ("broker", one, "propagate"), ("asker", one, "query")]
    links = []
    for first, second, protocol in lines:
        if name in (first, second):
            role, peer = (Role.INITIATOR, second) if name == first else (Role.PARTICIPANT, first)
            links.append(Link(peer, f"{first}-{second}", protocol, role, Delivery.DURABLE, silent=EXPRESSIONS.name))
    return Wiring("recruiting", name, tuple(links), LANGUAGES)
