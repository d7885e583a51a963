"""The recorder: one tap, one queue, one thread that writes and judges; then the report.

Callbacks only enqueue. Everything is with the operating system within FLUSH_S, so a kill costs no more than that; what
is lost then, agents' own step logs have. SIGTERM ends the recording in order and makes report and pictures.
"""

import queue
import signal
import time
from collections.abc import Callable, Iterable
from pathlib import Path

import msgspec

from agent_runtime.logs import Log
from agent_runtime.options import Options
from agent_runtime.tap import Sample, Tap, open_tap
from companion.run_folder import LIVE_FILE, VERDICTS_FILE, Against, Judged
from services.monitor.history import Setting
from services.monitor.judged import Judging, encoded
from services.monitor.live import Live
from services.monitor.recording import FILE, Recording
from services.monitor.records import SETTING, House, understood

NAME = "monitor"
FLUSH_S = 0.1
TOLD = ("verdict", "why", "channel", "sender", "receiver", "protocol", "performative", "conversation", "id", "key")
"""What the log says of a communicate that is not as designed."""
MOST_WAITING = 100_000
"""Samples that may wait to be written; beyond that they are dropped and counted. Estimate: minutes of traffic."""


Say = Callable[..., None]


class Recorder:
    """Writes what samples say: traffic.mcap, live.jsonl, verdicts.jsonl; `say` is told what is not as designed."""

    def __init__(self, run: Path, say: Say = lambda event, **fields: None) -> None:
        run.mkdir(parents=True, exist_ok=True)
        self._recording = Recording(run / FILE)
        self._live_file = (run / LIVE_FILE).open("ab")
        self._verdicts = (run / VERDICTS_FILE).open("ab")
        self._live, self._judging, self._say = Live(), Judging(), say
        self.count = 0

    def begin(self, setting: Setting) -> None:
        """Record what the fleet was started with."""
        record = House(SETTING, NAME, "", time.time(), msgspec.json.encode(setting))
        self._recording.add(record)
        self._judged(self._judging.lines(record))

    def take(self, sample: Sample) -> None:
        """Record a sample, whatever it is."""
        record = understood(sample)
        self._recording.add(record)
        for line in self._live.lines(record):
            self._live_file.write(msgspec.json.encode(line) + b"\n")
        self._judged(self._judging.lines(record))
        self.count += 1

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

    def _judged(self, lines: Iterable[Judged]) -> None:
        for one in lines:
            self._verdicts.write(encoded(one))
            if one.violation:
                against = Against(one.t, one.verdict, one.channel, one.sender, one.receiver, one.performative, one.why)
                self._live_file.write(msgspec.json.encode(against) + b"\n")
                told = {name: getattr(one, name) for name in TOLD if getattr(one, name)}
                self._say("not as designed", level="warning", **told)


class Waiting:
    """Samples that wait to be written; None: stop. Bounded."""

    def __init__(self) -> None:
        self._queue: queue.SimpleQueue[Sample | None] = queue.SimpleQueue()
        self.dropped = 0
        self.stopped = False

    def put(self, sample: Sample) -> None:
        """From Zenoh's threads; never blocks."""
        if self._queue.qsize() < MOST_WAITING:
            self._queue.put(sample)
        else:
            self.dropped += 1

    def stop(self, *_: object) -> None:
        """From a signal: SimpleQueue's put may be called while the same thread is in it."""
        self.stopped = True
        self._queue.put(None)

    def get(self, timeout_s: float) -> Sample | None:
        """The oldest sample; None: stop, or none came in time."""
        try:
            return self._queue.get(timeout=timeout_s)
        except queue.Empty:
            return None

    def left(self) -> list[Sample]:
        """What still waits."""
        left = []
        while not self._queue.empty():
            sample = self._queue.get()
            if sample is not None:
                left.append(sample)
        return left


def serve(options: Options) -> int:
    """Record until SIGTERM or SIGINT, then make the report. 0: all of it; 1: some of it could not be made."""
    run = options.run_dir
    run.mkdir(parents=True, exist_ok=True)
    log = Log(NAME, options.log_level, run / "logs" / f"{NAME}.jsonl")
    waiting = Waiting()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, waiting.stop)
    recorder, ready = Recorder(run, log.write), run / f"{NAME}.ready"
    tap = open_tap(options, waiting.put, lambda: waiting.stopped)
    if tap is not None:
        ready.write_text("taps")
        log.write("recording", file=str(run / FILE))
        scene = str(options.scene) if options.scene else ""
        recorder.begin(Setting(seed=options.seed, speed=options.speed, scene=scene))
        _record(recorder, waiting, tap)
    recorder.finish()
    ready.unlink(missing_ok=True)
    log.write("recorded", samples=recorder.count, dropped=waiting.dropped)
    from services.monitor import make  # numpy and what draws: not before, the agents start once this process is ready

    made = make.everything(run, log.write)
    log.close()
    return 0 if made else 1


def _record(recorder: Recorder, waiting: Waiting, tap: Tap) -> None:
    flushed = time.monotonic()
    while not waiting.stopped:
        sample = waiting.get(FLUSH_S)
        if sample is None:
            recorder.pass_time()
        else:
            recorder.take(sample)
        if time.monotonic() - flushed > FLUSH_S:
            recorder.flush()
            flushed = time.monotonic()
    tap.close()
    for sample in waiting.left():
        recorder.take(sample)
