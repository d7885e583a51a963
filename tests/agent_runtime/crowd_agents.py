"""A caller and a crowd in an iterated contract net: one call to all, a second round for the best, one award.

`eager` proposes at once and wins, `modest` proposes and is rejected, `unwilling` refuses, `slow` proposes after the
reply-by and is rejected for it.
"""

import msgspec

from agent_runtime.core.agent import Agent, Behaviour
from agent_runtime.core.events import Broken, Late, PeerChanged, Received, Started, Woken
from agent_runtime.core.turn import Turn
from agent_runtime.core.wiring import Delivery, Link, Wiring
from fipa_codec.acts import EXPRESSIONS, Action, Content, Descriptor, Proposition, Quantifier, Variable, content_of
from fipa_codec.languages import Languages
from fipa_codec.multicast import Multicast, Outgoing
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import Role

CROWD = ("eager", "modest", "slow", "unwilling")
REPLY_BY_S = 4.0
TOO_SLOW_S = 5.0
LANGUAGES = Languages([EXPRESSIONS])

CARRY = Action("anybody", "carry", ("jar",))
PRICE = Descriptor(Quantifier.ANY, "p", Proposition("price", (Variable("p"),)))
TRUE = Proposition("true")
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
    """The caller's only behaviour: it calls when all are there, since reply-by runs from the call."""
    match turn.event:
        case Started() | PeerChanged() if memory.group is None and turn.peers.keys() >= set(CROWD):
            group = turn.open_all(CROWD, "icfp", P.CFP, CONTENTS[P.CFP], reply_by_s=REPLY_BY_S)
            return Calling(group, rounds=1)
        case Received(talk=talk) if talk is not None and memory.group is not None:
            return decide(memory, memory.group.noted(talk, turn.now), turn)
        case Late(peer=peer) if memory.group is not None:
            return decide(msgspec.structs.replace(memory, late=(*memory.late, peer)), memory.group, turn)
        case Broken(peer=peer) if memory.group is not None:
            return decide(memory, memory.group.broken(peer), turn)
        case _:
            return memory


def decide(memory: Calling, group: Multicast, turn: Turn) -> Calling:
    """Reject what came late; when all have had their time call the first that offered again, then award it."""
    group, rounds = tell(group, group.rejections, turn), memory.rounds
    if not group.awaited(turn.now) and group.offers and not group.awarded:
        if rounds == 1:
            group, rounds = tell(group, group.call_again(group.offers[0]), turn), 2
        else:
            group = tell(group, group.award(group.offers[0]), turn)
    outcomes = {peer: group.outcome(peer, turn.now) for peer in CROWD} if group.over(turn.now) else {}
    return msgspec.structs.replace(memory, group=group, rounds=rounds, outcomes=outcomes)


def tell(group: Multicast, told: Outgoing, turn: Turn) -> Multicast:
    """Say it, and note what became of each conversation."""
    for peer, act in told:
        reply_by_s = REPLY_BY_S if act is P.CFP else None
        talk = turn.say(group.talks[0].id, act, CONTENTS[act], to=peer, reply_by_s=reply_by_s)
        group = group.noted(talk, turn.now)
    return group


def caller() -> Agent[Calling]:
    """The initiator."""
    return Agent(name="caller", start="calling", memory=Calling(), behaviours={"calling": Behaviour(call)})


class Working(msgspec.Struct, frozen=True):
    """State of a participant's conversation, "" before the call."""

    state: str = ""


def worker(name: str) -> Agent[Working]:
    """A participant of the crowd."""

    def work(memory: Working, turn: Turn) -> Working:
        match turn.event:
            case Received(communicate=heard, talk=talk) if talk is not None:
                answer = {P.CFP: P.REFUSE if name == "unwilling" else P.PROPOSE, P.ACCEPT_PROPOSAL: P.INFORM}
                if name == "slow" and heard.performative is P.CFP:
                    turn.wake(talk.id, turn.now + TOO_SLOW_S)
                elif act := answer.get(heard.performative):
                    talk = turn.say(talk.id, act, CONTENTS[act])
                return Working(talk.state)
            case Woken(name=conversation):
                return Working(turn.say(conversation, P.PROPOSE, CONTENTS[P.PROPOSE]).state)
            case _:
                return memory

    return Agent(name=name, start="working", memory=Working(), behaviours={"working": Behaviour(work)})


def wiring(name: str) -> Wiring:
    """The caller's links to all, or a participant's to the caller."""
    peers, role = (CROWD, Role.INITIATOR) if name == "caller" else (("caller",), Role.PARTICIPANT)
    links = tuple(Link(peer, "T1", "icfp", role, Delivery.DURABLE, silent=EXPRESSIONS.name) for peer in peers)
    return Wiring("crowd", name, links, LANGUAGES)


OUTCOMES = {"eager": "done", "modest": "rejected", "slow": "refused", "unwilling": "refused"}
"""Outcomes that the caller must know at the end."""
ENDS = {"eager": "done", "modest": "rejected", "slow": "rejected", "unwilling": "refused"}
"""Final states of the participants."""
