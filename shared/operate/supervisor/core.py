"""Next actions of the supervisor, from the wanted fleet, the state of each process and the time.

No clock, no process and no file in here: the shell tells what happened (events) and does what comes out (actions), so
every order of starts, deaths and stops can be tested. A process that was ready once is restarted for ever; one that
dies again and again before it is ready is given up.
"""

import msgspec

from operate.run_folder import ProcessState, ProcessStatus
from operate.supervisor.processes import Process

FIRST_PAUSE_S = 0.2  # before the first restart; doubles with each failure in a row
LONGEST_PAUSE_S = 5.0  # estimate: a person still sees that something happens
SETTLED_S = 30.0  # ready for so long: earlier failures are forgotten
ATTEMPTS = 6  # in a row without being ready once (about 6 s): given up
OFF = "stopped by hand"
"""Note of what shall not run until somebody says so."""
USAGE_ERROR = 2  # exit code of a wrong option or environment: trying again cannot help

RUNNING = (ProcessState.STARTING, ProcessState.READY, ProcessState.STOPPING)


class Known(msgspec.Struct, frozen=True):
    """State of a process; `since`: when it entered its state [s]; `due`: when it is started again [s]."""

    process: Process
    state: ProcessState = ProcessState.WAITING
    since: float = 0.0
    pid: int = 0
    restarts: int = 0
    failures: int = 0
    due: float = 0.0
    killed: bool = False
    note: str = ""

    @property
    def running(self) -> bool:
        """Tell whether there is a process to speak of."""
        return self.state in RUNNING


class Fleet(msgspec.Struct, frozen=True):
    """All processes by name, in the order of the table; `stopping`: the end was asked for; `off`: who shall not run."""

    known: dict[str, Known]
    stopping: bool = False
    off: frozenset[str] = frozenset()

    @property
    def ready(self) -> bool:
        """All that must be ready are."""
        return all(known.state is ProcessState.READY or known.process.optional for known in self.known.values())

    @property
    def ended(self) -> bool:
        """Nothing runs any more, after the end was asked for."""
        return self.stopping and not any(known.running for known in self.known.values())

    @property
    def status(self) -> tuple[ProcessStatus, ...]:
        """The fleet for fleet.json."""
        return tuple(
            ProcessStatus(
                name,
                known.state,
                known.pid if known.running else 0,
                known.restarts,
                known.note,
                known.process.optional,
                known.process.module,
            )
            for name, known in self.known.items()
        )


class Event(msgspec.Struct, frozen=True):
    """Something happened to the process `name`."""

    name: str


class Started(Event, frozen=True):
    """It runs under this pid."""

    pid: int


class Refused(Event, frozen=True):
    """It could not be started, and why; trying again cannot help."""

    reason: str


class Ready(Event, frozen=True):
    """It can serve."""


class Exited(Event, frozen=True):
    """It ended with this code (negative: the signal). `last`: the last line it wrote."""

    code: int
    last: str = ""


class Action(msgspec.Struct, frozen=True):
    """Do this to the process `name`."""

    name: str


class Start(Action, frozen=True):
    """Start it."""


class Terminate(Action, frozen=True):
    """Ask it to end in order (SIGTERM)."""


class Kill(Action, frozen=True):
    """End it at once (SIGKILL)."""


def begin(processes: tuple[Process, ...], now: float) -> Fleet:
    """Make a fleet of which nothing runs yet. ValueError names a process that waits for one that comes later or not."""
    names: list[str] = []
    for process in processes:
        missing = [name for name in process.after if name not in names]
        if missing:
            raise ValueError(
                f"{process.name} starts after {', '.join(missing)}, but {names or 'nothing'} stands before it"
            )
        names.append(process.name)
    return Fleet({process.name: Known(process, since=now) for process in processes})


def take(fleet: Fleet, event: Event, now: float) -> Fleet:
    """Take in what happened."""
    known = fleet.known[event.name]
    match event:
        case Started(pid=pid):
            changed = msgspec.structs.replace(known, state=ProcessState.STARTING, pid=pid, since=now, note="")
        case Refused(reason=reason):
            changed = msgspec.structs.replace(known, state=ProcessState.GIVEN_UP, since=now, note=reason)
        case Ready() if known.state is ProcessState.STARTING:
            changed = msgspec.structs.replace(known, state=ProcessState.READY, since=now)
        case Exited(code=code, last=last):
            changed = _exited(known, code, last, now, fleet.stopping, event.name in fleet.off)
        case _:
            changed = known
    return msgspec.structs.replace(fleet, known={**fleet.known, event.name: changed})


