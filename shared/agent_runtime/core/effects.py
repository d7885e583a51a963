"""Effects of a step for the shell (or the in-memory wire), in this order: record, receipts, sends,
tells, logs.

The order is the guarantee: nothing leaves the agent before the record that covers it is on the
disk.
"""

from typing import Any

import msgspec

from fipa_codec.communicate import Communicate
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative


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
    """Collects the effects while a step runs."""

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

    def fork(self) -> "Out":
        return msgspec.structs.replace(
            self,
            receipts=[*self.receipts],
            sends=[*self.sends],
            tells=[*self.tells],
            logs=[*self.logs],
            said=[*self.said],
            parents=[*self.parents],
        )

    def log(self, event: str, level: str = "info", **fields: Any) -> None:
        self.logs.append(LogLine(event, fields, level))

    def deed(self, before: str, after: str, owed: tuple[str, ...]) -> Deed | None:
        """The step in the words of the design, None where no event reached the behaviour."""
        if self.handled is None:
            return None
        event = f"{type(self.handled).__name__} {self.about}".strip()
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
