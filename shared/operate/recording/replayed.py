"""Files of what is replayed, live.jsonl and step logs, from which people's tools read it: samples come on standard
input, an object a line, as they are said again.

An empty line begins a new round: what is said in it is not a copy of the round before.
"""

import sys
from pathlib import Path

import msgspec

from agent_runtime.io.tap import Sample
from agent_runtime.testing.step_logs import StepLogs
from operate.judging.live import Live
from operate.recording.records import Spoken, understood
from operate.run_folder import LIVE_FILE
from operate.system import System

_decoder = msgspec.json.Decoder(Sample)


def write(folder: Path, system: System) -> None:
    """Write the lines of each sample as it comes, until the input ends."""
    live, logs = Live(system), StepLogs(folder)
    with (folder / LIVE_FILE).open("wb", buffering=0) as file:
        for line in sys.stdin.buffer:
            if not line.strip():
                live = Live(system)
                continue
            record = understood(_decoder.decode(line), system)
            if isinstance(record, Spoken):
                logs.passed(record.communicate, record.received)
            for told in live.lines(record):
                file.write(msgspec.json.encode(told) + b"\n")
