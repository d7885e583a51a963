"""`roco traffic stats`: how often, how much, how large, live and of a recording."""

import time
from collections import deque
from collections.abc import Callable
from enum import StrEnum
from itertools import pairwise
from math import fsum
from statistics import fmean, pstdev
from typing import Annotated, Any, NamedTuple, TypeVar

from rich.console import Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from console.fleet import targets
from console.output import Form, Format, RunDir, argument, tell_json
from console.terminal.console import Console, table
from console.traffic import listen
from console.traffic.listen import HeardMessage, Source, about, heard_message, source
from operate.filters import Filter
from operate.quantiles import quantile, tail
from operate.wording import bytes_in_words

# --- Counts, sizes and rates of the traffic, by channel and performative --------------------------
# Pure: communicates in, figures out; times are those at which things were heard.


WINDOW = 10_000
"""Number of the newest messages of a row that its figures are made from, as with `ros2 topic
hz`.
"""
OPEN_QUESTIONS = 10_000
"""Questions whose answers are waited for; estimate: a fleet has some dozen open."""
NEWS = ("subscribe", "inform")
"""Comes when there is news, long after it was asked for: no measure of an answer."""
K = TypeVar("K")
V = TypeVar("V")


class Flow:
    """One row: `count` and `bytes` of all, the rest of the newest WINDOW. Times in unix seconds,
    spans in seconds.
    """

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
        return [later - earlier for earlier, later in pairwise(self.times)]


class Tally:
    """Takes what was said; `rows` are the flows of what the filter keeps. `began`, `last`: [unix
    s], 0 before any.
    """

    def __init__(self, wanted: Filter) -> None:
        self._wanted = wanted
        self._flows: dict[tuple[str, str], Flow] = {}
        self._asked: dict[tuple[str, str, str], float] = {}
        self._answered: dict[tuple[str, str, str, str], None] = {}
        self.began = self.last = 0.0
        self.count = self.bytes = 0

    def take(self, one: HeardMessage) -> bool:
        """Count it; whether the filter keeps it. Questions count for the latency of answers though
        it does not.
        """
        span = self._latency(one)
        if not self._wanted.keeps(one):
            return False
        flow = self._flows.setdefault(
            (one.channel, one.performative), Flow(one.channel, one.performative)
        )
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

    def _latency(self, one: HeardMessage) -> float | None:
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


# --- The four tables of `roco traffic` ------------------------------------------------------------


Value = float | int | None


class Column(NamedTuple):
    """`name`: in JSON, with its unit; `head`: for people. `value`: of a flow, in a given time
    [s].
    """

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
    digits = 2 if amount < 10 else 1 if amount < 100 else 0
    return f"{amount:.{digits}f} {unit}"


def speed(value: float) -> str:
    """Bytes per second."""
    return f"{bytes_in_words(value)}/s"


def _hertz(flow: Flow, _: float) -> Value:
    whole = fsum(flow.gaps)
    return len(flow.gaps) / whole if whole > 0 else None


def _per_second(amount: float, seconds: float) -> Value:
    return amount / seconds if seconds > 0 else None


COUNT = Column("count", "count", lambda flow, _: flow.count, str)
TOTAL = Column("bytes", "in all", lambda flow, _: flow.bytes, bytes_in_words)
MEAN = Column("mean_bytes", "mean", lambda flow, _: flow.bytes / flow.count, bytes_in_words)
P50 = Column("p50_bytes", "p50", lambda flow, _: quantile(flow.sizes, 0.5), bytes_in_words)
P95 = Column("p95_bytes", "p95", lambda flow, _: tail(flow.sizes, 0.95), bytes_in_words)
LEAST = Column("min_bytes", "least", lambda flow, _: min(flow.sizes), bytes_in_words)
MOST = Column("max_bytes", "most", lambda flow, _: max(flow.sizes), bytes_in_words)
RATE = Column("rate_hz", "Hz", lambda flow, seconds: _per_second(flow.count, seconds), rate)
BANDWIDTH = Column(
    "bytes_per_s", "mean/s", lambda flow, seconds: _per_second(flow.bytes, seconds), speed
)

