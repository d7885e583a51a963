"""`roco status`: what runs, and what it is at."""

import typer

from operate.cli.errors import AS_WANTED, NO, NOTHING_RUNS
from operate.cli.fleet import targets
from operate.cli.fleet.fleet_state import Status, state_of
from operate.cli.output import Form, Format, RunDir, problems, tell_json
from operate.run_folder import ProcessState


def status(target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Show the fleet's processes and the tasks. Exits with 1 where not all that must be ready are, where a process is
    frozen or hangs, no supervisor looks after them, or a certificate does not hold, with 3 where nothing runs.

    Examples:
      roco status
      roco status --format json
      roco status --target compose
    """
    with problems(form):
        now = state_of(targets.find(target, run_dir))
        if form is Format.JSON:
            tell_json(now)
        else:
            from operate.cli.fleet.status_table import show  # a program that reads JSON need not wait for rich

            show(now)
        if code := verdict(now):
            raise typer.Exit(code)


def verdict(now: Status) -> int:
    """The exit code: whether all that must be ready are, nothing hangs, and whether anything runs at all."""
    processes = now.fleet.processes if now.fleet else ()
    if not any(process.pid for process in processes):
        return NOTHING_RUNS
    missing = any(p.state is not ProcessState.READY and not p.optional for p in processes)
    return NO if missing or now.stuck or now.unkept or now.keys else AS_WANTED
