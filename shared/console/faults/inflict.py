"""A fault from its order to its end: noted, done at its moment, watched, healed, whatever ends the
command.

What goes on while its command is gone (kill -9) stands in faults.jsonl without an end: `left` finds
it, `heal` ends it.
"""

import os
import time
from collections.abc import Callable

import msgspec

from console.errors import FleetError, UsageError
from console.faults import kinds
from console.faults.kinds import KINDS, Kind
from console.fleet.agents import READY_S
from console.fleet.process_status import Seen
from console.fleet.targets import LOG_LINES, Target, named
from operate import proc
from operate.fault_lines import Fault, encoded, latest, read
from operate.fleet_file import ProcessState

PERIOD_S = 0.05
NOT_BEGUN, BROKEN_OFF = "did not begin", "broken off, healed"


def refuse(fleet: Target) -> None:
    """Raise FleetError where a fault may do harm: the system says that a real robot moves."""
    untouchable = fleet.system.addition("untouchable")
    if untouchable is not None and (why := untouchable(fleet)):
        raise FleetError(
            f"no fault is done to {fleet.where}: {why}; faults are for simulated robots"
        )


def planned(
    fleet: Target,
    kind: str,
    name: str,
    at: str,
    amount: float = 0.0,
    speaker: str = "",
    what: str = "",
) -> Fault:
    """Return a fault of a process that runs or restarts, or of the link of two agents, such as
    co-pl.

    Raise UsageError: no such process; FleetError: it does not run, and nobody restarts it.
    """
    wired = kind in KINDS and KINDS[kind].wire  # a system has kinds of its own, of no wire
    name, neighbour = ends(fleet, name) if wired else (name, "")
    one = named(fleet, name)
    if not _restarts(one) and not _runs(one):
        raise _not_running(fleet, name)
    by = os.getpid()
    return Fault(
        id=f"{kind}-{name}-{time.time_ns():x}",
        kind=kind,
        target=name,
        neighbour=neighbour,
        t=time.time(),
        at=at,
        pid=one.status.pid,
        start=one.used.start if one.used is not None else 0,
        by=by,
        by_start=proc.started(by),
        amount=amount,
        speaker=speaker,
        what=what,
    )


def _runs(one: Seen) -> bool:
    return bool(one.status.pid) and one.used is not None


def _restarts(one: Seen) -> bool:
    """Whether a process that does not run now will run again without an order."""
    # one that was killed counts as ready until its supervisor looks
    return one.status.state in {
        ProcessState.STARTING,
        ProcessState.READY,
        ProcessState.BACKING_OFF,
    }


def _not_running(fleet: Target, name: str) -> FleetError:
    return FleetError(f"{name} does not run in {fleet.where}; `roco agent start {name}` starts it")


def ends(fleet: Target, name: str) -> tuple[str, str]:
    """Return a process and "", or the two ends of a link that this names, such as co-pl."""
    known = {one.name for one in fleet.look().seen}
    first, _, second = name.partition("-")
    return (first, second) if name not in known and {first, second} <= known else (name, "")


class Inflicting:
    """One fault of a fleet. `fault`: as it was noted last; `kind`: of a fault that only this system
    has.
    """

    def __init__(self, fleet: Target, fault: Fault, kind: Kind | None = None) -> None:
        self._fleet, self.fault, self._kind = fleet, fault, kind or KINDS[fault.kind]

    def run(self, wait: Callable[[], None], for_s: float, told: Callable[[str], None]) -> Fault:
        """Note it, `wait` for its moment, do it, and heal it after `for_s` at the latest; the fault
        as it ended.

        Raise FleetError where the process is not back in time. An exception, Ctrl-C too, heals
        first.
        """
        began, text = 0.0, NOT_BEGUN
        self._note()
        try:
            wait()
            self._aim()
            with self._kind.meanwhile(self._fleet, self.fault):
                began, text = time.time(), BROKEN_OFF
                self._kind.begin(self._fleet, self.fault)
                self._note(began=began)
                told(f"{self.fault.words}: begun")
                over = self._until_over(for_s)
            self._kind.heal(self._fleet, self.fault)
            text = self._until_ready(over or f"healed after {for_s:g} s")
        finally:
            if began:
                self._kind.heal(self._fleet, self.fault)
            self._note(ended=time.time(), text=text)
        return self.fault

    def _aim(self) -> None:
        """Aim at the process that is there at the moment; wait for one that restarts. Raise
        FleetError where it does not run.
        """
        until = time.monotonic() + READY_S
        while not _runs(one := named(self._fleet, self.fault.target)):
            if not _restarts(one) or time.monotonic() > until:
                raise _not_running(self._fleet, self.fault.target)
            time.sleep(PERIOD_S)
        if one.used is not None and not kinds.same(one, self.fault):
            self._note(pid=one.status.pid, start=one.used.start)

    def _until_over(self, for_s: float) -> str:
        """Wait until it is over by itself, which is told, or its time has passed, "". FleetError:
        it never is.
        """
        until = time.monotonic() + (for_s if self._kind.lasts else READY_S)
        while not (text := self._kind.over(self._now(), self.fault)):
            if time.monotonic() > until:
                if self._kind.lasts:
                    return ""
                raise self._not_back()
            time.sleep(PERIOD_S)
        return text

    def _until_ready(self, text: str) -> str:
        """Wait for a process that another one replaces: only then the fault is over; `text`, and
        that it is back.
        """
        if kinds.same(self._now(), self.fault):
            return text
        until = time.monotonic() + READY_S
        while not kinds.back(self._now(), self.fault):
            if time.monotonic() > until:
                raise self._not_back()
            time.sleep(PERIOD_S)
        return text if text == kinds.BACK else f"{text}, back"

    def _now(self) -> Seen | None:
        return kinds.now(self._fleet, self.fault)

    def _not_back(self) -> FleetError:
        name = self.fault.target
        late = f"{name} is not back after {READY_S:.0f} s"
        return FleetError(late, self._fleet.log(name, LOG_LINES))

    def _note(self, **changes: object) -> None:
        self.fault = noted(self._fleet, msgspec.structs.replace(self.fault, **changes))


def noted(fleet: Target, fault: Fault) -> Fault:
    """Write a fault as it is now; it is returned with the time of that."""
    fault = msgspec.structs.replace(fault, t=time.time())
    fleet.add_fault(encoded(fault))
    return fault


def open_faults(fleet: Target) -> list[Fault]:
    """Return the faults that have no end yet, oldest first."""
    return [one for one in latest(read(fleet.faults())) if one.ended is None]


def left(fleet: Target) -> list[Fault]:
    """Return those of them whose command is gone."""
    faults = open_faults(fleet)
    return [one for one in faults if not (one.by and proc.started(one.by) == one.by_start)]


def heal(fleet: Target, faults: list[Fault]) -> list[Fault]:
    """Heal faults, newest first; as they are noted then."""
    healed = []
    for fault in reversed(faults):
        every = KINDS if fault.kind in KINDS else fleet.system.addition("faults") or {}
        if fault.kind not in every:
            raise UsageError(
                f"a fault of kind {fault.kind!r} was done by a newer roco; heal it with that one"
            )
        if kinds.now(fleet, fault) is not None:
            every[fault.kind].heal(fleet, fault)
        ended = msgspec.structs.replace(fault, ended=time.time(), text="healed later")
        healed.append(noted(fleet, ended))
    return healed
