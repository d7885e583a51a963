"""Events of an agent: the x of the paper's (c', y) := f(c, x), one event per step (paper, section
3).

The first group reaches behaviours as `turn.event`; the second is the core's own (receipts, time,
the state of the wire). Events say nothing of sockets or clocks: a shell or a pretend wire makes
them and passes the time beside them.
"""

from typing import Any

import msgspec

from agent_runtime.core.control import Command
from fipa_codec.communicate import Communicate
from fipa_codec.conversation import Conversation
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative


class Event(msgspec.Struct, frozen=True, tag=True):
    """Something that happened to the agent."""


class Started(Event, frozen=True):
    """The agent was started (`first`) or restored after a death; its soft memory and soft
    conversations are gone.
    """

    first: bool = True


class Received(Event, frozen=True):
    """A communicate in its turn and in sequence; `content` is decoded by the language it names
    (None where it has none), `talk` is the conversation after it, ended or not.

    A cancel for a conversation that has ended or never was is answered by the runtime, as the
    protocol says, and not seen.
    """

    communicate: Communicate
    content: Any = None
    talk: Conversation | None = None

    @property
    def conversation(self) -> str:
        """The conversation it belongs to."""
        return self.communicate.conversation or ""


class Late(Event, frozen=True):
    """The reply-by of a conversation opened by this agent has passed. Once per conversation; a
    durable one stays open.

    `peer`: whose answer is late, where the conversation has several participants.
    """

    conversation: str
    peer: str = ""


class Broken(Event, frozen=True):
    """A conversation ended out of sequence: a message of the peer could not be accepted (the peer
    was sent not-understood), or the peer lost its journal and knows nothing of it. Whatever is said
    in it now goes nowhere.

    `peer`: with whom it ended, where it has several participants.
    """

    conversation: str
    reason: str
    peer: str = ""


class Settled(Event, frozen=True):
    """The last observation due to this subscriber is receipted (the barrier before a final
    report).
    """

    peer: str


class Woken(Event, frozen=True):
    """The time requested by `turn.wake(name, at)` has come."""

    name: str


class Local(Event, frozen=True):
    """A message from the agent's own devices: a worker process, a person over HTTP, an outcome of
    the loop.
    """

    content: Any


class PeerChanged(Event, frozen=True):
    """A peer appeared under an incarnation, or is gone (None). The same one may appear again after
    an outage.

    `journal`: the name of its journal, "" for one that has none (test programs).
    """

    agent: str
    incarnation: int | None
    journal: str = ""


class Arrived(Event, frozen=True, omit_defaults=True):
    """A communicate came off the wire; the core decides whether it is kept.

    `journal`: the name of its sender's journal; `believed`: of the journal that the sender believes
    this agent to have. Both are "" where no memory of numbers is needed, and of senders without a
    journal. `after`: digest of the durable message that it follows, while that is not receipted;
    `heard`: else the number of that message.
    """

    communicate: Communicate
    journal: str = ""
    believed: str = ""
    after: bytes = b""
    heard: int = 0


class Receipted(Event, frozen=True, omit_defaults=True):
    """The peer has journalled all stream messages up to `taken`, or (taken 0) this version of a
    subject.

    `journal`, `believed`: as in Arrived; the rest: as in Receipt.
    """

    peer: str
    taken: int = 0
    subject: str = ""
    version: tuple[int, int] = (0, 0)
    journal: str = ""
    believed: str = ""
    digest: bytes = b""
    refused: bytes = b""
    unknown: bool = False
    heard: int = 0
    life: int = 0
    answer: bool = False


class Garbled(Event, frozen=True):
    """Bytes on the agent's key that cannot be decoded, or (`forged`) a communicate that contradicts
    its key.
    """

    key: str
    reason: str
    forged: bool = False


class LinkChanged(Event, frozen=True):
    """The agent opened its links with its peers, or closed them; while closed, nothing is sent and
    no peer counts as dead.
    """

    up: bool


class Ordered(Event, frozen=True):
    """An order of the operator; obeyed, or refused with a reason. A behaviour is told of a
    parameter that was set.
    """

    command: Command


class Tick(Event, frozen=True):
    """Time passed: re-send, ask again, wake, or report as late whatever is due."""


class Next(Event, frozen=True):
    """Take the next waiting message, if the present behaviour takes one."""


