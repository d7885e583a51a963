"""The whole state of an agent between two steps: the journalled part, and the soft part that a
death may lose.

The journal record is the whole durable state. Soft: the inbox (unreceipted, so it is sent again),
questions under way, the conversations of queries and subscriptions, who is alive, when to send
again.
"""

from typing import Annotated, Any, Protocol

import msgspec

from agent_runtime.core.control import NOTHING_SET, Answer, Settings, Value
from agent_runtime.core.wiring import Delivery
from fipa_codec.communicate import Communicate, number_of
from fipa_codec.conversation import Conversation
from fipa_codec.errors import RemoteProtocolError
from fipa_codec.languages import Kind

_DURABLE = Delivery.DURABLE  # found by its class it takes 0.1 us before Python 3.12
Count = Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]
"""A number that grows by one; from here it can, and be written down: MessagePack has integers below
2**64.
"""
Version = tuple[int, int]
"""(incarnation, counter) of the observer: greater is newer."""


class Outgoing(msgspec.Struct, frozen=True, array_like=True):
    """A durable communicate that its receiver has not receipted yet."""

    number: int
    communicate: Communicate


class Due(msgspec.Struct, frozen=True, array_like=True):
    """The newest observation of a subject that its subscriber has not receipted yet.

    `last`: not sent before every other one that is due to the subscriber is receipted.
    """

    version: Version
    language: str
    content: msgspec.Raw
    last: bool = False


class Held(msgspec.Struct, frozen=True, omit_defaults=True):
    """An open conversation. `reply_by`: when the wait for its end is over (None: never); `late`:
    that was told.

    `answer`: the last thing said by the participant of a volatile one, repeated when asked again.
    `several`: one of several conversations of this agent with the same id, each with its own peer.
    """

    conversation: Conversation
    delivery: Delivery
    reply_by: float | None = None
    late: bool = False
    answer: Communicate | None = None
    several: bool = False

    @property
    def key(self) -> str:
        """Key under which it is kept; an id has no blanks."""
        talk = self.conversation
        return f"{talk.id} {talk.peer}" if self.several else talk.id


class Lost(msgspec.Struct, frozen=True):
    """A conversation whose peer lost its journal. `told`: the behaviour knows."""

    held: Held
    why: str
    told: bool = False


class Ask(msgspec.Struct, frozen=True):
    """A volatile question under way; asked again at `at`, then after twice the gap [s]."""

    communicate: Communicate
    at: float
    gap: float


class Waiting(msgspec.Struct, frozen=True):
    """An entry of the inbox: an event that was not taken yet. `number`: of the stream of `peer`, 0
    for none.

    `forced`: handed over whatever the behaviour takes. `held`: not before an outbox has room. A
    communicate has its link, and is read at once: content and kind, or what is wrong. `digest`: of
    a durable one.
    """

    event: Any
    peer: str = ""
    number: int = 0
    subject: str = ""
    version: Version = (0, 0)
    forced: bool = False
    held: bool = False
    link: Any = None
    content: Any = None
    kind: Kind = Kind.PLAIN
    fault: RemoteProtocolError | None = None
    digest: bytes = b""


class Soft(msgspec.Struct):
    """The part lost by a death. `up`: the router is connected; `full`: the peer whose outbox has no
    room.

    `held`: keys of the wake-ups and of the late conversations that wait for room. `parameters`: the
    value of each, set or not; `answer`: to the last order. `last`: last words in volatile
    conversations, by id, until they are receipted; `over`: the newest of those conversations (peer,
    conversation), which no late copy of their opening opens again. `renumbered`: how often messages
    to a peer got new numbers since it receipted one. `untold`: lives of peers that have not
    answered yet how much of this agent's messages they had receipted (peers).
    """

    step: int = 0
    up: bool = True
    full: str = ""
    held: frozenset[str] = frozenset()
    inbox: tuple[Waiting, ...] = ()
    asks: dict[str, Ask] = {}
    last: dict[str, Ask] = {}
    over: tuple[tuple[str, str], ...] = ()
    conversations: dict[str, Held] = {}
    peers: dict[str, int] = {}
    resend: dict[str, tuple[float, float]] = {}
    parameters: dict[str, Value] = {}
    answer: Answer = Answer()
    renumbered: dict[str, int] = {}
    untold: dict[str, int] = {}


class Record(msgspec.Struct, kw_only=True):
    """The journalled part. `taken`, `issued`, `heard`: last stream number per peer that was taken
    of it, said to it, receipted by it; `counter`: for ids and versions.

    `recent`: number and digest of the newest messages that were taken of a peer's stream.

    `journal`: the random name that the journal got when it was made; `journals`: those of the
    peers, never changed in place; `given_up`: names that peers had before. `lost`: conversations
    with peers that lost their journal. `settings` stands in the record only once an operator has
    set something.
    """

    agent: str
    incarnation: Count
    counter: Count
    state: str
    memory: msgspec.Raw
    conversations: dict[str, Held] = {}
    taken: dict[str, Count] = {}
    recent: dict[str, tuple[tuple[Count, bytes], ...]] = {}
    issued: dict[str, Count] = {}
    heard: dict[str, Count] = {}
    outbox: dict[str, tuple[Outgoing, ...]] = {}
    versions: dict[str, dict[str, Version]] = {}
    due: dict[str, dict[str, Due]] = {}
    wakes: dict[str, float] = {}
    counts: dict[str, Count] = {}
    journal: str = ""
    journals: dict[str, str] = {}
    given_up: tuple[str, ...] = ()
    lost: dict[str, Lost] = {}
    settings: Settings | msgspec.UnsetType = msgspec.UNSET


