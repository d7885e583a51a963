"""The figures of a pour, for report.json, and the paper's beside them (paper.toml has their
source). Built from a History alone, so it can be made again at any time.

A figure that was not recorded is null, and `missing` says why; nothing is guessed. Times `t` count
from the first communicate [s of wall time].
"""

from math import fsum
from pathlib import Path

import msgspec
from msgspec.structs import replace

from companion.design import DESIGN
from companion.sentences import happened
from companion.telemetry import PageFaults, RobotState, TrueState
from companion.tools.report import believed, events, plans, verdict
from companion.tools.report.plans import Figures, Share, judges
from companion.tools.system import SYSTEM
from companion.tools.telemetry import Clock, newest, paced
from operate.recording.history import History
from operate.recording.records import Spoken
from operate.reports import counts
from operate.reports import report as general
from operate.reports.report import FaultAt, HoleAt, Judged
from operate.structs import alike


class PaperPlan(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The making of a plan in the paper; None: not stated."""

    number: int
    wall_s: float
    communicates: int
    mean_kbit_s: float | None = None
    peak_kbit_s: float | None = None


class PaperEvent(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One of its events, by our name: `t` s from the start of its run."""

    event: str
    t: float
    of: tuple[str, ...] = ()

    @property
    def id(self) -> str:
        """Its name with what it is of."""
        return " ".join((self.event, *self.of))


class Paper(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Its run. `matrix`: sender -> receiver -> count."""

    source: str
    total_table: int
    small: float
    largest_bytes: int
    c4_least_bytes: int
    c4_mean_bytes: int
    c4_largest_bytes: int
    time: tuple[PaperEvent, ...]
    matrix: dict[str, dict[str, int]]
    plan: tuple[PaperPlan, ...]

    @property
    def times(self) -> dict[str, float]:
        """Our id of an event -> seconds from the start."""
        return {one.id: one.t for one in self.time}

    def made(self, number: int) -> PaperPlan | None:
        """The plan of this number."""
        return next((plan for plan in self.plan if plan.number == number), None)


PAPER = msgspec.toml.decode(Path(__file__).with_name("paper.toml").read_bytes(), type=Paper)
TABLE_8 = ("co", "hi", "km", "pl", "ta", "ex")
"""The agents in the order of the paper's Table 8."""


class Happened(msgspec.Struct, frozen=True):
    """An event, `of` these things, numbers or outcomes, `t` s after the first communicate. `sim_s`:
    the simulation's clock then, null where nobody said; `words`: for people; `text`: why.
    """

    t: float
    name: str
    of: tuple[str, ...]
    words: str
    channels: tuple[str, ...]
    sim_s: float | None
    text: str = ""

    @property
    def id(self) -> str:
        """Its name with what it is of."""
        return " ".join((self.name, *self.of))


class Task(msgspec.Struct, frozen=True):
    """A command of a person, from `t` to `end` [s]; null: it did not end. `asked`: what for;
    `outcome`: co's last word.

    `success`: by what was true at its end where the task has a verdict of its own, else by co's
    word; `failure`: why not, else null. `claims`: what the robot said that is true at the end.
    """

    t: float
    end: float | None
    asked: str
    outcome: str
    success: bool
    failure: str | None
    claims: tuple[believed.Claimed, ...] = ()


class Plan(msgspec.Struct, frozen=True):
    """The making of a plan, and its end when it was carried out (null: it was not, or did not end).

    `wall_s`: from co's request to pl's answer; `km_s`: in which pl waited for km, `km_longest_s`
    for one answer alone.
    """

    number: int
    task: str
    t: float
    queries: int
    km_s: float
    km_longest_s: float
    communicates: int
    bytes: int
    wall_s: float | None
    outcome: str | None
    reason: str
    expected_s: float | None
    ended: str | None


class Us(msgspec.Struct, frozen=True):
    """Durations [us]; null: not counted."""

    p50: float | None = None
    p99: float | None = None
    p999: float | None = None
    max: float | None = None


class Loop(msgspec.Struct, frozen=True):
    """The control loop's figures, as it told them last.

    `paced`: it kept a clock (speed 1); else no cycle has a deadline, and what counts against one is
    null. `realtime`: with the kernel's real-time priority. `compute_us`: how long a cycle takes.
    `saturated`: cycles whose torque was cut to what the robot accepts. `page_faults`: during
    motions.
    """

    paced: bool
    realtime: bool
    cycles: int
    missed: int | None
    skipped: int | None
    lateness_us: Us
    compute_us: Us
    faults: int
    saturated: int
    page_faults: PageFaults


class Report(msgspec.Struct, frozen=True):
    """report.json. `wall_time_s`: from the person's command to its end; `sim_time_s`: of all acts;
    `energy_J`: work of the body's joints. `beliefs`: where the robot believes each thing to be,
    beside the truth; `poured`: how much it believes to have poured, beside the truth.
    """

    success: bool
    failure: str | None
    poured_fraction: float | None
    bowl_tilt_deg: float | None
    sim_time_s: float | None
    wall_time_s: float | None
    energy_J: float | None
    communicates: counts.Communicates
    judged: Judged | None
    plans: tuple[Plan, ...]
    events: tuple[Happened, ...]
    latency: tuple[counts.Latency, ...]
    loop: Loop | None
    seed: int | None
    speed: str | None
    scene: str | None
    began: float
    holes: tuple[HoleAt, ...]
    missing: tuple[str, ...]
    faults: tuple[FaultAt, ...] = ()
    beliefs: tuple[believed.Believed, ...] = ()
    poured: Share | None = None
    tasks: tuple[Task, ...] = ()


def build(history: History) -> Report:
    """The figures of a run."""
    clock, failure = Clock(history), verdict.failure(history)
    figures = next((one.figures(history) for one in judges() if one.figures), Figures())
    report = alike(
        Report,
        general.build(history, SYSTEM),
        success=failure is None,
        failure=failure,
        poured_fraction=figures.poured_fraction,
        bowl_tilt_deg=figures.bowl_tilt_deg,
        sim_time_s=_sim_time(history, clock),
        wall_time_s=_wall_time(history),
        energy_J=_energy(history),
        communicates=counts.communicates(history, DESIGN, TABLE_8),
        plans=_plans(history),
        events=_events(history, clock),
        loop=_loop(history),
        missing=(),
        beliefs=believed.beliefs(history),
        poured=figures.poured,
        tasks=tuple(_task(history, command) for command in plans.commands(history)),
    )
    return replace(report, missing=_missing(report, history))


def _task(history: History, command: Spoken) -> Task:
    end, failure = plans.task_end(history, command), verdict.failure_of(history, command)
    return Task(
        t=command.received - history.begin,
        end=None if end is None else end.received - history.begin,
        asked=plans.asked(command),
        outcome=plans.outcome(end),
        success=failure is None,
        failure=failure,
        claims=believed.claims(history, command),
    )


def _sim_time(history: History, clock: Clock) -> float | None:
    """Simulated time in which an act was under way: at speed 1 from ex's agreement on, for time
    also passes while ex prepares; without a clock it stands still then, and the request is the
    surer beginning.
    """
    asked = [act for act in plans.acts(history) if act.end is not None and act.agreed is not None]
    begins = [(act, act.agreed if paced(history) else act.start) for act in asked]
    spans = [(begun or act.start, act.end or act.start) for act, begun in begins]
    return clock.spent(spans) if spans else None


def _wall_time(history: History) -> float | None:
    command = plans.task_command(history)
    end = None if command is None else plans.task_end(history, command)
    return None if command is None or end is None else history.answered(command, end)


def _energy(history: History) -> float | None:
    measured, true = newest(history, RobotState), newest(history, TrueState)
    last = measured or true
    return None if last is None else last[1].work_J


def _plans(history: History) -> tuple[Plan, ...]:
    """Plans in the order they were asked for; the n-th found is the n-th carried out."""
    ran = {run.plan: run for run in plans.ran(history)}
    found = []
    for made in plans.made(history):
        waits = [end - start for start, end in made.waits]
        ended = ran[made.plan].outcome if made.plan in ran else None
        t, longest = made.start - history.begin, max(waits, default=0.0)
        found.append(alike(Plan, made, t=t, km_s=fsum(waits), km_longest_s=longest, ended=ended))
    return tuple(found)


def _events(history: History, clock: Clock) -> tuple[Happened, ...]:
    return tuple(
        alike(
            Happened,
            event,
            t=event.at - history.begin,
            name=event.kind,
            words=happened(event.kind, event.of),
            sim_s=clock.sim(event.at),
        )
        for event in events.events(history)
    )


def _loop(history: History) -> Loop | None:
    found = newest(history, RobotState)
    if found is None:
        return None
    last, has_clock = found[1], bool(paced(history))
    unpaced = {} if has_clock else {"missed": None, "skipped": None}
    return alike(
        Loop,
        last,
        paced=has_clock,
        lateness_us=alike(Us, last.lateness_us) if has_clock else Us(),
        compute_us=alike(Us, last.compute_us) if last.compute_us.max else Us(),
        **unpaced,
    )


def _missing(report: Report, history: History) -> tuple[str, ...]:
    """A sentence for each figure that is null."""
    no_telemetry = "the robot's telemetry was not recorded"
    if newest(history, RobotState) is not None:
        no_telemetry = "the task did not come so far"
    truth_there = verdict.truth_at_end(history, plans.task_command(history)) is not None
    unrecorded = "the truth was not recorded at the end of the task"
    no_truth = "the scene has no such thing" if truth_there else unrecorded
    reasons = {
        "poured_fraction": no_truth,
        "bowl_tilt_deg": no_truth,
        "sim_time_s": no_telemetry,
        "wall_time_s": "the command or its end was not heard",
        "energy_J": "neither telemetry nor truth was recorded",
        "loop": no_telemetry,
        "judged": "the recorder heard nothing",
    }
    return tuple(f"{name}: {why}" for name, why in reasons.items() if getattr(report, name) is None)
