"""What `roco doctor` looks at of a fleet: its processes, router, keys, and what earlier runs left."""

import datetime as dt
import re
import socket
import time
from collections.abc import Callable, Iterator

from agent_runtime.io.run_files import KEYS_FOLDER
from operate.cli.fleet import running_fleets
from operate.cli.fleet.checkup import Check, Level
from operate.cli.fleet.local import Local
from operate.cli.fleet.process_status import Look, Seen, trouble
from operate.cli.fleet.targets import Target
from operate.run_folder import ProcessState

CONNECT_S = 2.0
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
    """What is wrong with a process, and what helps."""
    name, status = one.name, one.status
    log = f"see {name}.log of the run"
    remedies = {
        ProcessState.STOPPED: f"`roco agent start {name}`",
        ProcessState.GIVEN_UP: f"{log}, then `roco agent start {name}`",
        ProcessState.BACKING_OFF: f"it is started again; {log} if it goes on",
        ProcessState.STARTING: f"wait; {log} if it goes on",
        ProcessState.WAITING: "it waits for others; see those",
    }
    if status.state in remedies:
        level = Level.NOTE if status.optional else Level.WRONG
        words = f"{status.state}{': ' + status.note if status.note else ''}"
        return Check(name, level, words, remedies[status.state])
    words = trouble(one)
    if not words:
        return None
    if one.used is not None and one.used.frozen:
        return Check(name, Level.WRONG, words, f"kill -CONT {status.pid}, or `roco agent restart {name}`")
    return Check(name, Level.WRONG, words, f"`roco agent restart {name}`; {log}")


def supervisor(fleet: Target, now: Look) -> Iterator[Check]:
    """Processes that nobody keeps."""
    told = now.fleet
    if not isinstance(fleet, Local) or told is None:
        return
    lives = any(status.pid for status in told.processes)
    if lives and not told.supervisor:
        what = "the supervisor is dead: who dies now stays dead"
        yield Check("supervisor", Level.WRONG, what, f"`roco down --run-dir {fleet.run}`, then `roco up`")
    elif lives:
        yield Check("supervisor", Level.FINE, f"lives, pid {told.supervisor}")


def router(fleet: Target, now: Look) -> Iterator[Check]:
    """Whether the router's port answers."""
    told = now.fleet
    if not isinstance(fleet, Local) or told is None or not any(status.pid for status in told.processes):
        return
    address = re.fullmatch(r"\w+/(.+):(\d+)", told.connect)
    if address is None:
        return
    try:
        with socket.create_connection((address[1], int(address[2])), CONNECT_S):
            yield Check("router", Level.FINE, f"listens at {told.connect}")
    except OSError as error:
        remedy = "`roco agent restart router`; a firewall may be in the way"
        yield Check("router", Level.WRONG, f"{told.connect} does not answer ({error})", remedy)


def held(fleet: Target, now: Look) -> Iterator[Check]:
    """Whether the robot may move."""
    if now.stop_held:
        yield Check("stop", Level.NOTE, "the robot is held", "`roco release` lets it move")


def certificates(fleet: Target, now: Look) -> Iterator[Check]:
    """How long the keys hold."""
    if not isinstance(fleet, Local) or not (folder := fleet.run / KEYS_FOLDER).is_dir():
        return
    from agent_runtime.io import issuing

    ends = min((issuing.ends(file) for file in folder.glob("*.pem")), default=None)
    if ends is None:
        yield Check("keys", Level.WRONG, f"no certificate in {folder}", "`roco down`, then `roco up` makes them anew")
        return
    left = ends - dt.datetime.now(dt.UTC)
    words = f"hold until {ends:%Y-%m-%d %H:%M} UTC"
    if left < dt.timedelta():
        yield Check(
            "keys", Level.WRONG, f"ended {ends:%Y-%m-%d %H:%M} UTC", "`roco down`, then `roco up` makes new ones"
        )
    else:
        soon = left < SOON
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


FLEET: dict[str, Callable[[Target, Look], Iterator[Check]]] = {
    "processes": processes,
    "supervisor": supervisor,
    "router": router,
    "stop": held,
    "keys": certificates,
    "clock": clock,
    "other runs": stale,
}
