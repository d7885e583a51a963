"""`roco agents`: every process of the fleet in a line."""

import time

import msgspec
import typer

from operate.cli.errors import NO, NoRunError
from operate.cli.fleet import targets
from operate.cli.fleet.process_status import Row, rows
from operate.cli.fleet.targets import Target
from operate.cli.output import Form, Format, RunDir, problems, tell_json

BETWEEN_S = 0.5
"""Between the two looks whose difference is the share of a processor: 50 ticks of the kernel's clock."""


class Agents(msgspec.Struct, frozen=True):
    """`roco agents --format json`."""

    where: str
    agents: tuple[Row, ...]


def agents(target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Show every process: state, heartbeat's age, processor, memory, pid, life, restarts, communicates that wait.

    Exits with 1 where something is wrong with one, with 3 where nothing runs. `life` is the agent's incarnation,
    `again` how often it was restarted, `waits` how many communicates are not receipted or not said yet.

    Examples:
      roco agents
      roco agents --format json
      roco agents --target compose
    """
    with problems(form):
        fleet = targets.find(target, run_dir)
        found = measured(fleet)
        if form is Format.JSON:
            tell_json(Agents(fleet.where, found))
        else:
            from operate.cli.fleet.agents_table import show  # a program that reads JSON need not wait for rich

            show(found)
        if not any(row.pid for row in found):
            raise NoRunError(fleet.where, f"nothing of {fleet.where} runs; `roco up` starts a fleet")
        if any(row.trouble for row in found):
            raise typer.Exit(NO)


def measured(fleet: Target, between_s: float = BETWEEN_S) -> tuple[Row, ...]:
    """Two looks a moment apart."""
    before = fleet.look()
    time.sleep(between_s if before.seen else 0.0)
    return rows(before, fleet.look())
