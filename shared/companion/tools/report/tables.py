"""Tables that only this robot has, for `roco export`: what happened, and the loop's telemetry."""

from typing import Any

import pyarrow

from companion.telemetry import RobotState
from companion.tools.report.events import events
from companion.tools.telemetry import Clock, every
from operate.experiments.tables import table
from operate.recording.history import History
from velma.names import BODY

TEXTS, COUNTS = ("mode", "act", "skill"), ("cycles", "missed", "skipped", "faults")
QUANTILES = (
    "lateness_p50_us", "lateness_p99_us", "lateness_max_us", "compute_p50_us", "compute_p99_us",
)  # fmt: skip


def of_history(history: History) -> dict[str, pyarrow.Table]:
    """Return the tables by name."""
    return {"events": event_table(history), "telemetry": telemetry(history)}


def event_table(history: History) -> pyarrow.Table:
    """The events of a run: t [s after the first communicate], sim_s, name with what it is of,
    channels, text.
    """
    clock, found = Clock(history), events(history)
    names = [(one.name, " ".join(one.channels), one.text) for one in found]
    columns: dict[str, list[Any]] = {
        "t": [one.at - history.begin for one in found],
        "sim_s": [clock.sim(one.at) for one in found],
        **{
            column: [one[n] for one in names]
            for n, column in enumerate(("name", "channels", "text"))
        },
    }
    types = dict.fromkeys(columns, pyarrow.string())
    return table(types | dict.fromkeys(("t", "sim_s"), pyarrow.float64()), columns)


def telemetry(history: History) -> pyarrow.Table:
    """Telemetry of the loop: times, joints [rad], work [J], mode, act, cycles and how late they
    were [us].
    """
    states = every(history, RobotState)
    columns: dict[str, list[Any]] = {
        "t": [at - history.begin for at, _ in states],
        "sim_s": [state.sim_time_s for _, state in states],
    }
    for name in ("work_J", *TEXTS, *COUNTS):
        columns[name] = [getattr(state, name) for _, state in states]
    for name in QUANTILES:  # lateness_p50_us: p50 of lateness_us
        of, _, quantile = name.removesuffix("_us").partition("_")
        columns[name] = [getattr(getattr(state, f"{of}_us"), quantile) for _, state in states]
    for n, joint in enumerate(BODY):
        columns[joint] = [state.body[n] if n < len(state.body) else None for _, state in states]
    types = dict.fromkeys(columns, pyarrow.float64())
    types |= dict.fromkeys(TEXTS, pyarrow.string()) | dict.fromkeys(COUNTS, pyarrow.int64())
    return table(types, columns)
