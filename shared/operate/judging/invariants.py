"""Invariants of a run whatever was done to it, judged over its whole history: each broken one gives
a sentence.

All of it is of any system; what a system promises beyond it is its addition `promises`. Success is
not among it: a task that failed and says why has broken nothing.
"""

from collections.abc import Iterator
from contextlib import suppress
from itertools import permutations
from pathlib import Path

import msgspec

from agent_runtime.core.state import Record
from agent_runtime.io.journal import last_record
from operate.file_names import REPORT_FILE
from operate.recording.history import History
from operate.recording.run import Run
from operate.system import Job
from topdown.model.design import Design

MOST_BYTES = 256 * 1024 * 1024
"""Of a run folder; estimate: a pour leaves some tens of megabytes, nearly all pictures."""


class Checked(msgspec.Struct, frozen=True):
    """Broken invariants, a sentence each, and the size of the run folder [bytes]."""

    broken: tuple[str, ...]
    bytes: int


def checked(ended: Run) -> Checked:
    """Return what does not hold of a run that has ended."""
    run, system, past = ended.place, ended.system, ended.history
    records = _records(run, system.design)
    size = sum(file.lstat().st_size for file in run.rglob("*"))
    promises = system.addition("promises")
    found = [
        *_against_design(past),
        *lost(records),
        *_undeclared(past, system.design),
        *(_not_at_rest(records, system.job) if _ended(run) else ()),
        *(promises(past) if promises is not None else ()),
    ]
    if size > MOST_BYTES:
        found.append(
            f"the run folder has {size / 1e6:.0f} MB, at most {MOST_BYTES / 1e6:.0f} are allowed"
        )
    return Checked(tuple(found), size)


def lost(records: dict[str, Record]) -> Iterator[str]:
    """Yield the durable streams of which something is gone, by what the agents' journals had in the
    end.

    What a sender numbered was taken by its receiver, or waits in its outbox.
    """
    for sender, receiver in permutations(records, 2):
        said = records[sender].issued.get(receiver, 0)
        taken = records[receiver].taken.get(sender, 0)
        waiting = {one.number for one in records[sender].outbox.get(receiver, ())}
        if taken > said:
            yield f"{receiver} took {taken} durable messages of {sender}, which said {said}"
        elif gone := sorted({*range(taken + 1, said + 1)} - waiting):
            yield (
                f"{len(gone)} durable messages of {sender} to {receiver} are lost, the first one"
                f" has number {gone[0]}"
            )


def _records(run: Path, design: Design) -> dict[str, Record]:
    """Return the last record of each agent's journal; an agent without one is left out."""
    found = {}
    for agent in design.agents:
        with suppress(OSError, msgspec.MsgspecError):
            data = last_record((run / "journal" / f"{agent}.journal").read_bytes())
            if data is not None:
                found[agent] = msgspec.msgpack.decode(data, type=Record)
    return found


def _against_design(past: History) -> Iterator[str]:
    against = [one for one in past.judged if one.violation]
    if against:
        yield f"{len(against)} communicates are against the design, the first one: {against[0].why}"


def _undeclared(past: History, design: Design) -> Iterator[str]:
    """Yield the states that agents told and the design does not have; "" is that of one that has
    told none yet.
    """
    declared = {
        name: {"", *(one.name for one in entry.state)} for name, entry in design.agents.items()
    }
    told = {(one.agent, one.state): None for one in past.entered if one.agent in declared}
    yield from (
        f"{agent} was in state {state!r}" for agent, state in told if state not in declared[agent]
    )


def _ended(run: Path) -> bool:
    """Whether the job came to an end, well or not: the report says so. Else nobody needs to be at
    rest.
    """
    try:
        return "success" in msgspec.json.decode((run / REPORT_FILE).read_bytes())
    except (OSError, msgspec.MsgspecError, TypeError):
        return False


def _not_at_rest(records: dict[str, Record], job: Job) -> Iterator[str]:
    """Yield the agents that were not in the state in which the job leaves them."""
    for agent, rest in job.rests.items():
        if agent in records and records[agent].state != rest:
            yield f"{agent} was still {records[agent].state} at the end, and not {rest}"