class CoreState(Record, kw_only=True):
    """The durable part (as in Record, with the memory as an object) and the soft part. A value:
    step() copies it.
    """

    memory: Any
    kept: bytes = b""
    soft: Soft

    @property
    def now_set(self) -> Settings:
        """Settings made by the operator; NOTHING_SET if there are none."""
        return NOTHING_SET if self.settings is msgspec.UNSET else self.settings

    @property
    def paused(self) -> bool:
        """Whether the agent takes no step."""
        return self.settings is not msgspec.UNSET and self.settings.paused

    def fork(self) -> "CoreState":
        """A copy that a step may change; dictionaries are copied, their values are frozen."""
        soft = self.soft
        return msgspec.structs.replace(
            self,
            conversations={**self.conversations},
            taken={**self.taken},
            recent={**self.recent},
            issued={**self.issued},
            heard={**self.heard},
            outbox={**self.outbox},
            versions={**self.versions},
            due={**self.due},
            wakes={**self.wakes},
            counts={**self.counts},
            lost={**self.lost},
            soft=msgspec.structs.replace(
                soft,
                asks={**soft.asks},
                last={**soft.last} if soft.last else {},
                conversations={**soft.conversations},
                peers={**soft.peers},
                resend={**soft.resend},
                renumbered={**soft.renumbered} if soft.renumbered else {},
                untold={**soft.untold} if soft.untold else {},
            ),
        )

    def held(self, conversation: str, peer: str = "") -> Held | None:
        """The open conversation of that id; of several, which are durable, the one with the peer.

        One that waits for any answerer becomes, for each agent that answers, a conversation with
        that agent.
        """
        one = self.conversations.get(conversation) or self.soft.conversations.get(conversation)
        if one is not None or not self.conversations:
            return one
        one = self.conversations.get(f"{conversation} {peer}")
        anybody = None if one or not peer else self.conversations.get(anybodys(conversation))
        if anybody is None:
            return one
        return msgspec.structs.replace(
            anybody, conversation=msgspec.structs.replace(anybody.conversation, peer=peer)
        )

    def keep(self, held: Held) -> None:
        """Store a conversation after a step; an ended one is deleted."""
        place = self.conversations if held.delivery is _DURABLE else self.soft.conversations
        name = held.key if held.several else held.conversation.id
        if held.conversation.ended:
            place.pop(name, None)
        else:
            place[name] = held

    def count(self, what: str) -> None:
        self.counts[what] = self.counts.get(what, 0) + 1

    def name(self) -> str:
        """A fresh id: agent, incarnation, counter; unique over all lives of the agent."""
        self.counter += 1
        return f"{self.agent}-{self.incarnation}-{self.counter}"


def anybodys(conversation: str) -> str:
    """Key of a conversation whose answerer is not known yet (Held.key with no peer)."""
    return f"{conversation} "


def age(name: str) -> Version | None:
    """(incarnation, counter) from an id of `CoreState.name`, None for other ids; greater is
    newer.
    """
    parts = name.rsplit("-", 2)
    incarnation, counter = (
        (number_of(part) for part in parts[1:]) if len(parts) == 3 else (None, None)
    )
    return None if incarnation is None or counter is None else (incarnation, counter)


_encoder = msgspec.msgpack.Encoder()
_decoder = msgspec.msgpack.Decoder(Record)


def encode_memory(memory: Any) -> bytes:
    """The memory without its soft field, and without what is UNSET."""
    hard = {name: getattr(memory, name) for name in memory.__struct_fields__ if name != "soft"}
    return _encoder.encode(
        {name: value for name, value in hard.items() if value is not msgspec.UNSET}
    )


def same_memory(old: Any, new: Any) -> bool:
    """Whether nothing durable was touched: the same objects in all hard fields."""
    if type(old) is not type(new):
        return False
    # A generator of its own takes longer than all the rest.
    for name in old.__struct_fields__:
        if name != "soft" and getattr(old, name) is not getattr(new, name):
            return False
    return True


def encode_record(state: CoreState) -> bytes:
    parts = {name: getattr(state, name) for name in Record.__struct_fields__}
    return _encoder.encode(Record(**(parts | {"memory": msgspec.Raw(state.kept)})))


class Start(Protocol):
    """The fields of an agent's table (agent_runtime.core.agent.Agent) from which its first state is
    made.
    """

    @property
    def name(self) -> str:
        """The agent's name."""

    @property
    def start(self) -> str:
        """The state it starts in."""

    @property
    def memory(self) -> Any:
        """The memory of its first start."""


def fresh(agent: Start, journal: str = "") -> CoreState:
    """The state before the first start: incarnation 0."""
    return CoreState(
        journal=journal,
        agent=agent.name,
        incarnation=0,
        counter=0,
        state=agent.start,
        memory=agent.memory,
        kept=encode_memory(agent.memory),
        soft=Soft(),
    )


def restored(agent: Start, record: bytes) -> CoreState:
    """The state in a journal record, with an empty soft part. Raises msgspec.MsgspecError for
    another shape.
    """
    stored = _decoder.decode(record)
    memory = msgspec.msgpack.decode(stored.memory, type=type(agent.memory))
    parts = {name: getattr(stored, name) for name in Record.__struct_fields__}
    return CoreState(**(parts | {"memory": memory}), kept=bytes(stored.memory), soft=Soft())
