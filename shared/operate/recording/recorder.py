"""The recorder: one thread that reads the agents' step logs, writes and judges, for each system
apart; then reports.

What agents said to each other comes from their logs (ends.py), from a cursor: a recorder that was
killed, frozen or started late misses nothing of it, and no agent waits for it. Heartbeats,
telemetry and tokens come by a tap, whose callbacks only enqueue; of these, what passes while no
recorder lives is lost. Everything is with the operating system within FLUSH_S. The thread takes
what the fleet leaves of the processor. SIGTERM ends the recording in order and makes report and
pictures.
"""

import math
import os
import re
import signal
import time
from collections.abc import Callable, Collection, Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import partial
from pathlib import Path

import msgspec

from agent_runtime.core.wiring import service_key
from agent_runtime.io.journal import worded
from agent_runtime.io.logs import WINDOW_S, Log, Repeats
from agent_runtime.io.options import USAGE_ERROR, Options
from agent_runtime.io.run_files import ProcessHeartbeat, make_run
from agent_runtime.io.steplog import LOG_PART, LOG_WANTED, MUCH_BYTES, OFFSET
from agent_runtime.io.tap import Sample, Tap, Waiting, open_tap
from operate.fault_lines import FaultFile
from operate.file_names import LIVE_FILE, STEPS, TRAFFIC_FILE, VERDICTS_FILE
from operate.judging.judged import Judging, encoded
from operate.judging.live import Live
from operate.live_lines import Against, Happened
from operate.pictures.feed import Feed, feeding
from operate.recording.contents import versions_now
from operate.recording.ends import Ends
from operate.recording.index import NOTE
from operate.recording.mcap_file import Recording, cursor
from operate.recording.records import (
    FAULT,
    HEARTBEAT,
    OPERATOR,
    SETTING,
    Garbage,
    House,
    Record,
    Setting,
    Spoken,
    Token,
    sampled,
    understood,
)
from operate.structs import alike
from operate.system import System
from operate.verdict_lines import Judged
from topdown.judge.verdicts import Verdict

# --- Folders of the recordings of several systems: robots at one router, and one monitor ----------
# With one system its recording is in the run folder itself; with several each has the folder of its
# name therein, which may be the run folder of that robot's fleet, and its step logs are there then.


SYSTEM_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
"""A system's name is one chunk of a key, and here a folder's name."""


class SystemNameError(ValueError):
    """A system's name that could not be a folder's; `name`."""

    def __init__(self, name: str) -> None:
        self.name = name
        super().__init__(
            f"no system can be called {name!r}: letters, digits and _.- only, as in velma1"
        )


def folders(run: Path, systems: tuple[str, ...]) -> dict[str, Path]:
    """System -> where its recording is. Raises SystemNameError."""
    for name in systems:
        if SYSTEM_NAME.fullmatch(name) is None:
            raise SystemNameError(name)
    return {systems[0]: run} if len(systems) == 1 else {name: run / name for name in systems}


# --- Step logs of agents on other hosts, or in containers of their own: copied into the recorder's
# run folder
# An agent that lives and has no log in the folder is asked for it, each ASK_S, with what is there
# of it already (agent_runtime.io.steplog). So a copy is whole whenever the recorder began, and
# whatever was lost on the way; who reads the folder reads a copy as any other log.


ASK_S = 1.0
"""Between two askings; estimate: a copy that lacks something goes on within it."""
COPIED = "copied"
"""Ending of the name of an empty file beside a log: it is a copy."""

Put = Callable[[str, bytes], None]


class CopiedLogs:
    """The copies in one run folder, of the agents of one system."""

    def __init__(self, run: Path, system: str) -> None:
        self._folder, self._system = run / STEPS, system
        self._of = {path.stem for path in self._folder.glob(f"*.{COPIED}")}
        self._living: set[str] = set()
        self._asked = 0.0

    def lived(self, agent: str, *, alive: bool) -> None:
        """An agent came, or is gone."""
        if not alive:
            self._living.discard(agent)
            return
        self._living.add(agent)
        if agent not in self._of and not self._log(agent).exists():
            self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            (self._folder / f"{agent}.{COPIED}").touch(mode=0o600)
            self._of.add(agent)

    def ask(self, put: Put, own: str) -> None:
        """Ask for what is missing, where it is time; `own`: the name of who asks."""
        now = time.monotonic()
        if now < self._asked + ASK_S:
            return
        self._asked = now
        for agent in sorted(self._of & self._living):
            put(service_key(self._system, LOG_WANTED, own, agent), OFFSET.pack(self._size(agent)))

    def take(self, agent: str, data: bytes) -> None:
        """Add a part of a log to the copy, if it goes on from there. Raise OSError."""
        if agent not in self._of or len(data) <= OFFSET.size:
            return
        (at,) = OFFSET.unpack_from(data)
        size, end = self._size(agent), at + len(data) - OFFSET.size
        if at <= size < end:
            with self._log(agent).open("ab") as file:
                file.write(data[OFFSET.size + size - at :])

    def _log(self, agent: str) -> Path:
        return self._folder / f"{agent}.{STEPS}"

    def _size(self, agent: str) -> int:
        log = self._log(agent)
        return log.stat().st_size if log.exists() else 0


