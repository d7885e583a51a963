"""The four tables of `roco traffic`: hz, bw, size, stats. Which columns each has, for people and for programs.

Pure: a tally in, rows out.
"""

from collections import deque
from collections.abc import Callable
from itertools import pairwise
from math import fsum
from statistics import fmean, pstdev
from typing import Any, NamedTuple, TypeVar

from rich.table import Table

from operate.cli.traffic.listen import Said
from operate.filters import Filter
from operate.quantiles import quantile, tail

# --- Counts, sizes and rates of the traffic, by channel and performative ---------------------------------------------
# Pure: communicates in, figures out; times are those at which things were heard.


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


# --- The four tables of `roco traffic` --------------------------------------------------------------------------------


Value = float | int | None


class Column(NamedTuple):
    """`name`: in JSON, with its unit; `head`: for people. `value`: of a flow, in a given time [s]."""

    name: str
    head: str
    value: Callable[[Flow, float], Value]
    words: Callable[[Any], str]


def rate(value: float) -> str:
    """Hertz."""
    return f"{value:.2f}" if value < 100 else f"{value:.0f}"


def span(value: float) -> str:
    """Seconds, or less."""
    amount, unit = (1000 * value, "ms") if value < 1 else (value, "s")
    return f"{amount:.2f} {unit}" if amount < 10 else f"{amount:.1f} {unit}" if amount < 100 else f"{amount:.0f} {unit}"


def size(value: float) -> str:
    """Return bytes, kilobytes or more, with three digits."""
    for unit, factor in (("B", 1.0), ("kB", 1e3), ("MB", 1e6)):
        if value < 999.5 * factor:
            return f"{value / factor:.{3 if factor > 1 else 0}{'g' if factor > 1 else 'f'}} {unit}"
    return f"{value / 1e9:.3g} GB"


def speed(value: float) -> str:
    """Bytes per second."""
    return f"{size(value)}/s"


def _hertz(flow: Flow, _: float) -> Value:
    whole = fsum(flow.gaps)
    return len(flow.gaps) / whole if whole > 0 else None


def _per_second(amount: float, seconds: float) -> Value:
    return amount / seconds if seconds > 0 else None


COUNT = Column("count", "count", lambda flow, _: flow.count, str)
TOTAL = Column("bytes", "in all", lambda flow, _: flow.bytes, size)
MEAN = Column("mean_bytes", "mean", lambda flow, _: flow.bytes / flow.count, size)
P50 = Column("p50_bytes", "p50", lambda flow, _: quantile(flow.sizes, 0.5), size)
P95 = Column("p95_bytes", "p95", lambda flow, _: tail(flow.sizes, 0.95), size)
LEAST = Column("min_bytes", "least", lambda flow, _: min(flow.sizes), size)
MOST = Column("max_bytes", "most", lambda flow, _: max(flow.sizes), size)
RATE = Column("rate_hz", "Hz", lambda flow, seconds: _per_second(flow.count, seconds), rate)
BANDWIDTH = Column("bytes_per_s", "mean/s", lambda flow, seconds: _per_second(flow.bytes, seconds), speed)

TABLES: dict[str, tuple[Column, ...]] = {
    "hz": (
        COUNT,
        Column("rate_hz", "Hz", _hertz, rate),
        Column("min_gap_s", "least gap", lambda flow, _: min(flow.gaps, default=None), span),
        Column("mean_gap_s", "mean", lambda flow, _: fmean(flow.gaps) if flow.gaps else None, span),
        Column("max_gap_s", "most", lambda flow, _: max(flow.gaps, default=None), span),
        Column("std_gap_s", "std dev", lambda flow, _: pstdev(flow.gaps) if flow.gaps else None, span),
    ),
    "bw": (COUNT, BANDWIDTH, TOTAL, MEAN, LEAST, MOST),
    "size": (COUNT, LEAST, P50, P95, MOST, MEAN, TOTAL),
    "stats": (
        COUNT,
        P50,
        P95,
        MOST,
        RATE,
        BANDWIDTH,
        Column("answer_p50_s", "took p50", lambda flow, _: quantile(flow.answers, 0.5), span),
        Column("answer_p95_s", "p95", lambda flow, _: tail(flow.answers, 0.95), span),
    ),
}
"""`rate_hz` of hz is that of the row, from its first to its last; of stats, and bytes_per_s, of the whole time."""


def rows(kind: str, tally: Tally, seconds: float) -> list[dict[str, Any]]:
    """The table for programs; a figure that cannot be told yet is left out."""
    return [
        {"channel": flow.channel, "performative": flow.performative}
        | {c.name: value for c in TABLES[kind] if (value := c.value(flow, seconds)) is not None}
        for flow in tally.rows
    ]


def table(kind: str, tally: Tally, seconds: float) -> Table:
    """The table for people."""
    drawn = Table(box=None, padding=(0, 1, 0, 0), header_style="dim", pad_edge=False)
    drawn.add_column("on", no_wrap=True)
    drawn.add_column("performative", no_wrap=True)
    for column in TABLES[kind]:
        drawn.add_column(column.head, justify="right", no_wrap=True)
    before = ""
    for flow in tally.rows:
        values = [column.value(flow, seconds) for column in TABLES[kind]]
        cells = [
            "·" if value is None else column.words(value) for column, value in zip(TABLES[kind], values, strict=True)
        ]
        drawn.add_row("" if flow.channel == before else flow.channel, flow.performative, *cells)
        before = flow.channel
    return drawn


def sentence(tally: Tally, seconds: float) -> str:
    """The whole in a line."""
    if not tally.count:
        return "nothing that is meant went by"
    whole = f"{tally.count} communicate{'s' * (tally.count != 1)}, {size(tally.bytes)}"
    return f"{whole} in {seconds:.1f} s" + (f": {speed(tally.bytes / seconds)}" if seconds > 0 else "")
