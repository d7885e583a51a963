"""`roco record`: the traffic of a running fleet from now on, as an MCAP file that opens in Foxglove.

A process of the monitor writes it, as recordings are its business; it ends when this one does, however it ends.
"""

import contextlib
import signal
import subprocess
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import IO, Annotated

import msgspec
import typer
from rich.table import Table

from operate.cli import completion, interrupts
from operate.cli.analysis import analysed, command, environment
from operate.cli.errors import ConsoleError, UsageError
from operate.cli.fleet import targets
from operate.cli.fleet.hear import LostError
from operate.cli.output import Form, Format, RunDir, problems, tell_json
from operate.cli.runs import folders
from operate.cli.terminal.console import Console
from operate.cli.traffic import rate_tables
from operate.cli.traffic.filter_options import Agents, Channels, Count, Performatives, Protocols, Seconds, wanted
from operate.cli.traffic.listen import about, hearing


class Recorded(msgspec.Struct, frozen=True):
    """Progress of a recording: communicates, all records, bytes of the file, time [s], samples that came too fast to be
    kept.
    """

    communicates: int
    records: int
    bytes: int
    seconds: float
    dropped: int
    file: str = ""


def record(
    out: Annotated[Path | None, typer.Option("--out", help="The file; else recording-<time>.mcap here.")] = None,
    channel: Channels = None,
    agent: Agents = None,
    protocol: Protocols = None,
    performative: Performatives = None,
    count: Count = 0,
    for_: Seconds = 0.0,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Record the traffic of a running fleet from now until Ctrl-C, as an MCAP file.

    A kill loses no more than the last tenth of a second. With a filter only the communicates that are meant are kept;
    without one also receipts, heartbeats and telemetry. Every verb that takes --run reads the file; Foxglove opens it.

    Examples:
      roco record
      roco record --out part.mcap --channel CHANNEL --for 60
    """
    with problems(form), interrupts.heard():
        system = about(None, run_dir, target)
        which = wanted(system.design, channel, agent, protocol, performative)
        file = (out or Path(f"recording-{datetime.now():%Y-%m-%d_%H-%M-%S}.mcap")).resolve()
        if file.exists():
            raise UsageError(f"{file} is there already; name another --out, or remove it")
        if not file.parent.is_dir():
            raise UsageError(f"{file.parent} is no folder; make it, or name another --out")
        asked = [msgspec.json.encode(which).decode(), "--count", str(count), "--seconds", str(for_)]
        words = command("record", str(file), "--which", *asked)
        with hearing(run_dir, target) as (_, heard):
            last = _watched(words, environment(system), form, heard.stdout)
            if heard.poll() is not None:
                raise LostError(heard)
        done = msgspec.structs.replace(last, file=str(file))
        if form is Format.JSON:
            tell_json(done)
        else:
            print(sentence(done) + f"\n{file}")


def sentence(done: Recorded) -> str:
    """Return the progress in one line."""
    size = rate_tables.size(done.bytes)
    what = f"{done.communicates} communicates, {done.records} records, {size} in {done.seconds:.1f} s"
    return what + (f"; {done.dropped} more came faster than they could be kept" if done.dropped else "")


def _watched(words: list[str], shared: dict[str, str], form: Form, heard: IO[bytes] | None) -> Recorded:
    """Run a recorder of what is heard with the environment `shared`, telling how far it is; what was recorded in the
    end. Raises ConsoleError.
    """
    console, last, pipe = Console(stderr=True), Recorded(0, 0, 0, 0.0, 0), subprocess.PIPE
    with subprocess.Popen(words, env=shared, stdin=heard, stdout=pipe, stderr=pipe) as process:
        with console.status("recording; Ctrl-C ends it") if form is Format.TEXT else contextlib.nullcontext() as line:
            for last in _told(process):
                if line is not None:
                    line.update(f"recording: {sentence(last)}; Ctrl-C ends it")
        said = process.stderr.read().decode(errors="replace").strip() if process.stderr else ""
    if process.returncode:
        raise ConsoleError(
            f"the recorder ended with {process.returncode}; what was heard before is in its file. {said}"
        )
    if said:
        console.print(said, style="yellow", highlight=False, markup=False)
    return last


def _told(process: "subprocess.Popen[bytes]") -> Iterator[Recorded]:
    """Yield the recorder's reports until it has ended; Ctrl-C is handed on and its end waited for."""
    assert process.stdout is not None
    while True:
        try:
            line = process.stdout.readline()
        except KeyboardInterrupt:
            process.send_signal(signal.SIGINT)
            continue
        if not line:
            return
        yield msgspec.json.decode(line, type=Recorded)


# --- `roco record info`: what is in a recording, before anything is made of it. The recorder's own process reads it


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


# --- `roco record repair`: the index of a recording whose recorder was killed. The recorder's own process writes it


class Repaired(msgspec.Struct, frozen=True):
    """What was done (operate.recording.index.Written); `messages` 0: nothing, the file has its index."""

    file: str
    messages: int = 0
    whole: bool = True
    lost: int = 0
    kept: str = ""


def repair(
    recording: Annotated[
        Path | None,
        typer.Argument(metavar="[RUN]", help="A run's folder, or a recording.", autocompletion=completion.runs),
    ] = None,
    form: Form = Format.TEXT,
) -> None:
    """Write a recording again in chunks with an index. Without RUN that of runs/latest.

    A recorder does so when it ends in order. Without an index, as after a kill, Rerun reads nothing from the file. If
    its end cannot be read, the file is also kept as it was.

    Examples:
      roco record repair
      roco record repair mine.mcap
    """
    with problems(form):
        file = recording or folders.find(None)
        done = msgspec.json.decode(analysed("repair", str(file), about=file), type=Repaired)
        if form is Format.JSON:
            tell_json(done)
        else:
            print(repair_sentence(done))


def repair_sentence(done: Repaired) -> str:
    """Return what was done, for people."""
    name = folders.near(Path(done.file))
    if not done.messages:
        return f"{name}: it was closed in order and has its index; nothing to repair"
    lost = f"\n{done.lost} bytes at its end could not be read; kept as it was: {done.kept}" if done.lost else ""
    return f"{name}: {done.messages} messages, now with an index{lost}"
