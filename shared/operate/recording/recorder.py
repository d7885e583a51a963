"""The recorder: one tap, one queue, one thread that writes and judges, for each system apart; then the reports.

That thread, and those of the tap, which it opens, take what the fleet leaves of the processor. Callbacks only enqueue.
Everything is with the operating system within FLUSH_S, so a kill costs no more than that; what is lost then, agents'
own step logs have. SIGTERM ends the recording in order and makes report and pictures.
"""

import os
import signal
import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import msgspec

from agent_runtime.io.logs import Log
from agent_runtime.io.options import Options
from agent_runtime.io.pulse import Pulse
from agent_runtime.io.tap import Sample, Tap, open_tap
from agent_runtime.io.waiting import Waiting
from operate.judging.judged import Judging, encoded
from operate.judging.live import Live
from operate.pictures.feed import Feed, feeding
from operate.recording.contents import NOTE, versions_now
from operate.recording.history import Setting
from operate.recording.mcap_file import FILE, Recording
from operate.recording.reach import Reach
from operate.recording.records import SETTING, House, Record, understood
from operate.recording.systems import SystemNameError, folders
from operate.run_folder import LIVE_FILE, VERDICTS_FILE, Against, Judged
from operate.system import System

NAME = "monitor"
FLUSH_S = 0.1
NICENESS = 10
"""The fleet comes first (benchmarks/README.md). In the class SCHED_IDLE the tap reads so late on a busy machine that
the router closes its session; at 19 it was slower there than at 10.
"""
TOLD = ("verdict", "why", "channel", "sender", "receiver", "protocol", "performative", "conversation", "id", "key")
"""Log event of a communicate that is not as designed."""


Say = Callable[..., None]


class Recorder:
    """Writes what samples say: traffic.mcap, live.jsonl, verdicts.jsonl; `say` gets what is not as designed."""

    def __init__(
        self, run: Path, system: System, say: Say = lambda event, **fields: None, feed: Feed | None = None
    ) -> None:
        """`feed`: who shows it while it goes on."""
        run.mkdir(parents=True, exist_ok=True)
        self._recording = Recording(run / FILE)
        self._live_file = (run / LIVE_FILE).open("ab")
        self._verdicts = (run / VERDICTS_FILE).open("ab")
        self._live, self._judging, self._reach = Live(system), Judging(system), Reach()
        self._system, self._say, self._feed = system, say, feed
        self.count = 0

    def begin(self, setting: Setting) -> None:
        """Record what the fleet was started with."""
        self._recording.note(NOTE, versions_now(self._system))
        record = House(SETTING, NAME, "", time.time(), msgspec.json.encode(setting))
        self._recording.add(record)
        self._judged(self._judging.lines(record))

    def take(self, sample: Sample) -> None:
        """Record a sample, whatever it is; where it ends a time out of reach, that first."""
        record, lost = understood(sample, self._system), self._reach.lost
        hole = self._reach.hole(record)
        if hole is not None:
            self._say("in reach again", unheard_s=round(hole.received - hole.since, 1))
            self._add(hole)
        elif self._reach.lost and not lost:
            self._say("no agent is in reach", level="warning")
        self._add(record)
        if self._feed is not None:
            self._feed.heard(sample)
        self.count += 1

    def _add(self, record: Record) -> None:
        self._recording.add(record)
        for line in self._live.lines(record):
            self._live_file.write(msgspec.json.encode(line) + b"\n")
        self._judged(self._judging.lines(record))

    def flush(self) -> None:
        """Hand all of it to the operating system."""
        self._recording.flush()
        self._live_file.flush()
        self._verdicts.flush()

    def pass_time(self) -> None:
        """Judge what waited in vain; while samples wait, the present has not been heard yet."""
        self._judged(self._judging.pass_time(time.time()))

    def finish(self) -> None:
        """Close in order."""
        self._judged(self._judging.finish(time.time()))
        self._recording.finish()
        self._live_file.close()
        self._verdicts.close()
        if self._feed is not None:
            self._feed.close()
            self._say("shown", dropped=self._feed.dropped)

    def _judged(self, lines: Iterable[Judged]) -> None:
        for one in lines:
            self._verdicts.write(encoded(one))
            if self._feed is not None:
                self._feed.said(one)
            if one.violation:
                against = Against(one.t, one.verdict, one.channel, one.sender, one.receiver, one.performative, one.why)
                self._live_file.write(msgspec.json.encode(against) + b"\n")
                told = {name: getattr(one, name) for name in TOLD if getattr(one, name)}
                self._say("not as designed", level="warning", **told)


