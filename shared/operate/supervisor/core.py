"""Next actions of the supervisor, from the wanted fleet, the state of each process and the time.

No clock, no process and no file in here: the shell tells what happened (events) and does what comes
out (actions), so every order of starts, deaths and stops can be tested. A process that dies is
started again, after a pause that grows; one that dies again and again is given up, and if it was
ready before, the robot is to be held. One whose heartbeat stands still is killed first. Its silence
is counted by looks: a machine that was suspended kills nobody.
"""

import math
from typing import Any

import msgspec

from agent_runtime.io.options import USAGE_ERROR
from operate.fleet_file import ProcessState, ProcessStatus
from operate.system import Process

FIRST_PAUSE_S = 0.2  # before the first restart; doubles with each failure in a row
LONGEST_PAUSE_S = 5.0  # estimate: a person still sees that something happens
SETTLED_S = 30.0  # ready for so long: earlier failures are forgotten
ATTEMPTS = 6  # in a row without being ready once (about 6 s): given up
# of a process that gets ready: given up; estimate: a death each 6 s with its pauses
MOST_DEATHS, WINDOW_S = 15, 120.0
PERIOD_S = 0.05  # between two looks while anything goes on; estimate
REST_PERIODS = 4  # between two looks while all is well; who dies is seen at once all the same
# without a heartbeat, which comes each second: it is told; a hang is seen within 2 s of its begin
LATE_S = 1.9
# to the first heartbeat; estimate: a fleet needs 9 s at a load of 5 (benchmarks)
BORN_WITHIN_S = 60.0
OFF = "stopped by hand"
"""Note of what shall not run until somebody says so."""
LEFT = "left by a supervisor that died"

_AS_IF_NEW = {"failures": 0, "attempts": 0, "killed": False, "note": "", "deaths": ()}
RUNNING = (ProcessState.STARTING, ProcessState.READY, ProcessState.STOPPING)


class Known(msgspec.Struct, frozen=True):
    """State of a process; `since`: when it entered its state [s]; `due`: when it is started again
    [s].

    `failures`: ends in a row, which lengthen the pause; `attempts`: of these, since it was ready
    last. `served`: whether it was ever ready. `beaten`: whether it had a heartbeat since it was
    started; `silent`: periods since then, by looks. `deaths`: when it died within WINDOW_S, after
    it had been ready [s].
    """

    process: Process
    state: ProcessState = ProcessState.WAITING
    since: float = 0.0
    pid: int = 0
    restarts: int = 0
    failures: int = 0
    attempts: int = 0
    served: bool = False
    due: float = 0.0
    killed: bool = False
    note: str = ""
    beaten: bool = False
    silent: int = 0
    deaths: tuple[float, ...] = ()

    @property
    def silence_s(self) -> float:
        """Time without a heartbeat, by looks [s]."""
        return self.silent * PERIOD_S

    @property
    def patience_s(self) -> float:
        """Silence after which it is killed [s]; infinite for one that is ready and has never
        beaten.
        """
        if self.beaten:
            return self.process.hangs_s
        return math.inf if self.state is ProcessState.READY else BORN_WITHIN_S

    @property
    def running(self) -> bool:
        """Tell whether there is a process to speak of."""
        return self.state in RUNNING


class Fleet(msgspec.Struct, frozen=True):
    """All processes by name, in the order of the table; `stopping`: the end was asked for; `off`:
    who shall not run.
    """

    known: dict[str, Known]
    stopping: bool = False
    off: frozenset[str] = frozenset()

    @property
    def ready(self) -> bool:
        """All that must be ready are."""
        return all(
            known.state is ProcessState.READY or known.process.optional
            for known in self.known.values()
        )

    @property
    def failing(self) -> tuple[str, ...]:
        """Processes that were ready once and were given up: without them the robot is to be held.

        Nobody waits for an optional one, and the robot need not either.
        """
        return tuple(
            name
            for name, known in self.known.items()
            if known.state is ProcessState.GIVEN_UP and known.served and not known.process.optional
        )

    @property
    def resting(self) -> bool:
        """Each of them is ready or given up, and nothing is to be done."""
        at_rest = (ProcessState.READY, ProcessState.GIVEN_UP)
        return not self.stopping and all(known.state in at_rest for known in self.known.values())

    @property
    def ended(self) -> bool:
        """Nothing runs any more, after the end was asked for."""
        return self.stopping and not any(known.running for known in self.known.values())

    @property
    def status(self) -> tuple[ProcessStatus, ...]:
        """The fleet for fleet.json."""
        found = []
        for name, known in self.known.items():
            pid, what = known.pid if known.running else 0, known.process
            told = (known.state, pid, known.restarts, known.note, what.optional, what.module)
            found.append(ProcessStatus(name, *told))
        return tuple(found)


