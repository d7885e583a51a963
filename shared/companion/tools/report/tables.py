"""Tables of a run that only this robot has: its events on both clocks, and the loop's telemetry (20
Hz).
"""

from typing import Any

import pyarrow

from companion.tools.report.clock import Clock
from companion.tools.report.events import events
from companion.tools.telemetry import robot
from operate.experiments.tables import table
from operate.recording.history import History
from velma.names import BODY


def of_history(history: History) -> dict[str, pyarrow.Table]:
    """Return the tables by name."""
    return {"events": happened(history), "telemetry": telemetry(history)}


def happened(history: History) -> pyarrow.Table:
    """The events of a run: t [s after the first communicate], sim_s, name with what it is of,
    channels, text.
    """
    clock, found = Clock(history), events(history)
    columns: dict[str, list[Any]] = {
        "t": [one.at - history.begin for one in found],
        "sim_s": [clock.sim(one.at) for one in found],
        "name": [one.name for one in found],
        "channels": [" ".join(one.channels) for one in found],
        "text": [one.text for one in found],
    }
    types = {
        name: pyarrow.float64() if name in ("t", "sim_s") else pyarrow.string() for name in columns
    }
    return table(types, columns)


def telemetry(history: History) -> pyarrow.Table:
    """Telemetry of the loop: times, joints [rad], work [J], mode, act, cycles and how late they
    were [us].
    """
    states = robot(history)
    columns: dict[str, list[Any]] = {
        "t": [at - history.begin for at, _ in states],
        "sim_s": [state.sim_time_s for _, state in states],
        "work_J": [state.work_J for _, state in states],
        "mode": [state.mode for _, state in states],
        "act": [state.act for _, state in states],
        "skill": [state.skill for _, state in states],
        "cycles": [state.cycles for _, state in states],
        "missed": [state.missed for _, state in states],
        "skipped": [state.skipped for _, state in states],
        "faults": [state.faults for _, state in states],
        "lateness_p50_us": [state.lateness_us.p50 for _, state in states],
        "lateness_p99_us": [state.lateness_us.p99 for _, state in states],
        "lateness_max_us": [state.lateness_us.max for _, state in states],
        "compute_p50_us": [state.compute_us.p50 for _, state in states],
        "compute_p99_us": [state.compute_us.p99 for _, state in states],
    }
    types = {
        name: pyarrow.string() if name in ("mode", "act", "skill") else pyarrow.float64()
        for name in columns
    }
    types |= dict.fromkeys(("cycles", "missed", "skipped", "faults"), pyarrow.int64())
    for n, joint in enumerate(BODY):
        columns[joint] = [state.body[n] if n < len(state.body) else None for _, state in states]
        types[joint] = pyarrow.float64()
    return table(types, columns)
