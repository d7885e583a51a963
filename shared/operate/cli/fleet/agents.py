"""`roco agents`: every process of the fleet in a line; and whatever shows processes in a table."""

import time

import msgspec
import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from operate.cli.errors import NO, NoRunError
from operate.cli.fleet import targets
from operate.cli.fleet.process_status import LATE_S, Row, rows
from operate.cli.fleet.state_words import COLOURS
from operate.cli.fleet.targets import Target
from operate.cli.output import Form, Format, RunDir, problems, tell_json
from operate.run_folder import ProcessState

BETWEEN_S = 0.5
"""Between the two looks whose difference is the share of a processor: 50 ticks of the kernel's clock."""
COLUMNS = ("agent", "state", "beat", "cpu", "memory", "pid", "life", "again", "waits")


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
            show(found, Console())
        if not any(row.pid for row in found):
            raise NoRunError(fleet.where, f"nothing of {fleet.where} runs; `roco up` starts a fleet")
        if any(row.trouble for row in found):
            raise typer.Exit(NO)


def measured(fleet: Target, between_s: float = BETWEEN_S) -> tuple[Row, ...]:
    """Two looks a moment apart."""
    before = fleet.look()
    time.sleep(between_s if before.seen else 0.0)
    return rows(before, fleet.look())


def show(found: tuple[Row, ...], console: Console) -> None:
    """A line for each, then what is wrong with whom."""
    console.print(table(found))
    for row in found:
        if row.trouble:
            console.print(Text.assemble((f"{row.name}: ", "bold"), (row.trouble, "red")))


def table(found: tuple[Row, ...]) -> Table:
    """A line for each."""
    drawn = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for name in COLUMNS:
        drawn.add_column(name, no_wrap=True, justify="left" if name in ("agent", "state") else "right")
    for row in found:
        drawn.add_row(*cells(row))
    return drawn


def cells(row: Row) -> tuple[Text, ...]:
    """A process as the cells of its line."""
    late = "red" if row.heartbeat_s is not None and row.heartbeat_s > LATE_S else ""
    return (
        Text(row.name, "bold"),
        Text(row.state, COLOURS.get(row.process, "") if row.process is not ProcessState.READY else ""),
        Text("" if row.heartbeat_s is None else f"{row.heartbeat_s:.1f} s", late),
        Text("" if row.cpu is None else f"{row.cpu:.0f} %"),
        Text("" if row.memory is None else f"{row.memory / 2**20:.0f} MiB"),
        Text(str(row.pid or "")),
        Text("" if row.incarnation is None else str(row.incarnation)),
        Text(str(row.restarts or ""), "yellow"),
        Text(str(row.waiting or ""), "yellow"),
    )