# --- The recorder ---------------------------------------------------------------------------------


NAME = "monitor"
FLUSH_S = 0.1
SIGNAL_S = 0.5
"""Between two looks of the thread that runs signals' handlers at whether one came (estimate)."""
NICENESS = 10
"""The fleet comes first (benchmarks/README.md). In the class SCHED_IDLE the tap reads so late on a
busy machine that the router closes its session; at 19 it was slower there than at 10.
"""
MOST_READ_AGAIN = 64 * 1024 * 1024
"""Bytes of logs that a recorder which goes on reads again, so that it can judge what it finds open
(estimate: twenty pours, a few seconds). Beyond that, conversations that had begun before are not
judged.
"""
MOST_BYTES = 8 * 1024 * 1024 * 1024
"""Of a recording; then it goes on without one. Estimate: a pour has 25 MB in 100 s, so nine hours
of pouring.
"""
MOST_BYTES_OF_LINES = 1024 * 1024 * 1024
"""Of live.jsonl, and of verdicts.jsonl; estimate: days of pouring."""
TOLD = (
    "verdict", "why", "channel", "sender", "receiver", "protocol", "performative", "conversation",
    "id", "key",
)  # fmt: skip
"""Log event of a communicate that is not as designed."""


Say = Callable[..., None]


class _Lines:
    """A file of lines that grows to MOST_BYTES_OF_LINES and no further."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("ab")
        self._size = self._file.tell()

    @property
    def full(self) -> bool:
        """Whether nothing more is written."""
        return self._size >= MOST_BYTES_OF_LINES

    def write(self, line: bytes) -> None:
        """Append a line."""
        if not self.full:
            self._file.write(line)
            self._size += len(line)

    def flush(self) -> None:
        """Hand all of it to the operating system."""
        self._file.flush()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


class Recorder:
    """Writes what samples say: traffic.mcap, live.jsonl, verdicts.jsonl; `say` gets what is not as
    designed.
    """

    def __init__(
        self,
        run: Path,
        system: System,
        say: Say = lambda event, **fields: None,
        name: str = "",
        alive: Callable[[], None] = lambda: None,
    ) -> None:
        """`name`: of the system, in its keys. `alive` is called while it reads what an earlier
        recorder recorded.
        """
        make_run(run)
        before = cursor(run)
        self._recording = Recording(run / TRAFFIC_FILE, before)
        self._live_file, self._verdicts = _Lines(run / LIVE_FILE), _Lines(run / VERDICTS_FILE)
        self._repeats, self._garbage = Repeats[Judged](_OTHERS), Repeats[str]("")
        self._full = False
        self._live, self._judging = Live(system), Judging(system)
        self._system, self._say = system, say
        self._feed: Feed | None = None
        self._faults = FaultFile(run, self._recording.taken_until)
        self.count = self._flushed = 0
        self._lives: set[tuple[str, int, str]] = set()
        logs = {} if before is None else before.logs
        again = sum(logs.values()) <= MOST_READ_AGAIN
        self._ends = Ends(run, system, {} if again else logs)
        self._copies = CopiedLogs(run, name)
        if again and logs:
            self._read_again(logs, alive)

    def show(self, feed: Feed) -> None:
        """Have it shown from now on while it goes on."""
        self._feed = feed

    def begin(self, setting: Setting) -> None:
        """Record what the fleet was started with."""
        self._recording.note(NOTE, versions_now(self._system))
        record = House(SETTING, NAME, "", time.time(), msgspec.json.encode(setting))
        self._recording.add(record)
        self._judged(self._judging.lines(record))

    def _read_again(self, logs: Mapping[str, int], alive: Callable[[], None]) -> None:
        """Learn from the logs what the recorder before knew; it is recorded already."""
        for record in self._ends.before(logs, alive):
            for _ in (*self._live.lines(record), *self._judging.lines(record)):
                pass

    def take(self, sample: Sample) -> None:
        """Record a sample, whatever it is."""
        record = understood(sample, self._system)
        match record:
            case House(kind=kind) if kind == LOG_PART:
                self._copies.take(record.owner, record.data)
                return
            case House(kind=kind) if kind == HEARTBEAT:
                self._ends.lived(record.owner, record.received)
            case Token():
                self._copies.lived(record.agent, alive=record.alive)
        self._add(record)
        if self._feed is not None:
            self._feed.heard(sample)
        self.count += 1

    def ask(self, put: Put) -> None:
        """Ask agents elsewhere for their logs."""
        self._copies.ask(put, NAME)

    def follow(self) -> None:
        """Record what agents have logged since the last call, and judge what waited in vain."""
        for record in self._ends.new(time.time()):
            self._heard(record)
        self._judged(self._judging.pass_time(self._ends.until))

    def _heard(self, record: Record) -> None:
        self._add(record)
        self.count += 1
        sample = sampled(record, self._system.design)
        if self._feed is not None and sample is not None:
            self._feed.heard(sample)

    def _add(self, record: Record) -> None:
        if isinstance(record, Token) and not self._is_news(record):
            return
        if self._is_recorded(record):
            self._recording.add(
                record.bare() if isinstance(record, Spoken) and record.size > MUCH_BYTES else record
            )
        for line in self._live.lines(record):
            self._live_file.write(msgspec.json.encode(line) + b"\n")
        self._judged(self._judging.lines(record))

    def _is_news(self, token: Token) -> bool:
        """Whether its agent's log, or the tap, has not told of this life, or this death, yet."""
        life = token.agent, token.incarnation, token.journal
        if token.alive is (life in self._lives):
            return False
        self._lives ^= {life}
        return True

    def _is_recorded(self, record: Record) -> bool:
        """Whether it is recorded: until the file is full, and of samples that are not communicates
        one per key.
        """
        if isinstance(record, Garbage):
            self._garbage.over(record.received)
            if not self._garbage.told(record.key, record.received):
                return False
        return not self._full

    def _look_at_disk(self) -> None:
        files = (self._recording.size >= MOST_BYTES, self._live_file.full, self._verdicts.full)
        if any(files) and not self._full:
            self._full = True
            why = (
                "a file of the run is full, what is said is not recorded any more; begin a new run"
                " to have it"
            )
            self._say("disk limit", level="error", why=why)
            line = Happened(t=time.time(), name="disk limit", text=why)
            self._live_file.write(msgspec.json.encode(line) + b"\n")

    def look_for_faults(self) -> None:
        """Record what `roco fault` has written since the last look."""
        for fault in self._faults.new():
            record = House(FAULT, OPERATOR, fault.target, time.time(), msgspec.json.encode(fault))
            self._add(record)
            if self._feed is not None:
                key = service_key(self._system.name, FAULT, OPERATOR, fault.target)
                self._feed.heard(Sample(key, record.data, record.received))

    def flush(self) -> None:
        """Hand all of it to the operating system."""
        self._sum_up(time.time())
        self._look_at_disk()
        self._live_file.flush()
        self._verdicts.flush()
        if self.count != self._flushed:
            self._recording.keep(self._ends.cursor)
            self._flushed = self.count

    def finish(self) -> None:
        """Record what is left, and close in order."""
        for record in self._ends.rest():
            self._heard(record)
        self._judged(self._judging.finish(time.time()))
        self._sum_up(math.inf)
        why = self._recording.finish(self._ends.cursor)
        if why:
            self._say("not indexed", level="warning", why=why)
        self._live_file.close()
        self._verdicts.close()
        if self._feed is not None:
            self._feed.close()
            self._say("shown", dropped=self._feed.dropped)

    def _judged(self, lines: Iterable[Judged]) -> None:
        for one in lines:
            if one.violation and not self._repeats.told(_kind(one), time.time()):
                continue
            self._told(one)
            if self._feed is not None:
                self._feed.said(one)

    def _told(self, one: Judged) -> None:
        self._verdicts.write(encoded(one))
        if one.violation:
            self._live_file.write(msgspec.json.encode(alike(Against, one)) + b"\n")
            fields = {name: getattr(one, name) for name in TOLD if getattr(one, name)}
            self._say("not as designed", level="warning", **fields)

    def _sum_up(self, now: float) -> None:
        """Tell how many more violations of a kind there were than were told singly."""
        if now < self._repeats.look_at:
            return
        for kind, count in self._repeats.over(now):
            why = f"… {count:,} more of this kind from {kind.sender or kind.key} in {WINDOW_S:g} s"
            self._told(msgspec.structs.replace(kind, t=time.time(), why=why))


