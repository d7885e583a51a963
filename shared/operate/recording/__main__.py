"""`python -m operate.recording` records a fleet until SIGTERM; `... report RUN_DIR` makes the
report of a run folder again, without any fleet; `... observations RUN_DIR` prints what was said.
`... hear` is for people's tools.
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from agent_runtime.io import cli
from agent_runtime.io.logs import Log
from agent_runtime.io.options import USAGE_ERROR
from operate.recording.recorder import serve
from operate.structs import NothingToRead
from operate.system import NoSystemError, here

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
    from operate.reports import make

    raise typer.Exit(0 if make.everything(Run(run_dir), Log("monitor").write) else 1)


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


VERBS: dict[str, Callable[..., None]] = {
    "report": report,
    "observations": observations,
    "closed": closed,
}


def main() -> None:
    """Do what the command line says; ends the process."""
    if sys.argv[1:2] == ["hear"]:
        from operate.recording import hear

        cli.app("monitor hear", str(hear.__doc__), lambda options: hear.serve(options, here()))(
            sys.argv[2:]
        )
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
