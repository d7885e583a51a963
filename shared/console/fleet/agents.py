"""`roco agents`: every process of the fleet in a line, all that is known of one, or what the agents
offer; `roco agent`: one process stopped, started, restarted, paused, repaired.
"""

import time
from functools import partial
from typing import Annotated

import msgspec
import typer

from agent_runtime.core.control import Order, Pause, Resume
from agent_runtime.core.errors import JournalError
from agent_runtime.io.journal import Repaired, journal_file
from agent_runtime.io.journal import repair as repaired
from console import completion
from console.errors import NO, FleetError, NoRunError
from console.fleet import operator, targets
from console.fleet.process_status import Info, Row, Seen, rows
from console.fleet.targets import LOG_LINES, Target, named
from console.output import Form, Format, RunDir, argument, option, tell
from console.runs import folders
from operate.doing import doing
from operate.fleet_file import ProcessState

BETWEEN_S = 0.5
"""Between the two looks whose difference is the share of a processor: 50 ticks of the kernel's
clock.
"""


class Agents(msgspec.Struct, frozen=True):
    """`roco agents --format json`."""

    where: str
    agents: tuple[Row, ...]


def agents(
    names: Annotated[
        list[str] | None,
        argument("All that is known of these.", complete=targets.processes, metavar="[NAME]..."),
    ] = None,
    offers: Annotated[
        bool, option("What they offer and ask, as the design says.", "--offers")
    ] = False,
    protocol: Annotated[
        str,
        option("Who offers this protocol, or use of one.", complete=completion.protocols_and_uses),
    ] = "",
    ontology: Annotated[
        str, option("Offers of this ontology.", complete=completion.ontologies)
    ] = "",
    language: Annotated[
        str, option("Offers in this language.", complete=completion.languages)
    ] = "",
    up: Annotated[bool, option("Offers of agents that are up.", "--up")] = False,
    long: Annotated[
        bool, option("Offers with arguments and answers of each act.", "--long")
    ] = False,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Show every process: state, heartbeat's age, processor, memory, pid, life, restarts,
    communicates that wait.

    Exits with 1 if something is wrong with a process, with 3 if nothing runs. `life` is the agent's
    incarnation, `again` the number of its restarts, `waits` the number of communicates that wait to
    be sent or receipted.

    With NAME it shows all that is known of a process: its row, its peers, what waits, its counters,
    its last lines; for an agent also its parameters, inbox, open conversations and last steps.

    With --offers it shows who offers which protocol, ontology, language and kinds of queries, and
    who is up. The offers come from the design: an agent offers the protocols in which it is the
    participant. Exits with 1 if no agent matches.

    Examples:
      roco agents
      roco agents --target compose
      roco agents AGENT
      roco agents router --format json
      roco agents --offers
      roco agents AGENT --offers --long
      roco agents --protocol request --up --format json
    """
    if offers or protocol or ontology or language or up or long:
        from console.fleet.offers import Search, offered  # most calls ask for processes

        search = Search(tuple(names or ()), protocol, ontology, language)
        offered(search, target, run_dir, form, up=up, long=long)
        return
    fleet = targets.find(target, run_dir)
    if names:
        for told in info(fleet, names):
            tell(told, form, partial(_show, told))
        return
    found = measured(fleet)
    tell(Agents(fleet.where, found), form, partial(_show, found))
    if not any(row.pid for row in found):
        raise NoRunError(fleet.where, f"nothing of {fleet.where} runs; `roco up` starts a fleet")
    if any(row.trouble for row in found):
        raise typer.Exit(NO)


def _show(found: Info | tuple[Row, ...]) -> None:
    from console.fleet import process_tables  # a program that reads JSON needs no rich

    if isinstance(found, Info):
        process_tables.show_info(found)
    else:
        process_tables.show_agents(found)


def info(fleet: Target, names: list[str]) -> list[Info]:
    """All that is known of these processes. UsageError where one is not there."""
    beats = {name: named(fleet, name).beat for name in names}
    by_name, design = {row.name: row for row in measured(fleet)}, fleet.system.design
    found = []
    for name, beat in beats.items():
        peers = dict(design.peers(name)) if name in design.agents else {}
        found.append(Info(fleet.where, by_name[name], beat, peers, fleet.log(name, LOG_LINES)))
    return found


def measured(fleet: Target, between_s: float = BETWEEN_S) -> tuple[Row, ...]:
    """Two looks a moment apart."""
    before = fleet.look()
    time.sleep(between_s if before.seen else 0.0)
    return rows(before, fleet.look())


# --- `roco agent stop|start|restart|pause|repair NAME`: one process of the fleet ------------------


Process = Annotated[str, argument("A process.", complete=targets.processes, metavar="NAME")]
Agent = Annotated[str, argument("An agent.", complete=targets.processes, metavar="AGENT")]
PERIOD_S = 0.1  # estimate: how often a waiting person's picture is renewed
STOP_S = 130.0  # the monitor may take two minutes for its reports
READY_S = 90.0  # as for the whole fleet


class Ordered(msgspec.Struct, frozen=True):
    """An agent after an order, as its heartbeat says."""

    agent: str
    paused: bool
    level: str
    text: str


class Done(msgspec.Struct, frozen=True):
    """Outcome of an action on a process, and the time it took [s]."""

    name: str
    process: ProcessState
    pid: int
    took_s: float
    text: str


def stop(
    name: Process, target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT
) -> None:
    """Stop a process in order; it stays down until `roco agent start`, and `roco status` says so.

    Examples:
      roco agent stop AGENT
      roco agent stop monitor --target compose
    """
    fleet = targets.find(target, run_dir)
    named(fleet, name)
    turn(fleet, name, (False,), f"stopped; `roco agent start {name}` starts it", form)


def start(
    name: Process, target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT
) -> None:
    """Start a process that was stopped or given up, and wait until it is ready; let a paused agent
    go on.

    Examples:
      roco agent start AGENT
    """
    fleet = targets.find(target, run_dir)
    one = named(fleet, name)
    if one.status.state is ProcessState.READY and one.beat is not None and one.beat.paused:
        ordered(fleet, name, Resume(), "goes on", form)
        return
    given_up = one.status.state is ProcessState.GIVEN_UP
    turn(fleet, name, (False, True) if given_up else (True,), "ready", form)


def restart(
    name: Process, target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT
) -> None:
    """Restart a process, and wait until it is ready. An agent goes on from its journal.

    Examples:
      roco agent restart AGENT
      roco agent restart monitor --format json
    """
    fleet = targets.find(target, run_dir)
    named(fleet, name)
    turn(fleet, name, (False, True), "ready", form)


def pause(
    agent: Agent, target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT
) -> None:
    """Let an agent take no step until `roco agent start`. It stays alive, and what is said to it
    waits.

    A physical act that has begun goes on to its end: pausing is not an emergency stop. A restart
    does not end a pause.

    Examples:
      roco agent pause AGENT
    """
    text = f"paused; `roco agent start {agent}` lets it go on"
    ordered(targets.find(target, run_dir), agent, Pause(), text, form)


def ordered(fleet: Target, agent: str, order: Order, text: str, form: Format) -> None:
    """Give an order to an agent, and tell what became of it."""
    beat = operator.order(fleet, agent, order)
    tell(Ordered(agent, beat.paused, beat.level, text), form, f"{agent}: {text}")


def turn(fleet: Target, name: str, ways: tuple[bool, ...], text: str, form: Format) -> None:
    """Switch a process off (False) or on (True), one after the other, each waited for; tell what
    became of it.
    """
    began = time.monotonic()
    with doing(f"{name} {'starts' if ways[0] else 'stops'}") as say:
        for on in ways:
            say(f"{name} {'starts' if on else 'stops'}")
            one = switched(fleet, name, on=on)
    status, took_s = one.status, time.monotonic() - began
    pid = f", pid {status.pid}" if status.pid else ""
    done = Done(name, status.state, status.pid, took_s, text)
    tell(done, form, f"{name}: {text}{pid}, after {took_s:.1f} s")


def switched(fleet: Target, name: str, *, on: bool) -> Seen:
    """Start it and wait until it is ready, or end it and wait until it is gone. FleetError: not in
    time, given up.
    """
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


# --- `roco agent repair NAME`: make the damaged journal of an agent usable again, while it does not
# run


def repair(agent: Agent, run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Repair the damaged journal of an agent that does not run.

    The newest record that is whole is kept, and the damaged file beside it. Where something came
    after that record, peers may know of it: they begin again with this agent, and open
    conversations end.

    Examples:
      roco agent repair AGENT
      roco agent repair AGENT --run-dir runs/latest
    """
    file = journal_file(folders.find(run_dir), agent)
    try:
        done = repaired(file)
    except JournalError as error:
        raise FleetError(str(error)) from error
    except OSError as error:
        raise FleetError(
            f"journal {file} cannot be repaired: {error.strerror}; nothing was changed"
        ) from error
    tell(done, form, _repair_text(agent, done))


def _repair_text(agent: str, done: Repaired) -> str:
    if not done.kept:
        return f"{agent}: the journal is whole; nothing to repair"
    where = f" at byte {', '.join(map(str, done.damaged))}" if done.damaged else " at its end"
    return (
        f"{agent}: {done.path} was damaged{where}\nlost: {done.lost}\nkept as it was: {done.kept}"
    )
