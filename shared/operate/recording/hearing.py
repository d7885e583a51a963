"""Times at which an agent heard something, by its own step log: a latency ends when the asker hears the answer.

Times are those of the agent's clock (agent_runtime.io.clock), which is also that of what it says. It is even within a
life; of two lives, or of two hosts, clocks may differ. So both ends of a span are times of one life of one agent.
Must not know: which spans are wanted.
"""

from collections.abc import Iterable, Iterator

import msgspec

from agent_runtime.core.effects import Receipt
from fipa_codec.communicate import UNREADABLE
from operate.recording.records import House, Record, Spoken, Token

RECEIPT = "receipt"
Identity = tuple[str, str, str]


class Told(msgspec.Struct, frozen=True):
    """A receipt of `owner` that came by, for communicates of `peer`."""

    at: float
    owner: str
    peer: str
    receipt: Receipt


class Took(msgspec.Struct, frozen=True):
    """The time that an agent waited [s]; `by_sender`: from its sending to its hearing, else as the recorder heard."""

    s: float
    by_sender: bool = False


class Hearing(msgspec.Struct, frozen=True):
    """Of one agent. `said`: communicate -> when it came first; `receipts`: in the order of the log; `lives`: when each
    began.
    """

    said: dict[Identity, float] = {}
    receipts: tuple[Told, ...] = ()
    lives: tuple[float, ...] = ()

    def after(self, sent: float, at: float | None) -> float | None:
        """Return how long after the agent said something, at `sent`, it heard something, at `at`.

        None where it did not, or where both times are not of one life.
        """
        if at is None or at < sent or any(sent < began <= at for began in self.lives):
            return None
        return at - sent


def of(log: Iterable[Record]) -> Hearing:
    """Return what an agent heard, from the records of its step log (operate.recording.noted)."""
    noted = tuple(log)
    said: dict[Identity, float] = {}
    for one in noted:
        if isinstance(one, Spoken):
            said.setdefault(one.identity, one.received)
    lives = tuple(one.received for one in noted if isinstance(one, Token))
    return Hearing(said, tuple(receipts(one for one in noted if isinstance(one, House))), lives)


def receipts(houses: Iterable[House]) -> Iterator[Told]:
    """Yield the receipts among samples; one that cannot be read is left out."""
    for house in houses:
        if house.kind == RECEIPT:
            try:
                receipt = msgspec.msgpack.decode(house.data, type=Receipt)
            except UNREADABLE:
                continue
            yield Told(house.received, house.owner, house.peer, receipt)
