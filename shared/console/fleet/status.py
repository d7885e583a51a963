"""`roco status`: what runs, and what it is at."""

import datetime as dt
import time
from collections.abc import Iterator
from contextlib import suppress

import msgspec
import typer

from console.errors import AS_WANTED, NO, NOTHING_RUNS
from console.fleet import targets, tasks
from console.fleet.key_times import key_folder, key_times
from console.fleet.picture_ports import taken
from console.fleet.process_status import Look, stuck, trouble
from console.fleet.targets import Target
from console.fleet.tasks import Task
from console.output import Form, Format, RunDir, problems, tell_json
from operate.fleet_file import Fleet, ProcessState


class Status(msgspec.Struct, frozen=True):
    """The fleet, the tasks, whether the robot is held; `problem`: why no task is known; `troubles`:
    by process.

    `unheard`: who is not heard by whom, a sentence each; `paused`: agents that take no step.
    `stuck`: processes that are frozen or hang; `unkept`: why nobody looks after the fleet. `keys`:
    the certificate that does not hold. `pictures`: why there are none, where another program has
    their port.
    """

    run: str
    fleet: Fleet | None
    tasks: tuple[Task, ...]
    stop_held: bool
    problem: str = ""
    troubles: dict[str, str] = {}
    unheard: tuple[str, ...] = ()
    paused: tuple[str, ...] = ()
    stuck: tuple[str, ...] = ()
    unkept: str = ""
    keys: str = ""
    pictures: str = ""


def state_of(fleet: Target) -> Status:
    """Return the state of a run; a missing source of tasks is reported in it, not raised."""
    told, problem = tasks.of(fleet)
    now = fleet.look()
    living = [one for one in now.seen if one.status.pid]
    troubles = {one.name: words for one in living if (words := trouble(one))}
    who = tuple(unheard(now))
    starting = any(one.status.state is not ProcessState.READY for one in living)
    return Status(
        run=fleet.where,
        fleet=now.fleet,
        tasks=told,
        stop_held=now.stop_held,
        problem=problem,
        troubles=troubles,
        unheard=who,
        paused=tuple(one.name for one in living if one.beat is not None and one.beat.paused),
        stuck=tuple(one.name for one in living if stuck(one)),
        unkept=now.unkept,
        keys=_keys(fleet, now) if troubles or who or starting else "",
        pictures="; ".join(port.words for port in taken(fleet, now)),
    )


def _keys(fleet: Target, now: Look) -> str:
    """Return which certificate of a fleet in trouble does not hold."""
    # doctor tells what is wrong with a file that is no certificate
    with suppress(OSError, ValueError):
        if (folder := key_folder(fleet, now)) and (times := key_times(folder)):
            return times.trouble(dt.datetime.now(dt.UTC))
    return ""


def unheard(now: Look) -> Iterator[str]:
    """Yield a sentence for each agent that another does not hear, though both run."""
    beats = [(one.name, one.beat) for one in now.seen if one.beat and one.status.pid]
    found = [(name, line) for name, beat in beats for line in beat.unheard]
    if found:
        from agent_runtime.core import peers as of_agents

        for name, line in found:
            one = of_agents.Unheard(line.peer, line.channel, line.what, line.since)
            yield of_agents.unheard_text(name, one, time.time())


def status(target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Show the fleet's processes and the tasks. Exits with 1 where not all that must be ready are,
    where a process is frozen or hangs, no supervisor looks after them, or a certificate does not
    hold, with 3 where nothing runs.

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
            from console.fleet.process_tables import show_status

            show_status(now)
        if code := verdict(now):
            raise typer.Exit(code)


def verdict(now: Status) -> int:
    """The exit code: whether all that must be ready are, nothing hangs, and whether anything runs
    at all.
    """
    processes = now.fleet.processes if now.fleet else ()
    if not any(process.pid for process in processes):
        return NOTHING_RUNS
    missing = any(p.state is not ProcessState.READY and not p.optional for p in processes)
    return NO if missing or now.stuck or now.unkept or now.keys else AS_WANTED