_OTHERS = Judged(t=0.0, verdict=Verdict.MALFORMED, bytes=0, why="others", violation=True)


def _kind(one: Judged) -> Judged:
    """Return the key by which verdicts are told together: a verdict about a sender on a channel."""
    return Judged(
        0.0, one.verdict, 0, one.channel, one.sender, one.receiver, key=one.key, violation=True
    )


class Recorders:
    """The recorders of all systems; a sample goes to its system's."""

    def __init__(
        self, where: Mapping[str, Path], system: System, say: Say, alive: Callable[[], None]
    ) -> None:
        self._where, self._system, self._say = where, system, say
        self._of = {
            name: Recorder(run, system, partial(say, system=name), name, alive)
            for name, run in where.items()
        }
        self._all = tuple(self._of.values())
        self.guests = tuple(system.design.guests)
        self.files = {name: str(run / TRAFFIC_FILE) for name, run in where.items()}

    @property
    def counts(self) -> dict[str, int]:
        """System -> samples recorded."""
        return {name: recorder.count for name, recorder in self._of.items()}

    def show(self) -> None:
        """Have all of it shown, as the environment wants it."""
        for name, feed in feeding(self._where, self._system, self._say).items():
            self._of[name].show(feed)

    def take(self, sample: Sample) -> None:
        """Record a sample where it belongs."""
        self._of[sample.system].take(sample)

    def ask(self, put: Put) -> None:
        """Ask agents elsewhere for their logs."""
        for recorder in self._all:
            recorder.ask(put)

    def each(self, act: Callable[[Recorder], None]) -> None:
        """Do something with each of them."""
        for recorder in self._all:
            act(recorder)


