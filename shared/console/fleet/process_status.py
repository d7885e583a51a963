"""A fleet, wherever it runs: the state of each process at one look, and its processor share from
two looks.

Pure: texts of files in, Structs out. Whoever looks is in console.fleet.local or
console.fleet.compose.
"""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from typing import Protocol

import msgspec

from agent_runtime.core.control import Answer, Value
from agent_runtime.io.heartbeat import Inside
from console.errors import ConsoleError
from operate.file_names import FAULTS_FILE, LIVE_FILE
from operate.fleet_file import Fleet, ProcessState, ProcessStatus
from operate.proc import Used
from operate.system import NoSystemError, System
from operate.verdict_lines import Judged

LATE_S = 3.0
"""An older heartbeat is one of a process that hangs: they come each second, at a load of 20 within
3 s.
"""
UNSUPERVISED = "no supervisor: who dies now stays dead"
PAUSED = "paused"
"""State of an agent that takes no step until it is resumed."""


class Unheard(msgspec.Struct, frozen=True):
    """Since when an agent's words to `peer` have no effect [unix s] (agent_runtime.core.peers)."""

    peer: str
    channel: str
    what: str
    since: float


class Beat(msgspec.Struct, frozen=True):
    """The fields used of a heartbeat file; a process that is not an agent writes its name and pid
    only.

    `peers`: their incarnations, 0 of who is not there; `unreceipted`, `due`: communicates that
    wait, by peer: for a receipt, and for being said. `level`: least of its log lines shown;
    `answer`: to the operator's last order. `trouble`: why it waits, in words.
    """

    pid: int = 0
    incarnation: int = 0
    step: int = 0
    state: str = ""
    up: bool = True
    peers: dict[str, int] = {}
    unreceipted: dict[str, int] = {}
    due: dict[str, int] = {}
    counts: dict[str, int] = {}
    unheard: tuple[Unheard, ...] = ()
    paused: bool = False
    level: str = ""
    parameters: dict[str, Value] = {}
    answer: Answer = Answer()
    inside: Inside | None = None
    trouble: str = ""


class Seen(msgspec.Struct, frozen=True):
    """A process at one look; `age_s`: of its heartbeat. None: it has none, or does not run. `home`:
    its service.
    """

    status: ProcessStatus
    beat: Beat | None = None
    age_s: float | None = None
    used: Used | None = None
    home: str = ""

    @property
    def name(self) -> str:
        return self.status.name


class Look(msgspec.Struct, frozen=True):
    """A fleet at one look. `at`: a clock that only goes forward [s]; `unkept`: why nobody looks
    after it, "" if so.
    """

    fleet: Fleet | None
    seen: tuple[Seen, ...]
    stop_held: bool
    at: float
    unkept: str = ""


Put = Callable[[str, bytes], None]
"""Puts data on a key."""


class Target(Protocol):
    """A fleet, wherever it runs. `where`: for people; `name`: for --target."""

    where: str
    name: str

    @property
    def system(self) -> System:
        """The system that runs there. Raises NoSystemError if it cannot be told."""

    def look(self) -> Look:
        """The fleet now: each process with heartbeat, processor time, memory."""

    def read(self, name: str, file: str, offset: int = 0) -> bytes:
        """A file in the run folder of a process, from byte `offset` on; b"" if it does not exist.
        Raises DockerError if that process has no running container.
        """

    def recorded(self, file: str, offset: int = 0) -> bytes:
        """A file of the monitor, from byte `offset` on; b"" if it does not exist yet."""

    def live(self, offset: int) -> bytes:
        """The monitor's live.jsonl from byte `offset` on."""
        return self.recorded(LIVE_FILE, offset)

    def faults(self) -> bytes:
        """What faults.jsonl has; b"" where it is not there."""
        return self.recorded(FAULTS_FILE)

    def logged(self, name: str, offset: int) -> bytes:
        """The log of a process from byte `offset` on, as JSON lines; b"" while its container does
        not run.
        """
        return self.read(name, f"logs/{name}.jsonl", offset)

    def verdicts(self) -> list[Judged]:
        """The monitor's verdicts so far, in order of time; without a monitor, those of its
        recording now.
        """

    def put(self, file: str, data: bytes) -> None:
        """Replace a file in the run folder at once. FleetError: this fleet has no folder that all
        processes share.
        """

    def hold(self, name: str, held: bool) -> None:
        """Set the stop flag in the run folder of a process, or clear it."""

    def switch(self, name: str, on: bool) -> None:
        """Start a process, or end it and keep it down; it is asked for, not waited for. UsageError:
        no such name.
        """

    def signal(self, name: str, number: int) -> None:
        """Send a signal to a process. FleetError: it does not run."""

    def variable(self, name: str, variable: str) -> str:
        """A variable of the environment that a process has, or would be started with; "" where it
        is not set.
        """

    def wire(self, name: str, kind: str, amount: float | None) -> None:
        """Set a condition of the wires of an agent, or of all to a router, or end it (None).
        FleetError: none.
        """

    def writing(self, name: str, possible: bool) -> None:
        """Let what a process writes to files fail, or not any more. FleetError: it does not run."""

    def clock(self, name: str, seconds: float) -> None:
        """Set the wall clock of a process so far forward [s]; 0: as it is. FleetError: it has none
        of its own.
        """

    def add_fault(self, line: bytes) -> None:
        """Append a line to faults.jsonl, where the monitor reads it."""

    def down(self) -> tuple[str, ...]:
        """End the fleet in order; who was ended. NotWaitedError: Ctrl-C meanwhile."""

    def log(self, name: str, lines: int) -> tuple[str, ...]:
        """The last lines that a process wrote."""

    def operating(self) -> AbstractContextManager[Put]:
        """A session of the operator, whom the design lets give orders. ConsoleError: it cannot be
        had.
        """

    def speaking(self, identity: str, to: str) -> AbstractContextManager[Put]:
        """A session with the keys of an identity, in which an agent hears. ConsoleError: it cannot
        be had.
        """

    def logging(self) -> tuple[str, ...]:
        """The processes that have a log of JSON lines."""


