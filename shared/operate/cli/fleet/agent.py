"""`roco agent info|stop|start|restart NAME`: one process of the fleet."""

import time
from typing import Annotated

import msgspec
import typer
from rich.text import Text

from agent_runtime.core.errors import JournalError
from agent_runtime.core.inside import Did, Inside, Talk, Waits
from agent_runtime.io.journal import journal_file
from agent_runtime.io.repair import Repaired
from agent_runtime.io.repair import repair as repaired
from operate.cli.errors import FleetError, UsageError
from operate.cli.fleet import living_names, targets
from operate.cli.fleet.agents import measured
from operate.cli.fleet.process_status import Beat, Row, Seen
from operate.cli.fleet.targets import Target
from operate.cli.output import Form, Format, RunDir, problems, tell_json, waiting
from operate.cli.runs import folders
from operate.cli.terminal.console import Console
from operate.cli.terminal.table import pairs, table
from operate.run_folder import ProcessState
from topdown.model.parameters import worded

# --- An agent's memory for people: inbox, open conversations, last steps ---------------------------------------------


def show_inside(inside: Inside, console: Console) -> None:
    """A table for each of them; none for what is empty."""
    _table(console, f"inbox, {inside.waiting} waiting", [_waiting(one) for one in inside.inbox])
    _table(console, f"conversations, {inside.open} open", [_talk(one) for one in inside.talks])
    _table(console, "last steps", [_step(one) for one in inside.steps])


def _table(console: Console, title: str, rows: list[tuple[str, ...]]) -> None:
    if not rows:
        return
    console.print(title, style="dim", highlight=False)
    heads = ("",) * (1 + len(rows[0]))
    console.print(table(heads, (("", *row) for row in rows), fold=("",), pad_edge=False), highlight=False)


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


# --- `roco agent info|stop|start|restart NAME` ------------------------------------------------------------------------


Process = Annotated[str, typer.Argument(metavar="NAME", help="A process.", autocompletion=living_names.processes)]
PERIOD_S = 0.1  # estimate: how often a waiting person's picture is renewed
STOP_S = 130.0  # the monitor may take two minutes for its reports
READY_S = 90.0  # as for the whole fleet
LOG_LINES = 5


class Info(msgspec.Struct, frozen=True):
    """`roco agent info --format json`: the row, what its heartbeat says, its channels by peer, its last lines."""

    where: str
    row: Row
    beat: Beat | None
    channels: dict[str, str]
    log: tuple[str, ...]


class Done(msgspec.Struct, frozen=True):
    """Outcome of an action on a process, and the time it took [s]."""

    name: str
    process: ProcessState
    pid: int
    took_s: float
    text: str


