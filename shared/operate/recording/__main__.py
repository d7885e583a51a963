"""`python -m operate.recording` records a fleet until SIGTERM; `... report RUN_DIR` makes the
report of a run folder again, without any fleet; `... observations RUN_DIR` prints what was said.
`... hear` is for people's tools.
"""

import os
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from agent_runtime.io import cli
from agent_runtime.io.logs import Log
from agent_runtime.io.options import USAGE_ERROR, Options
from agent_runtime.io.secured import key_file
from agent_runtime.io.tap import RECORDER, Sample, Waiting, open_tap
from operate.file_names import TRAFFIC_FILE
from operate.recording.ends import Ends, ends_now
from operate.recording.mcap_file import first
from operate.recording.recorder import serve
from operate.recording.records import sampled
from operate.structs import NothingToRead
from operate.system import NoSystemError, System, here

TRIES = 50
"""Estimate: a process that was killed lets its files go within milliseconds, on a busy machine in a
second.
"""
TEXT = (
    "The recorder: writes all traffic into traffic.mcap. `report RUN_DIR` makes the report of a run"
    " folder again."
)


def report(
    run_dir: Annotated[Path, typer.Argument(help="A run folder with traffic.mcap or steps/.")],
) -> None:
    """Make report.json, report.html and run.rrd of a run folder again, from its recording and the
    agents' step logs.
    """
    if not run_dir.is_dir():
        typer.echo(f"{run_dir} is not a folder; give one that a run was recorded in", err=True)
        raise typer.Exit(USAGE_ERROR)
    from operate.recording.run import Run
    from operate.reports.make import everything

    raise typer.Exit(0 if everything(Run(run_dir), Log("monitor").write) else 1)


def observations(
    run_dir: Annotated[Path, typer.Argument(help="A run folder.", exists=True, file_okay=False)],
) -> None:
    """Print what was said in a run folder, as JSON: who to whom, which act, how large, when."""
    from operate.recording.run import Run

    sys.stdout.buffer.write(msgspec.json.encode(Run(run_dir).observed()) + b"\n")


def closed(file: Annotated[Path, typer.Argument(help="A recording.")]) -> None:
    """Wait until standard input ends, with who records; then give the recording its index, if it
    has none.
    """
    from operate.recording import index

    sys.stdin.buffer.read()
    for _ in range(TRIES):
        try:
            index.write(file)
            return
        except BlockingIOError:  # its lock may live a moment longer than the pipe of who was killed
            time.sleep(0.1)
        except OSError:  # it was taken away meanwhile
            return


# --- hear -----------------------------------------------------------------------------------------


HEAR_TEXT = """`python -m operate.recording hear`: what goes by in a running fleet, as samples, a
JSON object a line, for people's tools. It runs where the agents' logs are: here, or in the
monitor's container.

It begins with the setting of the fleet's recording, and ends when its standard input does: the
caller is gone then, however. Nothing is kept, and nobody is held: of heartbeats and telemetry, what
comes faster than it is read is dropped and counted.
"""
CONSOLE = "console"
"""The identity of people's tools: it gets guests' messages, heartbeats and telemetry."""
PAUSE_S = 0.05
"""Between two looks at the logs (estimate: a person sees no delay)."""
ROUTER_S = 5.0
"""Time to wait for a router [s] (estimate: it answers in milliseconds)."""
NO_ROUTER = 3
"""The exit code where no router answers."""


def hear(options: Options, system: System) -> int:
    """Print until standard input ends. 0: it did, or nobody reads any more; 3: no router
    answers.
    """
    waiting, until = Waiting(), time.monotonic() + ROUTER_S
    threading.Thread(target=_listen_for_the_end, args=(waiting,), daemon=True).start()
    ends = Ends(options.run_dir, system, ends_now(options.run_dir))
    who = CONSOLE if options.keys is None or key_file(options.keys, CONSOLE).is_file() else RECORDER
    over = lambda: waiting.stopped or time.monotonic() > until  # noqa: E731
    tap = open_tap(options, waiting.put, over, who, guests=system.design.guests)
    if tap is None:
        look = f"Its recording is looked at with --run {options.run_dir}"
        why = f"no router answers at {options.connect}; is the fleet up (`roco status`)?"
        print(f"{why} {look}", file=sys.stderr)
        return NO_ROUTER
    try:
        _print(waiting, ends, options, system)
    except BrokenPipeError:
        pass
    finally:
        tap.close()
    return 0


def _print(waiting: Waiting, ends: Ends, options: Options, system: System) -> None:
    (name, *_), setting = options.all_systems, first(options.run_dir / TRAFFIC_FILE)
    if setting is not None:
        _line(sampled(setting, system.design, name))
    while not waiting.stopped:
        sample = waiting.get(PAUSE_S)
        for one in (sample, *waiting.left()):
            _line(one)
        for record in ends.new(time.time()):
            _line(sampled(record, system.design, name))
        sys.stdout.buffer.flush()


def _line(sample: Sample | None) -> None:
    if sample is not None:
        sys.stdout.buffer.write(msgspec.json.encode(sample) + b"\n")


def _listen_for_the_end(waiting: Waiting) -> None:
    while os.read(0, 4096):  # sys.stdin may not be in use by a thread when Python ends
        pass
    waiting.stop()


# --- The command line -----------------------------------------------------------------------------


VERBS: dict[str, Callable[..., None]] = {
    "report": report,
    "observations": observations,
    "closed": closed,
}


def main() -> None:
    """Do what the command line says; ends the process."""
    if sys.argv[1:2] == ["hear"]:
        cli.app("monitor hear", HEAR_TEXT, lambda options: hear(options, here()))(sys.argv[2:])
    elif sys.argv[1:2] and sys.argv[1] in VERBS:
        app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
        app.command()(VERBS[sys.argv[1]])
        try:
            app(sys.argv[2:], prog_name=f"monitor {sys.argv[1]}")
        except (NothingToRead, NoSystemError) as error:
            typer.echo(str(error), err=True)
            sys.exit(USAGE_ERROR)
    else:
        cli.run("monitor", TEXT, lambda options: serve(options, here()))


if __name__ == "__main__":
    main()