AnyEvent = (
    Started
    | Received
    | Late
    | Broken
    | Settled
    | Woken
    | Local
    | PeerChanged
    | Arrived
    | Receipted
    | Garbled
    | LinkChanged
    | Ordered
    | Tick
    | Next
)


# --- Effects of a step ----------------------------------------------------------------------------
# For the shell (or the in-memory wire), in this order: record, receipts, sends, tells, logs.
# The order is the guarantee: nothing leaves the agent before the record that covers it is on the
# disk.


class Receipt(msgspec.Struct, frozen=True, tag=True, omit_defaults=True):
    """A receipt for a peer: all stream messages up to `taken`, or (taken 0) this version of the
    subject, are kept.

    `digest`: of the message that was taken under that number. `refused`: of one that came and was
    not taken (`unknown`: perhaps it was, long before), as its number is another's. `heard`: the
    last number of its own that the peer has receipted, told in each `life` of the peer until that
    life answers (`answer`).
    """

    peer: str
    taken: int = 0
    subject: str = ""
    version: tuple[int, int] = (0, 0)
    digest: bytes = b""
    refused: bytes = b""
    unknown: bool = False
    heard: int = 0
    life: int = 0
    answer: bool = False


class LogLine(msgspec.Struct, frozen=True):
    """One structured line; the shell adds agent, time and step."""

    event: str
    fields: dict[str, Any]
    level: str = "info"


Act = tuple[str, Performative, Kind]
"""Use of a protocol (the design's name), performative, guard word."""


class Deed(msgspec.Struct, frozen=True):
    """A step in the words of a design: state before and after, event, messages said.

    `took`: the message that was taken, None for another event, whose class then is `event` (an
    agent's name behind PeerChanged, the use behind Late and Broken). `owed`: peers to whom
    observations are due after it.
    """

    before: str
    event: str
    took: Act | None
    said: tuple[Act, ...]
    after: str
    owed: tuple[str, ...] = ()


class Effects(msgspec.Struct, frozen=True):
    """Effects of a step. `record` None: nothing durable happened. `more`: a waiting message can be
    taken by Next().

    `wake_at`: unix seconds at which a Tick is wanted (None: never). `handled`: the event the
    behaviour saw, None if none. `parents`: (conversation opened, conversation for whose sake),
    where the behaviour said so.
    """

    record: bytes | None = None
    receipts: tuple[Receipt, ...] = ()
    sends: tuple[Communicate, ...] = ()
    tells: tuple[Any, ...] = ()
    logs: tuple[LogLine, ...] = ()
    more: bool = False
    wake_at: float | None = None
    handled: Any = None
    deed: Deed | None = None
    parents: tuple[tuple[str, str], ...] = ()


class Out(msgspec.Struct, eq=False):
    """Collects the effects while a step runs. `took`, `about`: as a Deed tells them; `called`: the
    event's class there, where it is not its own. `unlimited`: uses of conversations that were
    opened without a reply-by.
    """

    durable: bool = False
    record: bytes | None = None
    receipts: list[Receipt] = []
    sends: list[Communicate] = []
    tells: list[Any] = []
    logs: list[LogLine] = []
    handled: Any = None
    said: list[Act] = []
    parents: list[tuple[str, str]] = []
    took: Act | None = None
    about: str = ""
    called: str = ""
    unlimited: list[str] = []

    def fork(self) -> "Out":
        return msgspec.structs.replace(
            self,
            receipts=[*self.receipts],
            sends=[*self.sends],
            tells=[*self.tells],
            logs=[*self.logs],
            said=[*self.said],
            parents=[*self.parents],
            unlimited=[*self.unlimited],
        )

    def log(self, event: str, level: str = "info", **fields: Any) -> None:
        self.logs.append(LogLine(event, fields, level))

    def deed(self, before: str, after: str, owed: tuple[str, ...]) -> Deed | None:
        """The step in the words of the design, None where no event reached the behaviour."""
        if self.handled is None:
            return None
        event = f"{self.called or type(self.handled).__name__} {self.about}".strip()
        return Deed(before, event, self.took, tuple(self.said), after, owed)

    def sealed(self, more: bool, wake_at: float | None, deed: Deed | None = None) -> Effects:
        return Effects(
            self.record,
            tuple(self.receipts),
            tuple(self.sends),
            tuple(self.tells),
            tuple(self.logs),
            more,
            wake_at,
            self.handled,
            deed,
            tuple(self.parents),
        )
