"""What a step asks the shell (or the pretend wire) to do, in this order: record synced, receipts, sends, tells, logs.

The order is the promise: nothing leaves the agent before the record that says so is on the disk.
"""

from typing import Any

import msgspec

from fipa_codec.communicate import Communicate


class Receipt(msgspec.Struct, frozen=True, tag=True, omit_defaults=True):
    """To a peer: all its stream messages up to `taken` are journalled, or (taken 0) this version of the subject is."""

    peer: str
    taken: int = 0
    subject: str = ""
    version: tuple[int, int] = (0, 0)


class LogLine(msgspec.Struct, frozen=True):
    """One structured line; the shell adds agent, time and step."""

    event: str
    fields: dict[str, Any]
    level: str = "info"


class Effects(msgspec.Struct, frozen=True):
    """Of one step. `record` None: nothing durable happened. `more`: a waiting message can be taken, step with Next().

    `wake_at`: unix seconds at which a Tick is wanted (None: never). `handled`: the event the behaviour saw, None if
    none.
    """

    record: bytes | None = None
    receipts: tuple[Receipt, ...] = ()
    sends: tuple[Communicate, ...] = ()
    tells: tuple[Any, ...] = ()
    logs: tuple[LogLine, ...] = ()
    more: bool = False
    wake_at: float | None = None
    handled: Any = None


class Out:
    """Collects the effects while a step runs."""

    def __init__(self) -> None:
        self.durable = False
        self.receipts: list[Receipt] = []
        self.sends: list[Communicate] = []
        self.tells: list[Any] = []
        self.logs: list[LogLine] = []
        self.handled: Any = None

    def log(self, event: str, level: str = "info", **fields: Any) -> None:
        """Add a line."""
        self.logs.append(LogLine(event, fields, level))

    def sealed(self, record: bytes | None, more: bool, wake_at: float | None) -> Effects:
        """The effects, closed."""
        return Effects(
            record,
            tuple(self.receipts),
            tuple(self.sends),
            tuple(self.tells),
            tuple(self.logs),
            more,
            wake_at,
            self.handled,
        )
