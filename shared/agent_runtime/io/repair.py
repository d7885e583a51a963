"""A damaged journal made usable again: its newest whole record is kept, and the damaged file beside it.

What came after the newest whole record cannot be known, and peers may have heard of it: then the agent goes on with
that memory under another journal's name, so that its peers begin again with it (core.lineage).
"""

import os
from pathlib import Path

import msgspec

from agent_runtime.core.errors import JournalError
from agent_runtime.core.lineage import begin_again
from agent_runtime.core.state import Record
from agent_runtime.io.journal import NAME, locked, looked_through, new_name, put, scan

WHY = "this agent's journal was damaged, and what it knew of this conversation is not certain"


class Repaired(msgspec.Struct, frozen=True):
    """Result of a repair. `kept`: the journal's bytes as they were, "" where nothing was wrong. `lost`: in words."""

    path: str
    good: int
    damaged: tuple[int, ...]
    kept: str
    lost: str


def repair(path: Path) -> Repaired:
    """Repair a journal. Raise JournalError where there is none, an agent holds it, or it is of another version."""
    if not path.exists():
        raise JournalError(path, "there is none", "look with `roco runs` which run folder is meant")
    lock = locked(path)
    try:
        return _repaired(path, path.read_bytes())
    finally:
        os.close(lock)


def _repaired(path: Path, data: bytes) -> Repaired:
    found = looked_through(path, data) if data.startswith(NAME) else scan(data)
    tail = len(data) - found.end
    if not (found.damaged or tail):
        return Repaired(str(path), found.good, (), "", "nothing: it is whole")
    beside = free_name(path)
    os.link(path, beside)
    record, lost = _goes_on(found.last, tail)
    os.close(put(path, record)[0])
    return Repaired(str(path), found.good, found.damaged, str(beside), lost)


def _goes_on(last: bytes | None, tail: int) -> tuple[bytes | None, str]:
    """Return the record to go on from, and what is lost in words."""
    if last is None:
        return None, "everything: no record is whole, so the agent begins with an empty memory"
    if not tail:
        return last, "nothing: the newest record is whole, and each one is the agent's whole memory"
    record = msgspec.msgpack.decode(last, type=Record)
    peers = {held.conversation.peer for held in record.conversations.values()} | {*record.issued, *record.taken}
    for peer in peers:
        begin_again(record, peer, WHY)
    record.journal = new_name()
    what = f"what the agent did after its newest whole record ({tail} bytes behind it cannot be read)"
    return msgspec.msgpack.encode(record), f"{what}; open conversations end: {len(record.lost)}"


def free_name(path: Path) -> Path:
    """Return a name beside the file that nothing has."""
    names = (path.with_name(f"{path.name}.damaged{f'-{number}' if number else ''}") for number in range(1000))
    return next(name for name in names if not name.exists())
