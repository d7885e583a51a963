"""The processes of a fleet as a table for people: `roco agents` and `roco top`."""

from rich.text import Text

from operate.cli.fleet.process_status import LATE_S, Row
from operate.cli.fleet.state_words import COLOURS
from operate.cli.terminal.console import Console
from operate.cli.terminal.table import table
from operate.run_folder import ProcessState

COLUMNS = ("agent", "state", "beat", "cpu", "memory", "pid", "life", "again", "waits")


def show(found: tuple[Row, ...]) -> None:
    """Print a line for each, then what is wrong with whom."""
    console = Console()
    console.print(table(COLUMNS, map(cells, found), right=COLUMNS[2:]))
    for row in found:
        if row.trouble:
            console.print(Text.assemble((f"{row.name}: ", "bold"), (row.trouble, "red")))


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