def stop(fleet: Fleet) -> Fleet:
    """Ask for the end of everything."""
    return msgspec.structs.replace(fleet, stopping=True)


def switch(fleet: Fleet, off: frozenset[str], now: float) -> Fleet:
    """Note who shall not run now; who shall again, begins as if nothing had failed. Unknown names are left out."""
    off &= fleet.known.keys()
    if off == fleet.off:
        return fleet
    again = {
        name: msgspec.structs.replace(known, state=ProcessState.WAITING, since=now, failures=0, killed=False, note="")
        for name, known in fleet.known.items()
        if name in fleet.off - off and not known.running
    }
    resting = {
        name: msgspec.structs.replace(known, state=ProcessState.STOPPED, since=now, note=OFF)
        for name, known in fleet.known.items()
        if name in off - fleet.off and not known.running
    }
    return msgspec.structs.replace(fleet, known={**fleet.known, **again, **resting}, off=off)


def decide(fleet: Fleet, now: float) -> tuple[Fleet, list[Action]]:
    """Say what to do now; the fleet that comes back has it noted, so nothing is ordered twice."""
    actions: list[Action] = []
    changed = dict(fleet.known)
    for name, known in fleet.known.items():
        ends = fleet.stopping or name in fleet.off
        action = _ending(fleet, known, now) if ends else _beginning(fleet, known, now)
        if action is not None:
            changed[name] = _ordered(known, action, now)
            actions.append(action)
    return msgspec.structs.replace(fleet, known=changed), actions


def _beginning(fleet: Fleet, known: Known, now: float) -> Action | None:
    """Start what waits once all before it are ready, and again what died once its pause is over."""
    if known.state is ProcessState.WAITING and all(_awaited(fleet.known[name], now) for name in known.process.after):
        return Start(known.process.name)
    if known.state is ProcessState.BACKING_OFF and now >= known.due:
        return Start(known.process.name)
    return None


def _awaited(known: Known, now: float) -> bool:
    """Tell whether the processes behind this one may start."""
    if known.state is ProcessState.READY:
        return True
    over = known.state is ProcessState.GIVEN_UP or now - known.since > known.process.patience_s
    return known.process.optional and known.state is not ProcessState.WAITING and over


def _ending(fleet: Fleet, known: Known, now: float) -> Action | None:
    """End a process once those that started after it have ended; kill it when it takes too long."""
    name = known.process.name
    if known.state is ProcessState.STOPPING:
        late = now - known.since > known.process.stop_within_s
        return Kill(name) if late and not known.killed else None
    if not known.running or (fleet.stopping and _needed(fleet, name)):
        return None
    return Terminate(name)


def _needed(fleet: Fleet, name: str) -> bool:
    """Tell whether one that started after it still runs."""
    return any(other.running for other in fleet.known.values() if name in other.process.after)


def _ordered(known: Known, action: Action, now: float) -> Known:
    """Note an action that was ordered."""
    if isinstance(action, Start):
        again = known.restarts + (known.state is ProcessState.BACKING_OFF)
        return msgspec.structs.replace(known, state=ProcessState.STARTING, since=now, restarts=again)
    if isinstance(action, Terminate):
        return msgspec.structs.replace(known, state=ProcessState.STOPPING, since=now)
    return msgspec.structs.replace(
        known, killed=True, note=f"killed: did not stop in {known.process.stop_within_s:g} s"
    )


def _exited(known: Known, code: int, last: str, now: float, stopping: bool, off: bool) -> Known:
    """Note an end: wanted, worth another attempt, or hopeless."""
    if off:
        return msgspec.structs.replace(known, state=ProcessState.STOPPED, since=now, note=OFF)
    if stopping:
        return msgspec.structs.replace(known, state=ProcessState.STOPPED, since=now)
    if known.state is ProcessState.STOPPING:  # was switched off and on again before it had ended
        return msgspec.structs.replace(known, state=ProcessState.WAITING, since=now, failures=0, killed=False, note="")
    was_ready = known.state is ProcessState.READY
    settled = was_ready and now - known.since > SETTLED_S
    failures = 1 if settled else known.failures + 1
    how = f"killed by signal {-code}" if code < 0 else f"ended with code {code}"
    note = f"{how}: {last}" if last else how
    if code == USAGE_ERROR or (not was_ready and failures >= ATTEMPTS):
        return msgspec.structs.replace(known, state=ProcessState.GIVEN_UP, since=now, failures=failures, note=note)
    pause = min(FIRST_PAUSE_S * 2.0 ** min(failures - 1, 10), LONGEST_PAUSE_S)
    return msgspec.structs.replace(
        known, state=ProcessState.BACKING_OFF, since=now, failures=failures, due=now + pause, note=note
    )
