"""Two agents that play the stories of FIPA's protocols to each other, each its own words: `alice` opens, `bob` answers.

Both know the script, and each word is said only when the one before it has come; a word that should not come is kept
in the memory as `wrong`. Every act has the content that SC00037J gives it.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "fipa_codec"))

import msgspec
from dialogue import parsed
from stories import Story, stories_of

from agent_runtime.core.agent import Agent, Behaviour
from agent_runtime.core.events import Broken, Received, Started
from agent_runtime.core.turn import Turn
from agent_runtime.core.wiring import Delivery, Link, Wiring
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
)
from fipa_codec.communicate import Communicate
from fipa_codec.conversation import Conversation
from fipa_codec.languages import Kind, Languages
from fipa_codec.performatives import Performative
from fipa_codec.protocols import PROTOCOLS
from fipa_codec.tables import Role

LANGUAGES = Languages([EXPRESSIONS])
JAR = Descriptor(Quantifier.ANY, "x", Proposition("jar", (Variable("x"),)))
SAMPLES = {
    Action: Action("bob", "grasp", (JAR,)),
    Proposition: Proposition("reachable", (JAR,)),
    Descriptor: JAR,
    Embedded: Embedded(Communicate(performative=Performative.QUERY_REF, protocol="query", sender="alice")),
}


def spoken(story: Story) -> bool:
    """Whether two agents can play it by taking turns: nothing crosses, nothing is forgotten.

    News of an act that goes on is a word of a system's own language, which is not spoken here.
    """
    return all(word[1] == ":" and "[progress]" not in word for word in story.words)


SCRIPT = tuple((protocol.name, story) for protocol in PROTOCOLS for story in stories_of(protocol.name) if spoken(story))


class Played(msgspec.Struct, frozen=True):
    """Next word of each story; the states in which the earlier stories ended here."""

    story: int = 0
    word: int = 0
    talk: str = ""
    state: str = ""
    ends: tuple[str, ...] = ()
    wrong: str = ""

    @property
    def next(self) -> str:
        """The word, "" after the last story."""
        return SCRIPT[self.story][1].words[self.word] if self.story < len(SCRIPT) else ""


def content(performative: Performative, kind: Kind) -> Content:
    """Return the content of an act: the first class that each of its places allows."""
    expressions = (SAMPLES[place[0]] for place in SHAPES[performative])
    return content_of(performative, *expressions, last=kind is Kind.FINAL)


def gone_on(played: Played, talk: Conversation) -> Played:
    """After a word was said or came."""
    word, (_, story) = played.word + 1, SCRIPT[played.story]
    if word < len(story.words):
        return msgspec.structs.replace(played, word=word, talk=talk.id, state=talk.state)
    ends = (*played.ends, talk.state)
    return msgspec.structs.replace(played, story=played.story + 1, word=0, talk="", state="", ends=ends)


def say(played: Played, turn: Turn, peer: str) -> Played:
    """One own word."""
    _, _, performative, kind = parsed(played.next)
    assert performative is not None
    if played.word == 0:
        name = turn.open(peer, SCRIPT[played.story][0], performative, content(performative, kind), reply_by_s=60.0)
        return gone_on(played, turn.conversation(name))
    cancel = Kind.CANCEL if kind is Kind.CANCEL else None
    return gone_on(played, turn.say(played.talk, performative, content(performative, kind), kind=cancel))


def heard(played: Played, event: Received, mine: str) -> Played:
    """One word of the other."""
    _, _, performative, _ = parsed(played.next) if played.next else (None, "", None, None)
    if event.communicate.performative is not performative or played.next.startswith(mine) or event.talk is None:
        return msgspec.structs.replace(played, wrong=f"{event.communicate.performative}, expected {played.next!r}")
    return gone_on(played, event.talk)


def player(name: str, mine: str, peer: str) -> Agent[Played]:
    """The agent that says the words beginning with `mine`."""

    def play(played: Played, turn: Turn) -> Played:
        match turn.event:
            case Received() as event:
                played = heard(played, event, mine)
            case Broken(reason=reason):
                played = msgspec.structs.replace(played, wrong=reason)
            case Started():
                pass
            case _:
                return played
        while played.next.startswith(mine) and not played.wrong:
            played = say(played, turn, peer)
        return played

    return Agent(name=name, start="playing", memory=Played(), behaviours={"playing": Behaviour(play)})


def alice() -> Agent[Played]:
    """The initiator of every story."""
    return player("alice", "i", "bob")


def bob() -> Agent[Played]:
    """The participant."""
    return player("bob", "p", "alice")


def wiring(name: str, *, query: Delivery = Delivery.DURABLE) -> Wiring:
    """All protocols between the two on one channel."""
    role, peer = (Role.INITIATOR, "bob") if name == "alice" else (Role.PARTICIPANT, "alice")
    links = tuple(
        Link(
            peer=peer,
            channel="T1",
            protocol=protocol.name,
            role=role,
            delivery=query if protocol.name == "query" else Delivery.DURABLE,
            silent=EXPRESSIONS.name,
        )
        for protocol in PROTOCOLS
    )
    return Wiring("stories", name, links, LANGUAGES)


def wanted(role: Role) -> tuple[str, ...]:
    """The states in which all stories are to end."""
    place = 0 if role is Role.INITIATOR else 1
    return tuple(story.ends[place] for _, story in SCRIPT)
