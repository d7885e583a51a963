"""The processes of a fleet for people: tables of `roco status`, `agents` and `top`, and all that is
known of one.

Apart from the verbs: a program that reads JSON need not wait for rich.
"""

import time
from functools import partial
from typing import TYPE_CHECKING

from rich.text import Text

from agent_runtime.io.heartbeat import Did, Inside, Talk, Waits
from console.fleet.process_status import LATE_S, Beat, Info, Row, Task
from console.terminal.console import Console, pairs, table
from console.terminal.run_state import View
from operate.fleet_file import ProcessState, ProcessStatus
from operate.system import System
from topdown.model.parameters import worded

if TYPE_CHECKING:
    from console.fleet.status import Status


def show_status(now: "Status") -> None:
    """Print what runs, and below it the tasks and what is wrong."""
    console = Console()
    held = (("  STOPPED", "bold red"), " (`roco release`)") if now.stop_held else ()
    console.print(Text.assemble(f"run {now.run}", *held))
    if now.fleet is not None:
        drawn = table(("process", "state", "pid", "restarts", ""), fold=("",))
        for one in now.fleet.processes:
            state = Text(one.state, COLOURS.get(one.state, ""))
            drawn.add_row(one.name, state, str(one.pid or "-"), str(one.restarts), note(one, now))
        console.print(drawn)
    say = partial(console.print, highlight=False, soft_wrap=True)
    if now.unkept:
        say(f"{now.unkept}: `roco down`, then `roco up`", style="bold red")
    if now.keys:
        say(f"{now.keys}: see `roco doctor`", style="bold red")
    if now.pictures:
        say(f"no pictures: {now.pictures}; see `roco doctor`", style="yellow")
    for line in now.unheard:
        console.print(line, style="yellow")
    for task in now.tasks:
        say(f"{task.task}  {task.state}  {wish(task)}  {task.text}".rstrip())
    if now.problem:
        console.print(now.problem, style="yellow")


def wish(task: Task) -> str:
    """What a person asked for, and how far the plan for it is."""
    return f"{task.asked}: step {task.number} of {len(task.steps)}" if task.number else task.asked


def note(status: ProcessStatus, now: "Status") -> str:
    """Return the problem of a process, and the remedy if its state does not name it."""
    runs = now.fleet is not None and any(one.pid for one in now.fleet.processes)
    if runs and status.state is ProcessState.STOPPED:
        return f"{status.note or 'stopped'}: `roco agent start {status.name}`"
    paused = f"paused: `roco agent start {status.name}`" if status.name in now.paused else ""
    return now.troubles.get(status.name, status.note) or paused


COLUMNS = ("agent", "state", "beat", "cpu", "memory", "pid", "life", "again", "waits")


def show_agents(found: tuple[Row, ...]) -> None:
    """Print a line for each, then what is wrong with whom."""
    console = Console()
    console.print(table(COLUMNS, map(cells, found), right=COLUMNS[2:]))
    for row in found:
        if row.trouble:
            console.print(Text.assemble((f"{row.name}: ", "bold"), (row.trouble, "red")))


def cells(row: Row) -> tuple[Text, ...]:
    """A process as the cells of its line."""
    beat_s = row.heartbeat_s
    late = "red" if beat_s is not None and beat_s > LATE_S else ""
    style = "" if row.process is ProcessState.READY else COLOURS.get(row.process, "")
    return (
        Text(row.name, "bold"),
        Text(row.state, style),
        Text("" if beat_s is None else f"{beat_s:.1f} s", late),
        Text("" if row.cpu is None else f"{row.cpu:.0f} %"),
        Text("" if row.memory is None else f"{row.memory / 2**20:.0f} MiB"),
        Text(str(row.pid or "")),
        Text("" if row.incarnation is None else str(row.incarnation)),
        Text(str(row.restarts or ""), "yellow"),
        Text(str(row.waiting or ""), "yellow"),
    )


def show_info(told: Info) -> None:
    """Print what is known of a process."""
    console = Console()
    row, beat = told.row, told.beat or Beat()
    console.print(Text.assemble((row.name, "bold"), f"  {row.state}  ", (told.where, "dim")))
    if row.trouble:
        console.print(row.trouble, style="red")
    known = facts(row, beat, told.channels)
    console.print(pairs((name, value) for name, value in known.items() if value))
    if beat.inside is not None:
        show_inside(beat.inside, console)
    if told.log:
        console.print("last lines it wrote", style="dim")
    for line in told.log:
        console.print(f"  {line}", highlight=False, soft_wrap=True)