class Event(msgspec.Struct, frozen=True):
    """Something happened to the process `name`."""

    name: str


class Started(Event, frozen=True):
    """It runs under this pid."""

    pid: int


class Found(Event, frozen=True):
    """It runs already under this pid: a supervisor that died left it."""

    pid: int


class Refused(Event, frozen=True):
    """It could not be started, and why; trying again cannot help."""

    reason: str


class NotStarted(Event, frozen=True):
    """The machine could not start it now, and why: it may later, so it is tried without end."""

    reason: str


class Ready(Event, frozen=True):
    """It can serve."""


class Exited(Event, frozen=True):
    """It ended with this code (negative: the signal). `last`: its exception, or the last line it
    wrote.
    """

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
    """Make a fleet of which nothing runs yet. ValueError names a process that waits for one that
    comes later or not.
    """
    names: list[str] = []
    for process in processes:
        missing = [name for name in process.after if name not in names]
        if missing:
            raise ValueError(
                f"{process.name} starts after {', '.join(missing)}, but {names or 'nothing'} stands"
                " before it"
            )
        names.append(process.name)
    return Fleet({process.name: Known(process, since=now) for process in processes})


def take(fleet: Fleet, event: Event, now: float) -> Fleet:
    """Take in what happened."""
    known = fleet.known[event.name]
    match event:
        case Started(pid=pid):
            changed = _entered(known, ProcessState.STARTING, now, pid=pid, note="")
        case Found(pid=pid):
            changed = _entered(known, ProcessState.READY, now, pid=pid, note=LEFT, served=True)
        case Refused(reason=reason):
            changed = _entered(known, ProcessState.GIVEN_UP, now, note=reason)
        case NotStarted(reason=reason):
            failures = known.failures + 1
            later = {"failures": failures, "due": now + _pause(failures), "note": reason}
            changed = _entered(known, ProcessState.BACKING_OFF, now, **later)
        case Ready() if known.state is ProcessState.STARTING:
            changed = _entered(known, ProcessState.READY, now, attempts=0, served=True)
        case Exited(code=code, last=last):
            changed = _exited(known, code, last, now, fleet.stopping, event.name in fleet.off)
        case _:
            changed = known
    return msgspec.structs.replace(fleet, known={**fleet.known, event.name: changed})


def _entered(known: Known, state: ProcessState, now: float, **more: Any) -> Known:
    """A process that enters a state, with what else changes."""
    return msgspec.structs.replace(known, state=state, since=now, **more)


def look(fleet: Fleet, beats: frozenset[str], periods: int = 1) -> Fleet:
    """Note a look after so many periods, and whose heartbeat it found changed.

    Who has been silent for long is told by its note.
    """
    changed = {
        name: _looked_at(known, name in beats, periods) for name, known in fleet.known.items()
    }
    return msgspec.structs.replace(fleet, known=changed)


def _looked_at(known: Known, beats: bool, periods: int) -> Known:
    if beats:
        note = "" if known.silence_s >= LATE_S else known.note
        return msgspec.structs.replace(known, beaten=True, silent=0, note=note)
    if known.state not in (ProcessState.STARTING, ProcessState.READY):
        return known
    silent = msgspec.structs.replace(known, silent=known.silent + periods)
    if known.beaten and silent.silence_s >= LATE_S and not known.killed:
        note = f"hangs: no heartbeat for {int(silent.silence_s)} s"
        return msgspec.structs.replace(silent, note=note)
    return silent


