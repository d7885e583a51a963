"""`roco record info`: what is in a recording, before anything is made of it. The recorder's own process reads it."""

from datetime import datetime
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from rich.table import Table

from operate.cli import completion
from operate.cli.analysis import analysed
from operate.cli.output import Form, Format, problems, tell_json
from operate.cli.runs import folders
from operate.cli.terminal.console import Console
from operate.cli.traffic import rate_tables

LEAST_S = 1.0
"""Of messages within a shorter time a rate tells nothing (estimate)."""


class Counted(msgspec.Struct, frozen=True):
    """A topic or a key of it: messages, their bytes, when the first and the last was heard [unix s]."""

    name: str
    count: int
    bytes: int
    first: float
    last: float
    schema: str = ""
    keys: dict[str, "Counted"] = {}


class Contents(msgspec.Struct, frozen=True):
    """A recording (operate.recording.contents)."""

    file: str
    bytes: int
    whole: bool
    topics: tuple[Counted, ...]
    versions: dict[str, str]
    notes: dict[str, dict[str, str]]

    @property
    def span(self) -> tuple[float, float]:
        """Times at which the first and the last message were heard; zeros without any."""
        heard = [one for one in self.topics if one.count]
        return min((one.first for one in heard), default=0.0), max((one.last for one in heard), default=0.0)


def info(
    recording: Annotated[
        Path | None,
        typer.Argument(metavar="[RUN]", help="A run's folder, or a recording.", autocompletion=completion.runs),
    ] = None,
    keys: Annotated[bool, typer.Option("--keys", help="A line for each key of a topic, too.")] = False,
    form: Form = Format.TEXT,
) -> None:
    """Show what is in a recording: topics with counts and times, who wrote it. Without RUN that of runs/latest.

    A topic is a channel, or a kind of what goes beside communicates; its keys are those on the router, without the
    system's name.

    Examples:
      roco record info
      roco record info runs/latest --keys
      roco record info mine.mcap --format json
    """
    with problems(form):
        file = recording or folders.find(None)
        told = msgspec.json.decode(analysed("info", str(file), about=file), type=Contents)
        if form is Format.JSON:
            tell_json(told)
            return
        console = Console(highlight=False)
        for line in heading(told):
            console.print(line, soft_wrap=True)
        console.print(table(told, keys=keys))


def heading(told: Contents) -> list[str]:
    """Return file, size, times and versions, a line for each."""
    first, last = told.span
    torn = "" if told.whole else ", not closed in order: it is being written, or its recorder was killed"
    begin, end = (datetime.fromtimestamp(at).strftime("%Y-%m-%d %H:%M:%S.%f")[:-3] for at in (first, last))
    count = sum(one.count for one in told.topics)
    lines = [
        f"{folders.near(Path(told.file))}, {rate_tables.size(told.bytes)}{torn}",
        f"{begin} to {end}, {last - first:.1f} s, {count} messages in {len(told.topics)} topics",
        ", ".join(f"{name} {value}" for name, value in told.versions.items() if value),
    ]
    return lines + [f"{name}: {_facts(facts)}" for name, facts in told.notes.items()]


def table(told: Contents, *, keys: bool) -> Table:
    """Return the topics, a line for each and with `keys` for each of their keys; times since the first message."""
    drawn = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for name in ("topic", "count", "size", "first", "last", "Hz"):
        drawn.add_column(name, no_wrap=True, justify="left" if name == "topic" else "right")
    begin = told.span[0]
    for topic in told.topics:
        drawn.add_row(*_cells(topic, topic.name, begin))
        for key in sorted(topic.keys.values(), key=lambda one: one.name) if keys else ():
            drawn.add_row(*_cells(key, f"  {key.name}", begin), style="dim")
    return drawn


def _cells(one: Counted, name: str, begin: float) -> tuple[str, ...]:
    hertz = f"{(one.count - 1) / (one.last - one.first):.2f}" if one.last - one.first > LEAST_S else "-"
    times = (f"{one.first - begin:.1f} s", f"{one.last - begin:.1f} s") if one.count else ("-", "-")
    return name, str(one.count), rate_tables.size(one.bytes), *times, hertz


def _facts(facts: dict[str, str]) -> str:
    return ", ".join(f"{name} {value}" for name, value in facts.items() if value)