def facts(row: Row, beat: Beat, channels: dict[str, str]) -> dict[str, str]:
    """Return the known facts by name; "" for unknown ones."""
    peers = (
        f"{peer}{' on ' + channels[peer] if peer in channels else ''}"
        f"{f', life {life}' if life else ' (gone)'}"
        for peer, life in beat.peers.items()
    )
    return {
        "process": str(row.process) + (f", pid {row.pid}" if row.pid else ""),
        "restarts": str(row.restarts or ""),
        "life": "" if row.incarnation is None else f"{row.incarnation}, step {beat.step}",
        "heartbeat": "" if row.heartbeat_s is None else f"{row.heartbeat_s:.1f} s ago",
        "processor": "" if row.cpu is None else f"{row.cpu:.0f} % of one",
        "memory": "" if row.memory is None else f"{row.memory / 2**20:.0f} MiB",
        "peers": "; ".join(peers),
        "not receipted": _by_peer(beat.unreceipted),
        "not said yet": _by_peer(beat.due),
        "parameters": ", ".join(
            f"{name} = {worded(value)}" for name, value in beat.parameters.items()
        ),
        "log level": beat.level,
        "counts": ", ".join(f"{count} {name}" for name, count in sorted(beat.counts.items())),
    }


def _by_peer(counts: dict[str, int]) -> str:
    return ", ".join(f"{count} to {peer}" for peer, count in counts.items() if count)


def show_inside(inside: Inside, console: Console) -> None:
    """A table for each of them; none for what is empty."""
    tables = {
        f"inbox, {inside.waiting} waiting": list(map(_waiting, inside.inbox)),
        f"conversations, {inside.open} open": list(map(_talk, inside.talks)),
        "last steps": list(map(_step, inside.steps)),
    }
    for title, rows in tables.items():
        if rows:
            console.print(title, style="dim", highlight=False)
            drawn = table(("",) * (1 + len(rows[0])), fold=("",), pad_edge=False)
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


# --- What a process does, in words ----------------------------------------------------------------


AROUND = {"router": {"": "serves tools"}, "monitor": {"": "records"}}
"""Of the processes that every system has."""
COLOURS = {
    "ready": "green",
    "done": "green",
    "running": "cyan",
    "planning": "cyan",
    "starting": "yellow",
    "waiting": "dim",
    "suspended": "yellow",
    "backing-off": "red",
    "given-up": "bold red",
    "failed": "bold red",
    "refused": "red",
    "cancelled": "yellow",
}
AT_REST = {"waits", "holds", "knows", "listens", "carries", "records"}


def state_text(system: System, name: str, state: str) -> str:
    """Return what a process does in a state, in words; "" where nobody says it."""
    agent = system.design.agents.get(name)
    if agent is not None:
        return next((one.says for one in agent.state if one.name == state), "")
    return (AROUND | system.says).get(name, {}).get(state, "")


def doing(status: ProcessStatus, view: View, system: System) -> tuple[str, str]:
    """Words and style of what a process does; as the supervisor sees it while it does not serve."""
    seen = view.agents.get(status.name)
    if status.state is not ProcessState.READY:
        return status.state, COLOURS.get(status.state, "")
    if seen is not None and not seen.alive:
        return "not reachable", "bold red"
    state = seen.state if seen is not None else ""
    words = state_text(system, status.name, state) or state or "ready"
    rests = words.split()[0] in AT_REST and state not in ("hold", "stopped")
    return words, "dim" if rests else "cyan"


def waited_for(processes: tuple[ProcessStatus, ...]) -> str:
    """Return the processes that the start still waits for; "" when all needed ones are ready."""
    needed = [status for status in processes if not status.optional]
    starting = [status.name for status in needed if status.state is not ProcessState.READY]
    if not starting:
        return ""
    ready = f"{len(needed) - len(starting)} of {len(needed)} ready"
    return f"starting: {ready}, waiting for {', '.join(starting)}"
