"""live.jsonl of what is replayed: samples come on standard input, an object a line, as they are said again.

An empty line begins a new round: what is said in it is not a copy of the round before.
"""

import sys
from pathlib import Path

import msgspec

from agent_runtime.io.tap import Sample
from operate.judging.live import Live
from operate.recording.records import understood
from operate.run_folder import LIVE_FILE
from operate.system import System

_decoder = msgspec.json.Decoder(Sample)


def write(folder: Path, system: System) -> None:
    """Write the lines of each sample as it comes, until the input ends."""
    live = Live(system)
    with (folder / LIVE_FILE).open("wb", buffering=0) as file:
        for line in sys.stdin.buffer:
            if not line.strip():
                live = Live(system)
                continue
            for told in live.lines(understood(_decoder.decode(line), system)):
                file.write(msgspec.json.encode(told) + b"\n")
