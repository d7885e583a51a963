"""`python -m operate.recording hear`: what goes by in a running fleet, as samples, a JSON object a
line, for people's tools. It runs where the agents' logs are: here, or in the monitor's container.

It begins with the setting of the fleet's recording, and ends when its standard input does: the
caller is gone then, however. Nothing is kept, and nobody is held: of heartbeats and telemetry, what
comes faster than it is read is dropped and counted.
"""

import os
import sys
import threading
import time

import msgspec

from agent_runtime.io.options import Options
from agent_runtime.io.secured import key_file
from agent_runtime.io.tap import RECORDER, Sample, Waiting, open_tap
from operate.file_names import TRAFFIC_FILE
from operate.recording.ends import Ends, ends_now
from operate.recording.mcap_file import first
from operate.recording.records import sampled
from operate.system import System

CONSOLE = "console"
"""The identity of people's tools, which may hear what the recorder may."""
PAUSE_S = 0.05
"""Between two looks at the logs (estimate: a person sees no delay)."""
ROUTER_S = 5.0
"""Time to wait for a router [s] (estimate: it answers in milliseconds)."""
NO_ROUTER = 3
"""The exit code where no router answers."""


def serve(options: Options, system: System) -> int:
    """Print until standard input ends. 0: it did, or nobody reads any more; 3: no router
    answers.
    """
    waiting, until = Waiting(), time.monotonic() + ROUTER_S
    threading.Thread(target=_listen_for_the_end, args=(waiting,), daemon=True).start()
    ends = Ends(options.run_dir, system, ends_now(options.run_dir))
    who = CONSOLE if options.keys is None or key_file(options.keys, CONSOLE).is_file() else RECORDER
    tap = open_tap(options, waiting.put, lambda: waiting.stopped or time.monotonic() > until, who)
    if tap is None:
        look = f"Its recording is looked at with --run {options.run_dir}"
        why = f"no router answers at {options.connect}; is the fleet up (`roco status`)?"
        print(f"{why} {look}", file=sys.stderr)
        return NO_ROUTER
    try:
        _print(waiting, ends, options, system)
    except BrokenPipeError:
        pass
    finally:
        tap.close()
    return 0


def _print(waiting: Waiting, ends: Ends, options: Options, system: System) -> None:
    (name, *_), setting = options.all_systems, first(options.run_dir / TRAFFIC_FILE)
    if setting is not None:
        _line(sampled(setting, system.design, name))
    while not waiting.stopped:
        sample = waiting.get(PAUSE_S)
        for one in (sample, *waiting.left()):
            _line(one)
        for record in ends.new(time.time()):
            _line(sampled(record, system.design, name))
        sys.stdout.buffer.flush()


def _line(sample: Sample | None) -> None:
    if sample is not None:
        sys.stdout.buffer.write(msgspec.json.encode(sample) + b"\n")


def _listen_for_the_end(waiting: Waiting) -> None:
    while os.read(0, 4096):  # sys.stdin may not be in use by a thread when Python ends
        pass
    waiting.stop()