def info(name: Process, target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Show all that is known of a process: its row, its peers, what waits, what it counts, its last lines.

    Of an agent also its parameters, its inbox, its open conversations and its last steps.

    Examples:
      roco agent info AGENT
      roco agent info router --format json
    """
    with problems(form):
        fleet = targets.find(target, run_dir)
        before = named(fleet, name)
        row = next(row for row in measured(fleet) if row.name == name)
        design = fleet.system.design
        channels = dict(design.peers(name)) if name in design.agents else {}
        told = Info(fleet.where, row, before.beat, channels, fleet.log(name, LOG_LINES))
        if form is Format.JSON:
            tell_json(told)
        else:
            show(told, Console())


def stop(name: Process, target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Stop a process in order; it stays down until `roco agent start`, and `roco status` says so.

    Examples:
      roco agent stop AGENT
      roco agent stop monitor --target compose
    """
    with problems(form):
        fleet = targets.find(target, run_dir)
        named(fleet, name)
        turn(fleet, name, (False,), f"stopped; `roco agent start {name}` starts it", form)


def start(name: Process, target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Start a process that was stopped or given up, and wait until it is ready.

    Examples:
      roco agent start AGENT
    """
    with problems(form):
        fleet = targets.find(target, run_dir)
        given_up = named(fleet, name).status.state is ProcessState.GIVEN_UP
        turn(fleet, name, (False, True) if given_up else (True,), "ready", form)


def restart(name: Process, target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Restart a process, and wait until it is ready. An agent goes on from its journal.

    Examples:
      roco agent restart AGENT
      roco agent restart monitor --format json
    """
    with problems(form):
        fleet = targets.find(target, run_dir)
        named(fleet, name)
        turn(fleet, name, (False, True), "ready", form)


def turn(fleet: Target, name: str, ways: tuple[bool, ...], text: str, form: Format) -> None:
    """Switch a process off (False) or on (True), one after the other, each waited for; tell what became of it."""
    began = time.monotonic()
    with waiting(f"{name} {'starts' if ways[0] else 'stops'}", form) as say:
        for on in ways:
            say(f"{name} {'starts' if on else 'stops'}")
            one = switched(fleet, name, on=on)
    tell(Done(name, one.status.state, one.status.pid, time.monotonic() - began, text), form)


def named(fleet: Target, name: str) -> Seen:
    """A process of a fleet. UsageError where it has none of that name."""
    found = fleet.look().seen
    for one in found:
        if one.name == name:
            return one
    there_are = ", ".join(one.name for one in found) or "none"
    raise UsageError(f"no process of {fleet.where} is called {name!r}; there are: {there_are}")


def switched(fleet: Target, name: str, *, on: bool) -> Seen:
    """Start it and wait until it is ready, or end it and wait until it is gone. FleetError: not in time, given up."""
    fleet.switch(name, on)
    wanted, patience_s = (ProcessState.READY, READY_S) if on else (ProcessState.STOPPED, STOP_S)
    until = time.monotonic() + patience_s
    while True:
        one = named(fleet, name)
        if one.status.state is wanted:
            return one
        if on and one.status.state is ProcessState.GIVEN_UP:
            raise FleetError(f"{name} cannot start: {one.status.note}", fleet.log(name, LOG_LINES))
        if time.monotonic() > until:
            what = f"{name} is {one.status.state} after {patience_s:.0f} s, not {wanted}"
            raise FleetError(what, fleet.log(name, LOG_LINES))
        time.sleep(PERIOD_S)


def tell(done: Done, form: Format) -> None:
    """Print what became of it."""
    if form is Format.JSON:
        tell_json(done)
    else:
        print(f"{done.name}: {done.text}{f', pid {done.pid}' if done.pid else ''}, after {done.took_s:.1f} s")


def show(told: Info, console: Console) -> None:
    """For people."""
    row, beat = told.row, told.beat or Beat()
    console.print(Text.assemble((row.name, "bold"), f"  {row.state}  ", (told.where, "dim")))
    if row.trouble:
        console.print(row.trouble, style="red")
    console.print(pairs((name, value) for name, value in facts(row, beat, told.channels).items() if value))
    if beat.inside is not None:
        show_inside(beat.inside, console)
    if told.log:
        console.print("last lines it wrote", style="dim")
    for line in told.log:
        console.print(f"  {line}", highlight=False, soft_wrap=True)


def facts(row: Row, beat: Beat, channels: dict[str, str]) -> dict[str, str]:
    """Return the known facts by name; "" for unknown ones."""
    peers = (
        f"{peer}{' on ' + channels[peer] if peer in channels else ''}{f', life {life}' if life else ' (gone)'}"
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
        "parameters": ", ".join(f"{name} = {worded(value)}" for name, value in beat.parameters.items()),
        "log level": beat.level,
        "counts": ", ".join(f"{count} {name}" for name, count in sorted(beat.counts.items())),
    }


def _by_peer(counts: dict[str, int]) -> str:
    return ", ".join(f"{count} to {peer}" for peer, count in counts.items() if count)


# --- `roco agent repair NAME`: make the damaged journal of an agent usable again, while it does not run --------------


Agent = Annotated[str, typer.Argument(metavar="AGENT", help="An agent.", autocompletion=living_names.processes)]


def repair(agent: Agent, run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Repair the damaged journal of an agent that does not run.

    The newest record that is whole is kept, and the damaged file beside it. Where something came after that record,
    peers may know of it: they begin again with this agent, and open conversations end.

    Examples:
      roco agent repair AGENT
      roco agent repair AGENT --run-dir runs/latest
    """
    with problems(form):
        file = journal_file(folders.find(run_dir), agent)
        try:
            done = repaired(file)
        except JournalError as error:
            raise FleetError(str(error)) from error
        except OSError as error:
            raise FleetError(f"journal {file} cannot be repaired: {error.strerror}; nothing was changed") from error
        if form is Format.JSON:
            tell_json(done)
        else:
            print(_words(agent, done))


def _words(agent: str, done: Repaired) -> str:
    if not done.kept:
        return f"{agent}: the journal is whole; nothing to repair"
    where = f" at byte {', '.join(map(str, done.damaged))}" if done.damaged else " at its end"
    return f"{agent}: {done.path} was damaged{where}\nlost: {done.lost}\nkept as it was: {done.kept}"
