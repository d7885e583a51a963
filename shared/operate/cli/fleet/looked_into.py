"""An agent's memory for people: inbox, open conversations, last steps."""

import time

from rich.table import Table

from agent_runtime.core.inside import Did, Inside, Talk, Waits
from operate.cli.terminal.console import Console


def show(inside: Inside, console: Console) -> None:
    """A table for each of them; none for what is empty."""
    _table(console, f"inbox, {inside.waiting} waiting", [_waiting(one) for one in inside.inbox])
    _table(console, f"conversations, {inside.open} open", [_talk(one) for one in inside.talks])
    _table(console, "last steps", [_step(one) for one in inside.steps])


def _table(console: Console, title: str, rows: list[tuple[str, ...]]) -> None:
    if not rows:
        return
    console.print(title, style="dim", highlight=False)
    drawn = Table.grid(padding=(0, 2, 0, 0))
    for row in rows:
        drawn.add_row("", *row)
    console.print(drawn, highlight=False)


def _waiting(one: Waits) -> tuple[str, ...]:
    return (one.what, f"of {one.peer}" if one.peer else "", one.protocol)


def _talk(one: Talk) -> tuple[str, ...]:
    by = "" if one.reply_by is None else f"until {_clock(one.reply_by)}"
    return (one.id, f"{one.protocol} as {one.role}", f"with {one.peer}", one.state, by)


def _step(one: Did) -> tuple[str, ...]:
    states = one.before if one.before == one.after else f"{one.before} > {one.after}"
    return (_clock(one.at), one.event, f"says {', '.join(one.said)}" if one.said else "", states)


def _clock(at: float) -> str:
    return time.strftime("%H:%M:%S", time.localtime(at)) + f".{int(at % 1 * 1000):03d}"