class Recorders:
    """The recorders of all systems; a sample goes to its system's, what came of no key (the tap was deaf) to all."""

    def __init__(self, where: Mapping[str, Path], system: System, say: Say) -> None:
        feeds = feeding(where, system, say)
        self._of = {
            name: Recorder(run, system, partial(say, system=name), feeds.get(name)) for name, run in where.items()
        }
        self._all = tuple(self._of.values())
        self.files = {name: str(run / FILE) for name, run in where.items()}

    @property
    def counts(self) -> dict[str, int]:
        """System -> samples recorded."""
        return {name: recorder.count for name, recorder in self._of.items()}

    def take(self, sample: Sample) -> None:
        """Record a sample where it belongs."""
        for recorder in (self._of[sample.system],) if sample.key else self._all:
            recorder.take(sample)

    def each(self, act: Callable[[Recorder], None]) -> None:
        """Do something with each of them."""
        for recorder in self._all:
            act(recorder)


def serve(options: Options, system: System) -> int:
    """Record until SIGTERM or SIGINT, then make the reports. 0: all; 1: some could not be made; 2: a wrong name."""
    run = options.run_dir
    run.mkdir(parents=True, exist_ok=True)
    log = Log(NAME, options.log_level, run / "logs" / f"{NAME}.jsonl")
    try:
        where = folders(run, options.all_systems)
    except SystemNameError as error:
        log.write("cannot record", level="error", why=str(error))
        return 2
    waiting = Waiting()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, waiting.stop)
    recorders, ready = Recorders(where, system, log.write), run / f"{NAME}.ready"
    with ThreadPoolExecutor(1, initializer=_give_way) as pool:  # the reports have the priority of this thread again
        pool.submit(_tap, options, recorders, waiting, ready, log.write).result()
    recorders.each(Recorder.finish)
    ready.unlink(missing_ok=True)
    log.write("recorded", samples=recorders.counts, dropped=waiting.dropped)
    from operate.reports import make

    made = [make.everything(folder, system, partial(log.write, system=name)) for name, folder in where.items()]
    log.close()
    return 0 if all(made) else 1


def _give_way() -> None:
    os.setpriority(os.PRIO_PROCESS, 0, os.getpriority(os.PRIO_PROCESS, 0) + NICENESS)  # of this thread alone


def _tap(options: Options, recorders: Recorders, waiting: Waiting, ready: Path, say: Say) -> None:
    """Record as soon as the router is there, until no more is wanted."""
    tap = open_tap(options, waiting.put, lambda: waiting.stopped)
    if tap is None:
        return
    ready.write_text("taps")
    say("recording", **recorders.files)
    scene = str(options.scene) if options.scene else ""
    setting = Setting(seed=options.seed, speed=options.speed, scene=scene)
    recorders.each(lambda recorder: recorder.begin(setting))
    _record(recorders, waiting, tap, Pulse(options.run_dir, NAME))


def _record(recorders: Recorders, waiting: Waiting, tap: Tap, pulse: Pulse) -> None:
    flushed = time.monotonic()
    while not waiting.stopped:
        pulse.beat()
        sample = waiting.get(FLUSH_S)
        if sample is None:
            recorders.each(Recorder.pass_time)
        else:
            recorders.take(sample)
        if time.monotonic() - flushed > FLUSH_S:
            recorders.each(Recorder.flush)
            flushed = time.monotonic()
    tap.close()
    for sample in waiting.left():
        recorders.take(sample)
