"""Times at which agents heard something, by their own step logs: a latency ends when the asker hears the answer.

Times are those of the agent's clock (agent_runtime.io.clock), which is also that of what it says. It is even within a
life; of two lives, or of two hosts, clocks may differ. So both ends of a span are times of one life of one agent.
Must not know: which spans are wanted.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator

import msgspec

from agent_runtime.core.effects import Receipt
from fipa_codec.communicate import UNREADABLE
from operate.recording.records import House, Identity, Origin, Record, Spoken, Token

RECEIPT = "receipt"


class Told(msgspec.Struct, frozen=True):
    """A receipt of `owner` that came by, for communicates of `peer`."""

    at: float
    owner: str
    peer: str
    receipt: Receipt


class Hearing(msgspec.Struct, frozen=True):
    """Of one agent. `said`: communicate -> when it took it first; `lives`: when each began [unix s]."""

    said: dict[Identity, float]
    lives: tuple[float, ...] = ()

    def after(self, sent: float, at: float | None) -> float | None:
        """Return how long after the agent said something, at `sent`, it heard something, at `at` [s].

        None where it did not, or where both times are not of one life.
        """
        if at is None or at < sent or any(sent < began <= at for began in self.lives):
            return None
        return at - sent


def of(records: Iterable[Record]) -> dict[str, Hearing]:
    """Return what each agent heard, and when."""
    said: defaultdict[str, dict[Identity, float]] = defaultdict(dict)
    lives: defaultdict[str, list[float]] = defaultdict(list)
    for one in records:
        match one:
            case Spoken(origin=Origin.RECEIVER):
                said[one.receiver].setdefault(one.identity, one.received)
            case Token(noted=True):
                lives[one.agent].append(one.received)
    return {agent: Hearing(said[agent], tuple(lives[agent])) for agent in {*said, *lives}}


def receipts(houses: Iterable[House]) -> Iterator[Told]:
    """Yield the receipts among samples; one that cannot be read is left out."""
    for house in houses:
        if house.kind == RECEIPT:
            try:
                receipt = msgspec.msgpack.decode(house.data, type=Receipt)
            except UNREADABLE:
                continue
            yield Told(house.received, house.owner, house.peer, receipt)
