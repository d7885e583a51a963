"""`roco status`: what runs, and what it is at."""

import datetime as dt
import socket
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import msgspec
import typer

from agent_runtime.io import fleet_processes
from agent_runtime.io.fleet_processes import variables
from agent_runtime.io.run_files import KEYS_FOLDER, KEYS_VARIABLE
from console.errors import AS_WANTED, NO, NOTHING_RUNS
from console.fleet import process_status, targets
from console.fleet.local import Local
from console.fleet.process_status import Look, Task, stuck, trouble
from console.fleet.targets import Target
from console.output import Form, Format, RunDir, tell_json
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
    told, problem = process_status.tasks_of(fleet)
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
    """Show the fleet's processes and the tasks. Exits with 1 if a process is not ready, frozen or
    hanging, or if no supervisor runs, with 3 if nothing runs. Names an expired certificate that may
    be the reason.

    Examples:
      roco status
      roco status --format json
      roco status --target compose
    """
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


# --- From when until when the keys of a fleet hold ------------------------------------------------


class KeyTimes(msgspec.Struct, frozen=True):
    """The time (UTC) in which all certificates of a folder hold.

    `late`: the file of the one that begins last, at `begin`; `early`: of the one that ends first,
    at `end`.
    """

    folder: Path
    begin: dt.datetime
    late: str
    end: dt.datetime
    early: str

    def trouble(self, now: dt.datetime) -> str:
        """Return why a certificate does not hold now, "" if all do."""
        if now >= self.end:
            return (
                f"the certificate {self.folder / self.early} ended at {self.end:%Y-%m-%d %H:%M} UTC"
            )
        if now < self.begin:
            return (
                f"the certificate {self.folder / self.late} holds only from"
                f" {self.begin:%Y-%m-%d %H:%M} UTC"
            )
        return ""


def key_folder(fleet: Target, now: Look) -> Path | None:
    """Return the folder of keys that a fleet on this machine uses, by a look at it; None without
    one.
    """
    if not isinstance(fleet, Local):
        return None
    pid = next((one.status.pid for one in now.seen if one.status.pid), 0)
    folder = Path(variables(pid).get(KEYS_VARIABLE) or fleet.run / KEYS_FOLDER)
    return folder if folder.is_dir() else None


def key_times(folder: Path) -> KeyTimes | None:
    """Return when the certificates of a folder hold; None where it has none. Raise OSError,
    ValueError.
    """
    from agent_runtime.io import issuing  # most verbs look at no certificate

    found = [(issuing.lifetime(file), file.name) for file in folder.glob("*.pem")]
    if not found:
        return None
    begin, late = max((begin, name) for (begin, _), name in found)
    end, early = min((end, name) for (_, end), name in found)
    return KeyTimes(folder, begin, late, end, early)


# --- Ports of a fleet's pictures, and which of those that are set another program has -------------


HOST = "127.0.0.1"
SWITCH, GRPC, WEB = "ROCO_VIEW", "ROCO_VIEW_GRPC", "ROCO_VIEW_WEB"
CONNECT_S = 1.0
MONITOR = "monitor"


class Taken(NamedTuple):
    """A port that is set for the pictures and that another program has."""

    variable: str
    port: int

    @property
    def words(self) -> str:
        return f"another program listens at port {self.port} ({self.variable})"

    @property
    def remedy(self) -> str:
        return (
            "end that program, and the pictures come; or `roco down`, and `roco up` with another"
            f" {self.variable}"
        )


def taken(fleet: Target, now: Look) -> Iterator[Taken]:
    """Yield what keeps the monitor of a fleet on this machine from serving pictures."""
    if not isinstance(fleet, Local) or not any(
        one.name == MONITOR and one.status.pid for one in now.seen
    ):
        return
    if fleet.variable(MONITOR, SWITCH) == "off":
        return
    for name in (GRPC, WEB):
        text = fleet.variable(MONITOR, name)
        port = int(text) if text.isdecimal() else 0
        # A connection would have the monitor draw.
        if 0 < port < 65536 and not fleet_processes.listens(fleet.run, port) and listens(port):
            yield Taken(name, port)


def listens(port: int, host: str = HOST) -> bool:
    """Whether somebody listens at this port of this machine."""
    with socket.socket() as probe, suppress(OSError):  # no such host
        probe.settimeout(CONNECT_S)
        return probe.connect_ex((host, port)) == 0
    return False
