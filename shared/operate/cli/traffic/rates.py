"""`roco traffic stats`: how often, how much, how large, live and of a recording."""

import time
from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from rich.console import Group
from rich.live import Live
from rich.text import Text

from operate.cli.fleet import targets
from operate.cli.output import Form, Format, RunDir, problems, tell_json
from operate.cli.terminal.console import Console
from operate.cli.traffic import rate_tables
from operate.cli.traffic.filter_options import (
    Agents,
    Channels,
    Count,
    Performatives,
    Protocols,
    Recorded,
    Seconds,
    wanted,
)
from operate.cli.traffic.listen import Source, about, said, source
from operate.cli.traffic.rate_tables import Tally
from operate.filters import Filter

PERIOD_S = 1.0
"""A table is renewed so often, as with `ros2 topic hz`."""


class _Asked(msgspec.Struct, frozen=True):
    """Options of the call: which table of what, and when to end."""

    kind: str
    which: Filter
    count: int
    seconds: float
    form: Format


class Kind(StrEnum):
    """What is shown: counts, sizes, rates and answers, or one of them in detail."""

    ALL = "all"
    HZ = "hz"
    BW = "bw"
    SIZE = "size"


def stats(
    kind: Annotated[Kind, typer.Argument(help="hz: how often; bw: bytes per second; size: how large.")] = Kind.ALL,
    channel: Channels = None,
    agent: Agents = None,
    protocol: Protocols = None,
    performative: Performatives = None,
    run: Recorded = None,
    count: Count = 0,
    for_: Seconds = 0.0,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Show counts, sizes, rates, and how long answers took; or more of one of them.

    Renewed every second until Ctrl-C; of a recording once. An answer took from what it replies to (m_w = its m_t) until
    itself, as both were heard; a copy answers nothing again. Rates are over the whole time.

    hz: how often each act is said on each channel. A row's rate is that of its newest 10 000, from the first to the
    last of them; gaps are from one to the next.

    bw: how many bytes per second each channel carries; means are over the whole time.

    size: how large communicates are.

    Examples:
      roco traffic stats --run runs/latest
      roco traffic stats --for 30 --format json
      roco traffic stats hz --channel CHANNEL --for 10
      roco traffic stats bw --agent AGENT --for 10
      roco traffic stats size --performative inform-ref --count 100
    """
    with problems(form):
        which = wanted(about(run, run_dir, target).design, channel, agent, protocol, performative)
        table = "stats" if kind is Kind.ALL else kind.value
        watch(_Asked(table, which, count, for_, form), run, run_dir, target)


def watch(asked: _Asked, run: Path | None, run_dir: Path | None, target: str = "") -> None:
    """Count until it is over, showing how far it is; then the whole."""
    tally = Tally(asked.which)
    with source(run, run_dir, target) as heard:
        if asked.form is Format.JSON:
            _count(asked, heard, tally, lambda: _tell(asked, heard, tally))
        else:
            console = Console()
            with Live(console=console, auto_refresh=False, transient=True) as screen:
                shown = screen.update if console.is_terminal else lambda *_, **__: None
                _count(asked, heard, tally, lambda: shown(_drawn(asked, heard, tally), refresh=True))
            console.print(_drawn(asked, heard, tally))
        if asked.form is Format.JSON and not heard.live:
            _tell(asked, heard, tally)


def _count(asked: _Asked, heard: Source, tally: Tally, look: Callable[[], None]) -> None:
    """Until there is enough, or Ctrl-C; `look` once a period of what goes on."""
    due = time.monotonic() + PERIOD_S
    try:
        for sample in heard.samples(asked.seconds):
            one = None if sample is None else said(sample)
            if one is not None and tally.take(one) and tally.count == asked.count:
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


def _tell(asked: _Asked, heard: Source, tally: Tally) -> None:
    seconds = _seconds(heard, tally)
    tell_json(
        {"seconds": round(seconds, 3), "count": tally.count, "rows": rate_tables.rows(asked.kind, tally, seconds)}
    )


def _drawn(asked: _Asked, heard: Source, tally: Tally) -> Group:
    seconds = _seconds(heard, tally)
    line = Text(rate_tables.sentence(tally, seconds) + heard.lost(), "dim")
    return Group(rate_tables.table(asked.kind, tally, seconds), line) if tally.count else Group(line)
