"""`python -m services.monitor` records a fleet until SIGTERM; `python -m services.monitor report RUN_DIR` makes the
report of a run folder again, without any fleet.
"""

import sys
from pathlib import Path
from typing import Annotated

import typer

from agent_runtime import cli
from agent_runtime.logs import Log
from services.monitor.recorder import serve

TEXT = "The recorder: taps all traffic into traffic.mcap. `report RUN_DIR` makes the report of a run folder again."


def report(run_dir: Annotated[Path, typer.Argument(help="A run folder with traffic.mcap or steps/.")]) -> None:
    """Make report.json, report.html and run.rrd of a run folder again, from its recording and the agents' step logs."""
    if not run_dir.is_dir():
        typer.echo(f"{run_dir} is no folder; give one that a run was recorded in", err=True)
        raise typer.Exit(2)
    from services.monitor import make

    raise typer.Exit(0 if make.everything(run_dir, Log("monitor").write) else 1)


if __name__ == "__main__":
    if sys.argv[1:2] == ["report"]:
        app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
        app.command()(report)
        app(sys.argv[2:], prog_name="python -m services.monitor report")
    else:
        cli.run("monitor", TEXT, serve)