def serve(options: Options, system: System) -> int:
    """Record until SIGTERM or SIGINT, then make the reports.

    0: all; 1: some could not be made, or the disk took nothing: who supervises starts the recorder
    again, and what it missed is filled from the agents' step logs; 2: a wrong name.
    """
    run = options.run_dir
    make_run(run)
    log = Log(NAME, options.log_level, run / "logs" / f"{NAME}.jsonl")
    try:
        where = folders(run, options.all_systems)
    except SystemNameError as error:
        log.write("cannot record", level="error", why=str(error))
        return USAGE_ERROR
    waiting = Waiting()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, waiting.stop)
    ready = run / f"{NAME}.ready"
    try:
        pulse = ProcessHeartbeat(run, NAME)
        recorders = Recorders(where, system, log.write, pulse.beat)
        # the reports have the priority of this thread again
        with ThreadPoolExecutor(1, initializer=_give_way) as pool:
            recording = pool.submit(_tap, options, recorders, waiting, pulse, log.write)
            # a signal may reach another thread than this, which alone runs its handler
            while not recording.done():
                wait((recording,), SIGNAL_S)
            recording.result()
    except OSError as error:
        ready.unlink(missing_ok=True)
        log.write("recording broke off", level="error", why=worded(error.filename or run, error))
        return 1
    recorders.each(Recorder.finish)
    ready.unlink(missing_ok=True)
    log.write("recorded", samples=recorders.counts, dropped=waiting.dropped)
    from operate.recording.run import Run
    from operate.reports.make import everything

    made = [
        everything(Run(folder, system), partial(log.write, system=name))
        for name, folder in where.items()
    ]
    log.close()
    return 0 if all(made) else 1


def _give_way() -> None:
    # of this thread alone
    os.setpriority(os.PRIO_PROCESS, 0, os.getpriority(os.PRIO_PROCESS, 0) + NICENESS)


def _tap(
    options: Options, recorders: Recorders, waiting: Waiting, pulse: ProcessHeartbeat, say: Say
) -> None:
    """Record until no more is wanted; heartbeats and telemetry from when the router is there."""
    say("recording", **recorders.files)
    scene = str(options.scene) if options.scene else ""
    setting = Setting(seed=options.seed, speed=options.speed, scene=scene)
    recorders.each(lambda recorder: recorder.begin(setting))
    with ThreadPoolExecutor(1) as pool:
        tap = pool.submit(_listen, options, waiting, recorders.guests, say)
        try:
            # now that it records: what draws takes seconds of a busy processor to start
            recorders.show()
            _record(recorders, waiting, pulse, tap)
        finally:
            waiting.stop()
            opened = tap.result()
            if opened is not None:
                opened.close()
    for sample in waiting.left():
        recorders.take(sample)
    recorders.each(Recorder.look_for_faults)


def _listen(options: Options, waiting: Waiting, guests: Collection[str], say: Say) -> Tap | None:
    told = lambda why: say("no router", why=why)  # noqa: E731
    tap = open_tap(options, waiting.put, lambda: waiting.stopped, told=told, guests=guests)
    if tap is not None:
        (options.run_dir / f"{NAME}.ready").write_text("records")
    return tap


def _record(
    recorders: Recorders, waiting: Waiting, pulse: ProcessHeartbeat, tap: "Future[Tap | None]"
) -> None:
    flushed = time.monotonic()
    while not waiting.stopped:
        pulse.beat()
        sample = waiting.get(FLUSH_S)
        if sample is not None:
            recorders.take(sample)
        if time.monotonic() - flushed > FLUSH_S:
            if tap.done() and (opened := tap.result()) is not None:
                recorders.ask(opened.put)
            for act in (Recorder.follow, Recorder.look_for_faults, Recorder.flush):
                recorders.each(act)
            flushed = time.monotonic()