class Row(msgspec.Struct, frozen=True):
    """A process as `roco agents` tells of it. `state`: of its FSM where it is an agent that runs,
    else of the process.

    `cpu`: percent of one processor; `memory`: bytes; `waiting`: communicates said but not
    receipted, and due to be said; `trouble`: what is wrong with it, in words.
    """

    name: str
    process: ProcessState
    state: str
    heartbeat_s: float | None
    restarts: int
    cpu: float | None
    memory: int | None
    pid: int
    incarnation: int | None
    waiting: int | None
    trouble: str = ""


class Info(msgspec.Struct, frozen=True):
    """`roco agents NAME --format json`: the row, what its heartbeat says, its channels by peer, its
    last lines.
    """

    where: str
    row: Row
    beat: Beat | None
    channels: dict[str, str]
    log: tuple[str, ...]


def rows(before: Look, now: Look) -> tuple[Row, ...]:
    """Two looks as rows."""
    earlier = {one.name: one for one in before.seen}
    return tuple(_row(one, earlier.get(one.name), now.at - before.at) for one in now.seen)


def _row(one: Seen, before: Seen | None, span_s: float) -> Row:
    beat, status = one.beat, one.status
    state, life, waiting = str(status.state), None, None
    if beat is not None and beat.state and status.state is ProcessState.READY:
        state = PAUSED if beat.paused else beat.state
    if beat is not None and beat.incarnation > 0:  # an agent
        life = beat.incarnation if status.pid else None
        waiting = sum(beat.unreceipted.values()) + sum(beat.due.values())
    return Row(
        name=status.name,
        process=status.state,
        state=state,
        heartbeat_s=one.age_s if status.pid else None,
        restarts=status.restarts,
        cpu=cpu(before, one, span_s),
        memory=one.used.memory if one.used else None,
        pid=status.pid,
        incarnation=life,
        waiting=waiting,
        trouble=trouble(one),
    )


def cpu(before: Seen | None, now: Seen, span_s: float) -> float | None:
    """Percent of one processor between two looks; None where it was not the same process."""
    if before is None or before.used is None or now.used is None or span_s <= 0:
        return None
    if before.status.pid != now.status.pid:
        return None
    return max(0.0, 100.0 * (now.used.cpu_s - before.used.cpu_s) / span_s)


def stuck(one: Seen) -> str:
    """Whether a process runs and does not get on, in words; "" where it does."""
    if one.used is not None and one.used.frozen:
        return "frozen by a signal"
    # not that of an earlier process, left in a volume
    own = one.beat is None or one.beat.pid == one.status.pid
    if own and one.status.pid and one.age_s is not None and one.age_s > LATE_S:
        return f"hangs: last heartbeat {one.age_s:.0f} s ago"
    return ""


def unkept(told: Fleet, supervisor: Seen) -> str:
    """Return why nobody looks after the processes of a fleet: its supervisor is dead or stuck. ""
    where one does.
    """
    if not any(status.pid for status in told.processes):
        return ""
    if not told.supervisor:
        return UNSUPERVISED
    words = stuck(supervisor)
    return f"the supervisor (pid {told.supervisor}) is stuck, {words}" if words else ""


def trouble(one: Seen) -> str:
    """Return the problem of a process as far as a look can tell; "" if there is none."""
    status = one.status
    if words := stuck(one):
        return words
    if status.state is ProcessState.READY and one.beat is not None and not one.beat.up:
        return "no router"
    if status.pid and one.beat is not None and one.beat.pid == status.pid and one.beat.trouble:
        return one.beat.trouble
    return status.note if status.state is not ProcessState.READY else ""


def beat(data: bytes) -> Beat | None:
    """A heartbeat file, None where it is none of ours."""
    try:
        return msgspec.json.decode(data, type=Beat)
    except msgspec.DecodeError:
        return None


# --- Tasks that people gave a system, if it has tasks ---------------------------------------------


ENDED = ("done", "failed", "cancelled", "refused")


class Task(Protocol):
    """A task: its id, its state ("running", ..., or one of ENDED), what is to be said of it, what a
    person asked for. `number`: of the step of its plan under way, the first is 1, 0 for none.
    """

    @property
    def task(self) -> str: ...
    @property
    def state(self) -> str: ...
    @property
    def text(self) -> str: ...
    @property
    def asked(self) -> str: ...
    @property
    def number(self) -> int: ...
    @property
    def steps(self) -> Sequence[object]: ...


def tasks_of(fleet: Target) -> tuple[tuple[Task, ...], str]:
    """Return the tasks of a fleet, oldest first, and why they are not known, "" where they are;
    none of a system without.
    """
    try:
        told: Callable[[Target], Sequence[Task]] | None = fleet.system.addition("tasks")
        return (tuple(told(fleet)), "") if told is not None else ((), "")
    except (ConsoleError, NoSystemError) as error:
        return (), str(error)
