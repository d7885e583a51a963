"""Counts, sizes and rates of the traffic, by channel and performative.

Pure: communicates in, figures out; times are those at which things were heard.
"""

from collections import deque
from itertools import pairwise
from typing import TypeVar

from operate.cli.traffic.listen import Said
from operate.filters import Filter

WINDOW = 10_000
"""Number of the newest messages of a row that its figures are made from, as with `ros2 topic hz`."""
OPEN_QUESTIONS = 10_000
"""Questions whose answers are waited for; estimate: a fleet has some dozen open."""
NEWS = ("subscribe", "inform")
"""Comes when there is news, long after it was asked for: no measure of an answer."""
K = TypeVar("K")
V = TypeVar("V")


class Flow:
    """One row: `count` and `bytes` of all, the rest of the newest WINDOW. Times in unix seconds, spans in seconds."""

    def __init__(self, channel: str, performative: str) -> None:
        self.channel, self.performative = channel, performative
        self.count = self.bytes = 0
        self.sizes: deque[int] = deque(maxlen=WINDOW)
        self.times: deque[float] = deque(maxlen=WINDOW)
        self.answers: deque[float] = deque(maxlen=WINDOW)

    def add(self, at: float, size: int) -> None:
        """One more."""
        self.count += 1
        self.bytes += size
        self.sizes.append(size)
        self.times.append(at)

    @property
    def gaps(self) -> list[float]:
        """From each to the next."""
        times = list(self.times)
        return [later - earlier for earlier, later in pairwise(times)]


class Tally:
    """Takes what was said; `rows` are the flows of what the filter keeps. `began`, `last`: [unix s], 0 before any."""

    def __init__(self, wanted: Filter) -> None:
        self._wanted = wanted
        self._flows: dict[tuple[str, str], Flow] = {}
        self._asked: dict[tuple[str, str, str], float] = {}
        self._answered: dict[tuple[str, str, str, str], None] = {}
        self.began = self.last = 0.0
        self.count = self.bytes = 0

    def take(self, one: Said) -> bool:
        """Count it; whether the filter keeps it. Questions count for the latency of answers though it does not."""
        span = self._latency(one)
        if not self._wanted.keeps(one):
            return False
        flow = self._flows.setdefault((one.channel, one.performative), Flow(one.channel, one.performative))
        flow.add(one.at, one.size)
        if span is not None:
            flow.answers.append(span)
        self.began, self.last = self.began or one.at, one.at
        self.count += 1
        self.bytes += one.size
        return True

    @property
    def rows(self) -> list[Flow]:
        """By channel, then by who comes first."""
        return sorted(self._flows.values(), key=lambda flow: flow.channel)

    def _latency(self, one: Said) -> float | None:
        """From what it answers to it; a copy answers nothing again."""
        communicate = one.communicate()
        if communicate is None:
            return None
        talk, label = communicate.conversation, communicate.in_reply_to
        if communicate.reply_with:
            _keep(self._asked, (talk, one.sender, communicate.reply_with), one.at)
        begun = self._asked.get((talk, one.receiver, label)) if label else None
        name = (talk, one.sender, one.receiver, communicate.id)
        if begun is None or name in self._answered or (one.protocol, one.performative) == NEWS:
            return None
        _keep(self._answered, name, None)
        return one.at - begun


def _keep(those: dict[K, V], key: K, value: V) -> None:
    """The first value of a key; the oldest is forgotten where there are too many."""
    those.setdefault(key, value)
    if len(those) > OPEN_QUESTIONS:
        del those[next(iter(those))]
