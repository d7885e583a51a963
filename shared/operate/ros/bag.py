"""A run as a rosbag2 in MCAP. Must not know: what a robot is."""

import heapq
import shutil
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import suppress
from operator import attrgetter
from pathlib import Path
from typing import Any, Final

import msgspec
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from operate.doing import doing
from operate.recording.happenings import of_history
from operate.recording.records import Identity
from operate.recording.run import Run
from operate.ros.messages import TYPES, Entry, nanoseconds
from operate.ros.telling import Telling, logged
from operate.structs import NothingToRead
from operate.verdict_lines import Judged

VERSION: Final = 9
"""Of the bag's metadata; Jazzy and later read it."""
FOREVER = QosTime(9223372036, 854775807)
"""RMW_DURATION_INFINITE."""
LATCHED = Qos(
    QosHistory.KEEP_LAST,
    1,
    QosReliability.RELIABLE,
    QosDurability.TRANSIENT_LOCAL,
    FOREVER,
    FOREVER,
    QosLiveliness.AUTOMATIC,
    FOREVER,
    False,
)


class BagExists(NothingToRead):
    """There is something where the bag is to be written."""

    def __init__(self, place: Path) -> None:
        self.place = place
        super().__init__(f"{place} is there already; name a folder that is not")


class Written(msgspec.Struct, frozen=True):
    """A topic of a bag: its type, and how many messages there are."""

    topic: str
    kind: str
    messages: int


def write(folder: Path, found: Iterable[Entry]) -> tuple[Written, ...]:
    """Write a bag, which its owner alone can read; its topics. Raise BagExists."""
    if folder.exists() or folder.is_symlink():
        raise BagExists(folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
    bag = Writer(folder, version=VERSION, storage_plugin=StoragePlugin.MCAP)
    bag.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    try:
        with doing(f"writing {folder}"), bag:
            folder.chmod(0o700)
            return _filled(bag, found)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def _filled(bag: Writer, found: Iterable[Entry]) -> tuple[Written, ...]:
    counts: Counter[tuple[str, str]] = Counter()
    connections: dict[str, Any] = {}
    for one in found:
        if one.topic not in connections:
            offered = [LATCHED] if one.latched else []
            connections[one.topic] = bag.add_connection(
                one.topic, one.kind, typestore=TYPES, offered_qos_profiles=offered
            )
        data = TYPES.serialize_cdr(one.message, one.kind)
        bag.write(connections[one.topic], nanoseconds(one.at), data)
        counts[one.topic, one.kind] += 1
    return tuple(Written(*key, count) for key, count in sorted(counts.items()))


def entries(run: Run) -> Iterator[Entry]:
    """All of a run that goes into a bag, in the order of time; what was said is there once."""
    verdicts: dict[Identity, Judged] = {}
    for judged in run.history.judged:
        verdicts.setdefault((judged.sender, judged.receiver, judged.id), judged)
    telling = Telling(run.system, verdicts.get)
    happenings = of_history(msgspec.structs.replace(run.history, copies=()))
    told = (entry for one in happenings for entry in telling.take(one))
    yield from heapq.merge(told, _logs(run), key=attrgetter("at"))


def _logs(run: Run) -> Iterator[Entry]:
    """Yield the lines of the agents' logs, of a run folder."""
    lines = [line for file in run.place.glob("logs/*.jsonl*") for line in _logged(file)]
    for line in sorted(lines):
        yield logged(*line)


def _logged(file: Path) -> Iterator[tuple[float, str, str, str]]:
    """Yield time [unix s], agent, level and words of the lines of a log that can be read."""
    for raw in file.read_bytes().splitlines() if file.is_file() else ():
        with suppress(msgspec.MsgspecError, KeyError, TypeError, ValueError):
            line = msgspec.json.decode(raw, type=dict[str, Any])
            at, *words = (line.pop(key) for key in ("t", "agent", "level", "event"))
            name, level, event = map(str, words)
            fields = (f"{key}={value}" for key, value in line.items())
            yield float(at), name, level, " ".join((event, *fields))
