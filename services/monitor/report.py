"""report.json: what a run came to, in figures. Built from a History alone, so it can be made again at any time.

A figure that was not recorded is null, and `missing` says why; nothing is guessed. Times `t` count from the first
communicate [s of wall time].
"""

from pathlib import Path

import msgspec

from companion.run_folder import REPORT_FILE
from services.monitor import counts, events, plans, verdict
from services.monitor.clock import Clock
from services.monitor.history import History


class Happened(msgspec.Struct, frozen=True):
    """An event: `t` s after the first communicate; `sim_s`: the simulation's clock then, null where nobody said."""

    t: float
    name: str
    channels: tuple[str, ...]
    sim_s: float | None


class Plan(msgspec.Struct, frozen=True):
    """How a plan was made, and how it ended when it was carried out (null: it was not, or did not end)."""

    number: int
    task: str
    t: float
    queries: int
    communicates: int
    bytes: int
    wall_s: float | None
    outcome: str | None
    reason: str
    expected_s: float | None
    ended: str | None


class LatenessUs(msgspec.Struct, frozen=True):
    """How late cycles began [us]."""

    p50: float
    p99: float
    p999: float
    max: float


class Loop(msgspec.Struct, frozen=True):
    """The control loop's figures, as it told them last."""

    cycles: int
    missed: int
    skipped: int
    lateness_us: LatenessUs
    faults: int


class HoleAt(msgspec.Struct, frozen=True):
    """Something that was not recorded, from `start` to `end` [s after the first communicate]."""

    start: float
    end: float
    communicates: int
    text: str


class Report(msgspec.Struct, frozen=True):
    """report.json. `wall_time_s`: from the person's command to its end; `sim_time_s`: of all acts; `energy_J`: work of
    the body's joints.
    """

    success: bool
    failure: str | None
    poured_fraction: float | None
    bowl_tilt_deg: float | None
    sim_time_s: float | None
    wall_time_s: float | None
    energy_J: float | None
    communicates: counts.Communicates
    plans: tuple[Plan, ...]
    events: tuple[Happened, ...]
    latency: tuple[counts.Latency, ...]
    loop: Loop | None
    began: float
    holes: tuple[HoleAt, ...]
    missing: tuple[str, ...]


def build(history: History) -> Report:
    """The figures of a run."""
    clock, state = Clock(history), verdict.poured(history)
    failure = verdict.failure(history)
    report = Report(
        success=failure is None,
        failure=failure,
        poured_fraction=state.fraction,
        bowl_tilt_deg=state.bowl_tilt_deg,
        sim_time_s=_sim_time(history, clock),
        wall_time_s=_wall_time(history),
        energy_J=_energy(history),
        communicates=counts.communicates(history),
        plans=_plans(history),
        events=_events(history, clock),
        latency=counts.latencies(history),
        loop=_loop(history),
        began=history.begin,
        holes=tuple(
            HoleAt(hole.start - history.begin, hole.end - history.begin, hole.communicates, hole.text)
            for hole in history.holes
        ),
        missing=(),
    )
    return msgspec.structs.replace(report, missing=_missing(report, history))


def write(run: Path, report: Report) -> Path:
    """Write report.json into the run folder, so that a reader sees the old one or the new one."""
    path = run / REPORT_FILE
    beside = path.with_name(f".{path.name}")
    beside.write_bytes(msgspec.json.format(msgspec.json.encode(report), indent=2) + b"\n")
    beside.replace(path)
    return path


def _sim_time(history: History, clock: Clock) -> float | None:
    """Simulated time in which an act was under way."""
    asked = plans.acts(history)
    spans = [(act.start, act.end) for act in asked if act.end is not None]
    return clock.spent(spans) if spans else None


def _wall_time(history: History) -> float | None:
    command = plans.task_command(history)
    end = None if command is None else plans.task_end(history, command)
    return None if command is None or end is None else end.received - command.received


def _energy(history: History) -> float | None:
    work = [state.work_J for _, state in history.robot[-1:]] or [truth.work_J for _, truth in history.truth[-1:]]
    return work[0] if work else None


def _plans(history: History) -> tuple[Plan, ...]:
    """Plans in the order they were asked for; the n-th found is the n-th carried out."""
    ran = {run.plan: run for run in plans.ran(history)}
    return tuple(
        Plan(
            number=made.number,
            task=made.task,
            t=made.start - history.begin,
            queries=made.queries,
            communicates=made.communicates,
            bytes=made.bytes,
            wall_s=made.wall_s,
            outcome=made.outcome,
            reason=made.reason,
            expected_s=made.expected_s,
            ended=ran[made.plan].outcome if made.plan in ran else None,
        )
        for made in plans.made(history)
    )


def _events(history: History, clock: Clock) -> tuple[Happened, ...]:
    return tuple(
        Happened(event.at - history.begin, event.name, event.channels, clock.sim(event.at))
        for event in events.events(history)
    )


def _loop(history: History) -> Loop | None:
    if not history.robot:
        return None
    last = history.robot[-1][1]
    late = last.lateness_us
    return Loop(
        last.cycles, last.missed, last.skipped, LatenessUs(late.p50, late.p99, late.p999, late.max), last.faults
    )


def _missing(report: Report, history: History) -> tuple[str, ...]:
    """A sentence for each figure that is null."""
    no_telemetry = "the robot's telemetry was not recorded" if not history.robot else "the task did not come so far"
    no_truth = "the truth was not recorded" if not history.truth else "the scene has no such thing"
    reasons = {
        "poured_fraction": no_truth,
        "bowl_tilt_deg": no_truth,
        "sim_time_s": no_telemetry,
        "wall_time_s": "the command or its end was not heard",
        "energy_J": "neither telemetry nor truth was recorded",
        "loop": no_telemetry,
    }
    return tuple(f"{name}: {why}" for name, why in reasons.items() if getattr(report, name) is None)
