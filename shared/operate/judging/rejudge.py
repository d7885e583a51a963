"""Judging afterwards: a run folder, a traffic.mcap or a live.jsonl, by the design of its system or another one.

Of a run folder also what only the agents' step logs have is judged (operate.recording.filled).
"""

from pathlib import Path

import msgspec

from operate.judging import judged
from operate.recording import reading
from operate.run_folder import LIVE_FILE, TRAFFIC_FILE, Judged, LiveLine
from operate.system import System


def judge(file: Path, system: System) -> tuple[Judged, ...]:
    """Return every verdict about what `file` holds, in the order of time. Raise NoRecordingError."""
    if file.is_dir() and not (file / TRAFFIC_FILE).exists() and (file / LIVE_FILE).exists():
        file /= LIVE_FILE
    if file.suffix == ".jsonl" and file.is_file():
        return judged.of_live(_live(file), system.design)
    return judged.of_records(reading.of(file, system).records, system)


def _live(file: Path) -> list[LiveLine]:
    """Lines of kinds or with fields of another version are left out, as a reader of that file should."""
    lines: list[LiveLine] = []
    decoder = msgspec.json.Decoder(LiveLine)
    for raw in file.read_bytes().splitlines():
        try:
            lines.append(decoder.decode(raw))
        except msgspec.DecodeError:
            continue
    return lines
