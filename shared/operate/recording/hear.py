"""`python -m operate.recording hear`: what goes by in a running fleet, as samples, a JSON object a line, for a reader
that does not reach its router: the command line, of a fleet in containers.

It begins with the setting of the fleet's recording, and ends when its standard input does: the caller is gone then,
however. Nothing is kept, and nobody is held: what comes faster than it is read is dropped and counted.
"""

import os
import sys
import threading

import msgspec

from agent_runtime.io.options import Options
from agent_runtime.io.tap import RECORDER, Sample
from agent_runtime.io.waiting import Waiting
from operate.recording.mcap_file import first
from operate.recording.samples import sampled
from operate.recording.side_recording import NO_ROUTER, tapped
from operate.run_folder import TRAFFIC_FILE
from topdown.model.design import Design

PAUSE_S = 0.1


def serve(options: Options, design: Design) -> int:
    """Print until standard input ends. 0: it did, or nobody reads any more; 3: no router answers."""
    waiting = Waiting()
    threading.Thread(target=_listen_for_the_end, args=(waiting,), daemon=True).start()
    tap = tapped(options, waiting, RECORDER)
    if tap is None:
        return NO_ROUTER
    try:
        _print(waiting, options, design)
    except BrokenPipeError:
        pass
    finally:
        tap.close()
    return 0


def _print(waiting: Waiting, options: Options, design: Design) -> None:
    setting = first(options.run_dir / TRAFFIC_FILE)
    if setting is not None:
        _line(sampled(setting, design))
    while not waiting.stopped:
        sample = waiting.get(PAUSE_S)
        if sample is not None:
            _line(sample)


def _line(sample: Sample) -> None:
    sys.stdout.buffer.write(msgspec.json.encode(sample) + b"\n")
    sys.stdout.buffer.flush()


def _listen_for_the_end(waiting: Waiting) -> None:
    while os.read(0, 4096):  # sys.stdin may not be in use by a thread when Python ends
        pass
    waiting.stop()