TABLES: dict[str, tuple[Column, ...]] = {
    "hz": (
        COUNT,
        Column("rate_hz", "Hz", _hertz, rate),
        Column("min_gap_s", "least gap", lambda flow, _: min(flow.gaps, default=None), span),
        Column("mean_gap_s", "mean", lambda flow, _: fmean(flow.gaps) if flow.gaps else None, span),
        Column("max_gap_s", "most", lambda flow, _: max(flow.gaps, default=None), span),
        Column(
            "std_gap_s", "std dev", lambda flow, _: pstdev(flow.gaps) if flow.gaps else None, span
        ),
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
"""`rate_hz` of hz is that of the row, from its first to its last; of stats, and bytes_per_s, of the
whole time.
"""


def rows(kind: str, tally: Tally, seconds: float) -> list[dict[str, Any]]:
    """The table for programs; a figure that cannot be told yet is left out."""
    return [
        {"channel": flow.channel, "performative": flow.performative}
        | {c.name: value for c in TABLES[kind] if (value := c.value(flow, seconds)) is not None}
        for flow in tally.rows
    ]


def rates_table(kind: str, tally: Tally, seconds: float) -> Table:
    """The table for people."""
    columns, before = TABLES[kind], ""
    numbers = [column.head for column in columns]
    heads = ("on", "performative", *numbers)
    drawn = table(heads, right=numbers, padding=(0, 1, 0, 0), pad_edge=False)
    for flow in tally.rows:
        values = ((column, column.value(flow, seconds)) for column in columns)
        cells = ["·" if value is None else column.words(value) for column, value in values]
        drawn.add_row("" if flow.channel == before else flow.channel, flow.performative, *cells)
        before = flow.channel
    return drawn


def sentence(tally: Tally, seconds: float) -> str:
    """The whole in a line."""
    if not tally.count:
        return "nothing that is meant went by"
    whole = f"{tally.count} communicate{'s' * (tally.count != 1)}, {bytes_in_words(tally.bytes)}"
    mean = f": {speed(tally.bytes / seconds)}" if seconds > 0 else ""
    return f"{whole} in {seconds:.1f} s{mean}"


# --- The verb -------------------------------------------------------------------------------------


PERIOD_S = 1.0
"""A table is renewed so often, as with `ros2 topic hz`."""


class Kind(StrEnum):
    """What is shown: counts, sizes, rates and answers, or one of them in detail."""

    ALL = "all"
    HZ = "hz"
    BW = "bw"
    SIZE = "size"


def stats(
    kind: Annotated[
        Kind, argument("hz: how often; bw: bytes per second; size: how large.")
    ] = Kind.ALL,
    channel: listen.Channels = None,
    agent: listen.Agents = None,
    protocol: listen.Protocols = None,
    performative: listen.Performatives = None,
    run: listen.Recorded = None,
    count: listen.Count = 0,
    for_: listen.Seconds = 0.0,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Show counts, sizes, rates, and how long answers took; or more of one of them.

    Renewed every second until Ctrl-C; of a recording once. An answer took from what it replies to
    (m_w = its m_t) until itself, as both were heard; a copy answers nothing again. Rates are over
    the whole time.

    hz: how often each act is said on each channel. A row's rate is that of its newest 10 000, from
    the first to the last of them; gaps are from one to the next.

    bw: how many bytes per second each channel carries; means are over the whole time.

    size: how large communicates are.

    Examples:
      roco traffic stats --run runs/latest
      roco traffic stats --for 30 --format json
      roco traffic stats hz --channel CHANNEL --for 10
      roco traffic stats bw --agent AGENT --for 10
      roco traffic stats size --performative inform-ref --count 100
    """
    which = listen.wanted(
        about(run, run_dir, target).design, channel, agent, protocol, performative
    )
    what = "stats" if kind is Kind.ALL else kind.value
    with source(run, run_dir, target) as heard:
        _watch(heard, Tally(which), what, form, limits=(count, for_))


def _watch(
    heard: Source, tally: Tally, kind: str, form: Format, *, limits: tuple[int, float]
) -> None:
    """Count until it is over, showing how far it is; then the whole."""

    def told() -> None:
        seconds = _seconds(heard, tally)
        counted = rows(kind, tally, seconds)
        tell_json({"seconds": round(seconds, 3), "count": tally.count, "rows": counted})

    def drawn() -> Group:
        seconds = _seconds(heard, tally)
        line = Text(sentence(tally, seconds) + heard.lost(), "dim")
        return Group(rates_table(kind, tally, seconds), line) if tally.count else Group(line)

    if form is Format.JSON:
        _count(heard, tally, told, limits)
        if not heard.live:
            told()
        return
    console = Console()
    with Live(console=console, auto_refresh=False, transient=True) as screen:
        shown = screen.update if console.is_terminal else lambda *_, **__: None
        _count(heard, tally, lambda: shown(drawn(), refresh=True), limits)
    console.print(drawn())


def _count(
    heard: Source, tally: Tally, look: Callable[[], None], limits: tuple[int, float]
) -> None:
    """Until there is enough, or Ctrl-C; `look` once a period of what goes on."""
    due, (count, seconds) = time.monotonic() + PERIOD_S, limits
    try:
        for sample in heard.samples(seconds):
            one = None if sample is None else heard_message(sample)
            if one is not None and tally.take(one) and tally.count == count:
                break
            if heard.live and time.monotonic() >= due:
                look()
                due += PERIOD_S
    except KeyboardInterrupt:
        pass
    if heard.live:
        look()


def _seconds(heard: Source, tally: Tally) -> float:
    """Return the time listened [s]; of a recording, from the first to the last matching sample."""
    return time.time() - heard.began if heard.live else tally.last - tally.began
