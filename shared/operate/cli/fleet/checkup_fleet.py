"""Checks of `roco doctor` on a fleet: its processes, keys, and leftovers of earlier runs."""

import datetime as dt
import time
from collections.abc import Callable, Iterator

from operate.cli.fleet import running_fleets
from operate.cli.fleet.checkup import Check, Level
from operate.cli.fleet.checkup_reach import refusals, router
from operate.cli.fleet.key_times import key_folder, key_times
from operate.cli.fleet.local import Local
from operate.cli.fleet.picture_ports import taken
from operate.cli.fleet.process_status import Look, Seen, stuck, trouble
from operate.cli.fleet.targets import Target
from operate.run_folder import ProcessState

SOON = dt.timedelta(hours=12)
"""A certificate that ends before is told: a run may go on over night (estimate)."""
AHEAD_S = 1.0
"""A file from the future by more than this: the clock was set back."""


def processes(fleet: Target, now: Look) -> Iterator[Check]:
    """Each process that is not as it should be; all in one row where none is."""
    seen = now.seen
    running = [one for one in seen if one.status.pid]
    if not running:
        yield Check("fleet", Level.NOTE, f"nothing of {fleet.where} runs", "`roco up` starts a fleet")
        return
    wrong = [check for one in seen if (check := _process(one))]
    yield from wrong
    if not wrong:
        yield Check("fleet", Level.FINE, f"{len(running)} processes of {fleet.where}, all ready")


def _process(one: Seen) -> Check | None:
    """Return the check of a process with a problem and its remedy; None if it has none."""
    name, status = one.name, one.status
    log = f"see {name}.log of the run"
    remedies = {
        ProcessState.STOPPED: f"`roco agent start {name}`",
        ProcessState.GIVEN_UP: f"{log}, then `roco agent start {name}`",
        ProcessState.BACKING_OFF: f"it is started again; {log} if it goes on",
        ProcessState.STARTING: f"wait; {log} if it goes on",
        ProcessState.WAITING: "it waits for others; see those",
    }
    words = stuck(one)
    if words and one.used is not None and one.used.frozen:
        return Check(name, Level.WRONG, words, f"kill -CONT {status.pid}, or `roco agent restart {name}`")
    if words:
        return Check(name, Level.WRONG, words, f"`roco agent restart {name}`; {log}")
    if status.state in remedies:
        level = Level.NOTE if status.optional else Level.WRONG
        words = f"{status.state}{': ' + status.note if status.note else ''}"
        return Check(name, level, words, remedies[status.state])
    words = trouble(one)
    if words and one.beat is not None and words == one.beat.trouble:
        return Check(name, Level.WRONG, words, "make room (`df -h`, `roco runs remove`); it goes on by itself")
    return Check(name, Level.WRONG, words, f"`roco agent restart {name}`; {log}") if words else None


def supervisor(fleet: Target, now: Look) -> Iterator[Check]:
    """Processes that nobody keeps."""
    told = now.fleet
    if not isinstance(fleet, Local) or told is None:
        return
    if now.unkept:
        yield Check("supervisor", Level.WRONG, now.unkept, f"`roco down --run-dir {fleet.run}`, then `roco up`")
    elif any(status.pid for status in told.processes):
        yield Check("supervisor", Level.FINE, f"lives, pid {told.supervisor}")


def held(fleet: Target, now: Look) -> Iterator[Check]:
    """Whether the robot may move."""
    if now.stop_held:
        yield Check("stop", Level.NOTE, "the robot is held", "`roco release` lets it move")


def certificates(fleet: Target, now: Look) -> Iterator[Check]:
    """Yield a check of how long the keys are still valid."""
    folder = key_folder(fleet, now)
    if folder is None:
        return
    times, at = key_times(folder), dt.datetime.now(dt.UTC)
    anew = "`roco down`, then `roco up` makes them anew; keys of `--keys`: `roco keys make`"
    if times is None:
        yield Check("keys", Level.WRONG, f"no certificate in {folder}", anew)
    elif why := times.trouble(at):
        yield Check("keys", Level.WRONG, why, anew)
    else:
        soon = times.end - at < SOON
        words = f"hold until {times.end:%Y-%m-%d %H:%M} UTC"
        yield Check("keys", Level.NOTE if soon else Level.FINE, words, "restart the fleet before then" if soon else "")


def clock(fleet: Target, now: Look) -> Iterator[Check]:
    """Whether a heartbeat comes from the future."""
    if not isinstance(fleet, Local):
        return
    ahead = max((file.stat().st_mtime for file in fleet.run.glob("*.heartbeat.json")), default=0.0) - time.time()
    if ahead > AHEAD_S:
        what = f"heartbeats are {ahead:.0f} s ahead of the clock: it was set back"
        yield Check("clock", Level.WRONG, what, "`roco down`, then `roco up`")


def stale(fleet: Target, now: Look) -> Iterator[Check]:
    """Processes of other runs that were left behind."""
    here = fleet.run if isinstance(fleet, Local) else None
    for one in running_fleets.here():
        if one.run.resolve() == here:
            continue
        alone = "" if one.fleet.supervisor else ", without a supervisor"
        what = f"{len(one.names)} processes of {one.run} live too{alone}"
        level = Level.NOTE if one.fleet.supervisor else Level.WRONG
        yield Check("other runs", level, what, f"`roco down --run-dir {one.run}`")


def pictures(fleet: Target, now: Look) -> Iterator[Check]:
    """Whether the ports that are set for the pictures are the monitor's own."""
    for port in taken(fleet, now):
        yield Check("pictures", Level.WRONG, f"none: {port.words}", port.remedy)


FLEET: dict[str, Callable[[Target, Look], Iterator[Check]]] = {
    "processes": processes,
    "supervisor": supervisor,
    "router": router,
    "refusals": refusals,
    "stop": held,
    "keys": certificates,
    "pictures": pictures,
    "clock": clock,
    "other runs": stale,
}