def stop(fleet: Fleet) -> Fleet:
    """Ask for the end of everything."""
    return msgspec.structs.replace(fleet, stopping=True)


def switch(fleet: Fleet, off: frozenset[str], now: float) -> Fleet:
    """Note who shall not run now; who shall again, begins as if nothing had failed. Unknown names
    are left out.
    """
    off &= fleet.known.keys()
    if off == fleet.off:
        return fleet
    changed = dict(fleet.known)
    for name in off ^ fleet.off:
        if not changed[name].running and name in off:
            changed[name] = _entered(changed[name], ProcessState.STOPPED, now, note=OFF)
        elif not changed[name].running:
            changed[name] = _entered(changed[name], ProcessState.WAITING, now, **_AS_IF_NEW)
    return msgspec.structs.replace(fleet, known=changed, off=off)


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
    """Start what waits once all before it are ready, and again what died once its pause is over;
    kill what hangs.
    """
    if known.state is ProcessState.WAITING and all(
        _awaited(fleet.known[name], now) for name in known.process.after
    ):
        return Start(known.process.name)
    if known.state is ProcessState.BACKING_OFF and now >= known.due:
        return Start(known.process.name)
    watched = known.state in (ProcessState.STARTING, ProcessState.READY) and not known.killed
    return Kill(known.process.name) if watched and known.silence_s >= known.patience_s else None


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
    later = [other for other in fleet.known.values() if name in other.process.after]
    needed = fleet.stopping and any(other.running for other in later)
    return Terminate(name) if known.running and not needed else None


def _ordered(known: Known, action: Action, now: float) -> Known:
    """Note an action that was ordered."""
    if isinstance(action, Start):
        again = known.restarts + (known.state is ProcessState.BACKING_OFF)
        fresh = {"beaten": False, "silent": 0, "killed": False}
        return _entered(known, ProcessState.STARTING, now, restarts=again, **fresh)
    if isinstance(action, Terminate):
        return _entered(known, ProcessState.STOPPING, now)
    if known.state is ProcessState.STOPPING:
        why = f"did not stop in {known.process.stop_within_s:g} s"
    else:
        why = f"it hung, no heartbeat for {known.silence_s:.0f} s"
    return msgspec.structs.replace(known, killed=True, note=f"killed: {why}")


def _exited(known: Known, code: int, last: str, now: float, stopping: bool, off: bool) -> Known:
    """Note an end: wanted, worth another attempt, or hopeless."""
    if off:
        return _entered(known, ProcessState.STOPPED, now, note=OFF)
    if stopping:
        return _entered(known, ProcessState.STOPPED, now)
    if known.state is ProcessState.STOPPING:  # was switched off and on again before it had ended
        return _entered(known, ProcessState.WAITING, now, **_AS_IF_NEW)
    was_ready = known.state is ProcessState.READY
    settled = was_ready and now - known.since > SETTLED_S
    failures = 1 if settled else known.failures + 1
    attempts = 0 if was_ready else known.attempts + 1
    how = f"killed by signal {-code}" if code < 0 else f"ended with code {code}"
    note = known.note if known.killed else f"{how}: {last}" if last else how
    deaths = tuple(at for at in known.deaths if now - at < WINDOW_S) + ((now,) if was_ready else ())
    if len(deaths) >= MOST_DEATHS:
        note = f"died {len(deaths)} times within {WINDOW_S:g} s: {note}"
    counted = {"failures": failures, "attempts": attempts, "note": note, "deaths": deaths}
    if code == USAGE_ERROR or attempts >= ATTEMPTS or len(deaths) >= MOST_DEATHS:
        return _entered(known, ProcessState.GIVEN_UP, now, **counted)
    return _entered(known, ProcessState.BACKING_OFF, now, due=now + _pause(failures), **counted)


def _pause(failures: int) -> float:
    """Return the pause before the next start [s]."""
    return min(FIRST_PAUSE_S * 2.0 ** min(failures - 1, 10), LONGEST_PAUSE_S)
