"""Tables of a run that only this robot has: its events on both clocks, and the loop's telemetry (20 Hz)."""

from typing import Any

import numpy as np
import pyarrow

from companion.tools.report.events import events
from companion.tools.telemetry import robot, truth
from operate.experiments.tables import table
from operate.recording.history import History
from velma.names import BODY

# --- The simulation's clock, read off the robot's telemetry: what simulated time it was when something was heard -----


LOOSE_S = 1.0
"""Further than this from any telemetry a simulated time is a guess, and not given; telemetry comes at 20 Hz."""


class Clock:
    """Simulated seconds by unix seconds."""

    def __init__(self, history: History) -> None:
        pairs = [(at, state.sim_time_s) for at, state in robot(history)] or [(at, t.time_s) for at, t in truth(history)]
        self._wall = np.array([at for at, _ in pairs])
        self._sim = np.array([sim for _, sim in pairs])

    def sim(self, wall: float) -> float | None:
        """Simulated time at `wall`; None where nothing says."""
        if not len(self._wall) or np.abs(self._wall - wall).min() > LOOSE_S:
            return None
        return float(np.interp(wall, self._wall, self._sim))

    def spent(self, spans: list[tuple[float, float]]) -> float | None:
        """Simulated time in the union of spans of wall time; None where a span's end is not known."""
        total, until = 0.0, -np.inf
        for start, end in sorted(spans):
            a, b = self.sim(max(start, until)), self.sim(end)
            if a is None or b is None:
                return None
            total += max(0.0, b - a)
            until = max(until, end)
        return total


# ----------------------------------------------------------------------------------------------------------------------


def of_history(history: History) -> dict[str, pyarrow.Table]:
    """Return the tables by name."""
    return {"events": happened(history), "telemetry": telemetry(history)}


def happened(history: History) -> pyarrow.Table:
    """The events of a run: t [s after the first communicate], sim_s, name with what it is of, channels, text."""
    clock, found = Clock(history), events(history)
    columns: dict[str, list[Any]] = {
        "t": [one.at - history.begin for one in found],
        "sim_s": [clock.sim(one.at) for one in found],
        "name": [one.name for one in found],
        "channels": [" ".join(one.channels) for one in found],
        "text": [one.text for one in found],
    }
    types = {name: pyarrow.float64() if name in ("t", "sim_s") else pyarrow.string() for name in columns}
    return table(types, columns)


def telemetry(history: History) -> pyarrow.Table:
    """Telemetry of the loop: times, joints [rad], work [J], mode, act, cycles and how late they were [us]."""
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
    types = {name: pyarrow.string() if name in ("mode", "act", "skill") else pyarrow.float64() for name in columns}
    types |= dict.fromkeys(("cycles", "missed", "skipped", "faults"), pyarrow.int64())
    for n, joint in enumerate(BODY):
        columns[joint] = [state.body[n] if n < len(state.body) else None for _, state in states]
        types[joint] = pyarrow.float64()
    return table(types, columns)
