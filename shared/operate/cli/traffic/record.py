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

from operate.cli import interrupts
from operate.cli.analysis import command, environment
from operate.cli.errors import ConsoleError, UsageError
from operate.cli.fleet import targets
from operate.cli.fleet.hear import LostError
from operate.cli.output import Form, Format, RunDir, problems, tell_json
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
