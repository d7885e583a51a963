"""`roco record`: the traffic of a running fleet from now on, as an MCAP file that opens in
Foxglove; what is in such a file (`info`), and the index of one whose recorder was killed
(`repair`).
"""

import contextlib
import subprocess
import sys
import threading
import time
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from rich.table import Table

from agent_runtime.io.journal import worded
from agent_runtime.io.tap import Waiting
from console import completion, interrupts
from console.errors import ConsoleError, UsageError
from console.fleet import targets
from console.output import Form, Format, RunDir, argument, option, tell
from console.runs import folders
from console.terminal.console import Console, table
from console.traffic import listen
from console.traffic.listen import RECORDING, LostError, about, hearing
from operate.doing import doing
from operate.file_names import TRAFFIC_FILE
from operate.wording import bytes_in_words

if TYPE_CHECKING:
    from operate.recording.contents import Contents, Counted
    from operate.recording.index import Written
    from operate.recording.side_recording import Keeper, Kept

FLUSH_S = 0.1
TOLD_S = 0.5
"""Seconds between two reports of progress; estimate: what a person watches."""
END_S = 5.0
"""Until the process that hears has ended, once its output has [s] (estimate: it takes
milliseconds).
"""


def record(
    out: Annotated[
        Path | None, option("The file; else recording-<time>.mcap here.", "--out")
    ] = None,
    channel: listen.Channels = None,
    agent: listen.Agents = None,
    protocol: listen.Protocols = None,
    performative: listen.Performatives = None,
    count: listen.Count = 0,
    for_: listen.Seconds = 0.0,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Record the traffic of a running fleet from now until Ctrl-C, as an MCAP file.

    A kill loses no more than the last tenth of a second. With a filter only the communicates that
    are meant are kept; without one also receipts, heartbeats and telemetry. Every verb that takes
    --run reads the file; Foxglove opens it.

    Examples:
      roco record
      roco record --out part.mcap --channel CHANNEL --for 60
    """
    with interrupts.heard():
        from operate.recording.side_recording import Asked, Keeper

        system = about(None, run_dir, target)
        which = listen.wanted(system.design, channel, agent, protocol, performative)
        file = (out or Path(f"recording-{datetime.now():%Y-%m-%d_%H-%M-%S}.mcap")).resolve()
        if file.exists():
            raise UsageError(f"{file} is there already; name another --out, or remove it")
        if not file.parent.is_dir():
            raise UsageError(f"{file.parent} is no folder; make it, or name another --out")
        with hearing(run_dir, target) as (_, heard):
            keeper = Keeper(Asked(file, which, count, for_), system)
            # should this process be killed
            words = [sys.executable, "-P", "-m", RECORDING, "closed", str(file)]
            with subprocess.Popen(words, stdin=subprocess.PIPE, start_new_session=True) as closes:
                done = _recorded(keeper, heard, form)
                closes.kill()
        tell(done, form, sentence(done) + f"\n{file}")


def sentence(done: "Kept") -> str:
    """Return the progress in one line."""
    what = f"{done.communicates} communicates, {done.records} records"
    late = f"; {done.dropped} more came faster than they could be kept" if done.dropped else ""
    return f"{what}, {bytes_in_words(done.bytes)} in {done.seconds:.1f} s{late}"


def _recorded(keeper: "Keeper", heard: "subprocess.Popen[bytes]", form: Format) -> "Kept":
    """Keep what is heard until there is enough or a signal comes, telling how far it is; what was
    kept in the end.
    """
    waiting, console = Waiting(), Console(stderr=True)
    reader = threading.Thread(target=waiting.fill, args=(heard.stdout,), daemon=True)
    reader.start()
    with interrupts.signalled(waiting.stop), doing("recording; Ctrl-C ends it") as say:
        told = flushed = time.monotonic()
        while not waiting.stopped and not keeper.over:
            sample = waiting.get(FLUSH_S)
            if sample is not None:
                keeper.take(sample)
            now = time.monotonic()
            if now - flushed > FLUSH_S:
                kept, flushed = keeper.kept(waiting.dropped), now
                if now - told > TOLD_S:
                    say(f"recording: {sentence(kept)}; Ctrl-C ends it")
                    told = now
        for sample in waiting.left():
            if not keeper.over:
                keeper.take(sample)
        done, unindexed = keeper.finish(waiting.dropped)
    if unindexed:
        console.print(unindexed, style="yellow", highlight=False, markup=False)
    if not reader.is_alive():
        with contextlib.suppress(subprocess.TimeoutExpired):
            heard.wait(END_S)
        raise LostError(heard)
    return done


# --- `roco record info`: what is in a recording, before anything is made of it --------------------


NUMBERS = ("count", "size", "first", "last", "Hz")
LEAST_S = 1.0
"""Of messages within a shorter time a rate tells nothing (estimate)."""


def info(
    recording: Annotated[
        Path | None,
        argument("A run's folder, or a recording.", complete=completion.runs, metavar="[RUN]"),
    ] = None,
    keys: Annotated[bool, option("A line for each key of a topic, too.", "--keys")] = False,
    form: Form = Format.TEXT,
) -> None:
    """Show what is in a recording: topics with counts and times, who wrote it. Without RUN that of
    runs/latest.

    A topic is a channel, or a kind of what goes beside communicates; its keys are those on the
    router, without the system's name.

    Examples:
      roco record info
      roco record info runs/latest --keys
      roco record info mine.mcap --format json
    """
    from operate.recording.contents import contents

    found = contents(recording or folders.find(None))
    tell(found, form, lambda: _show(found, Console(highlight=False), keys=keys))


def _show(told: "Contents", console: Console, *, keys: bool) -> None:
    file, *facts = heading(told)
    console.print(file, soft_wrap=True)  # a path stays whole
    for line in facts:
        console.print(line)
    console.print(topics(told, keys=keys))


def heading(told: "Contents") -> list[str]:
    """Return file, size, times and versions, a line for each."""
    first, last = told.span
    torn = ", not closed in order: it is being written, or its recorder was killed"
    size = f"{bytes_in_words(told.bytes)}{'' if told.whole else torn}"
    times = map(datetime.fromtimestamp, told.span)
    begin, end = (at.strftime("%Y-%m-%d %H:%M:%S.%f")[:-3] for at in times)
    count = sum(one.count for one in told.topics)
    return [
        f"{folders.near(Path(told.file))}, {size}",
        f"{begin} to {end}, {last - first:.1f} s",
        f"{count} messages in {len(told.topics)} topics",
        _facts(told.versions),
        *(f"{name}: {_facts(facts)}" for name, facts in told.notes.items()),
    ]


def topics(told: "Contents", *, keys: bool) -> Table:
    """Return the topics, a line for each and with `keys` for each of their keys; times since the
    first message.
    """
    drawn, begin = table(("topic", *NUMBERS), right=NUMBERS), told.span[0]
    for topic in told.topics:
        drawn.add_row(*_cells(topic, topic.name, begin))
        for key in sorted(topic.keys.values(), key=lambda one: one.name) if keys else ():
            drawn.add_row(*_cells(key, f"  {key.name}", begin), style="dim")
    return drawn


def _cells(one: "Counted", name: str, begin: float) -> tuple[str, ...]:
    span = one.last - one.first
    hertz = f"{(one.count - 1) / span:.2f}" if span > LEAST_S else "-"
    times = (f"{one.first - begin:.1f} s", f"{one.last - begin:.1f} s") if one.count else ("-", "-")
    return name, str(one.count), bytes_in_words(one.bytes), *times, hertz


def _facts(facts: dict[str, str]) -> str:
    return ", ".join(f"{name} {value}" for name, value in facts.items() if value)


# --- `roco record repair`: the index of a recording whose recorder was killed ---------------------


def repair(
    recording: Annotated[
        Path | None,
        argument("A run's folder, or a recording.", complete=completion.runs, metavar="[RUN]"),
    ] = None,
    form: Form = Format.TEXT,
) -> None:
    """Write a recording again in chunks with an index. Without RUN that of runs/latest.

    A recorder does so when it ends in order. Without an index, as after a kill, Rerun reads nothing
    from the file. If its end cannot be read, the file is also kept as it was.

    Examples:
      roco record repair
      roco record repair mine.mcap
    """
    from operate.recording.index import repaired

    file = recording or folders.find(None)
    path = file / TRAFFIC_FILE if file.is_dir() else file
    try:
        done = repaired(path)
    except OSError as error:
        raise ConsoleError(worded(path, error)) from error
    tell(done, form, repair_sentence(done))


def repair_sentence(done: "Written") -> str:
    """Return what was done, for people."""
    name = folders.near(Path(done.file))
    if not done.messages:
        return f"{name}: it was closed in order and has its index; nothing to repair"
    lost = f"\n{done.lost} bytes at its end could not be read; kept as it was: {done.kept}"
    return f"{name}: {done.messages} messages, now with an index{lost if done.lost else ''}"
