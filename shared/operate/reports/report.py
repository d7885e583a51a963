"""report.json: the figures of a run. Built from a History alone, so it can be made again at any
time.

This is the part that every system has; a system may build a larger one (operate.system.Additions).
A figure that was not recorded is null; nothing is guessed. Times `t` count from the first
communicate [s of wall time].
"""

from collections import Counter
from pathlib import Path
from typing import Any

import msgspec

from agent_runtime.io.run_files import write_whole
from operate.file_names import REPORT_FILE
from operate.recording.history import History
from operate.reports import counts
from operate.structs import alike
from operate.system import System
from topdown.judge.verdicts import Verdict


class HoleAt(msgspec.Struct, frozen=True):
    """Something that was not recorded, from `start` to `end` [s after the first communicate]."""

    start: float
    end: float
    communicates: int
    text: str


class NotAsDesigned(msgspec.Struct, frozen=True):
    """A communicate that is against the design: `t` s after the first one; `verdict` and `why` are
    the judge's.
    """

    t: float
    verdict: str
    channel: str
    sender: str
    receiver: str
    protocol: str
    performative: str
    conversation: str
    id: str
    why: str


class Judged(msgspec.Struct, frozen=True):
    """Verdicts on the recording: number of communicates with copies, count of each verdict, and
    each of those that are against the design. Null in a report: nothing was recorded.
    """

    communicates: int
    verdicts: dict[str, int]
    violations: tuple[NotAsDesigned, ...]


class Busy(msgspec.Struct, frozen=True):
    """An agent was in a state from `start` to `end` [s after the first communicate]; `state` "": it
    was gone.
    """

    agent: str
    state: str
    start: float
    end: float


class FaultAt(msgspec.Struct, frozen=True):
    """A fault that was done on purpose, from `start` to `end` [s after the first communicate];
    null: to the end.

    `at`: the moment that was asked for, "" for at once; `text`: what came of it; `what`: of a kind
    that only this system has, what was done to which part, in words.
    """

    kind: str
    target: str
    at: str
    start: float
    end: float | None
    text: str
    what: str = ""


class Report(msgspec.Struct, frozen=True):
    """The report of a run of any system. `failure`: why it is not a success, else null; `busy`: who
    was in which state when.
    """

    system: str
    success: bool
    failure: str | None
    communicates: counts.Communicates
    judged: Judged | None
    latency: tuple[counts.Latency, ...]
    busy: tuple[Busy, ...]
    seed: int | None
    speed: str | None
    scene: str | None
    began: float
    holes: tuple[HoleAt, ...]
    faults: tuple[FaultAt, ...] = ()


def of(history: History, system: System) -> Any:
    """Return the figures of a run as its system has them: its addition `report`, or `build`."""
    own = system.addition("report")
    return build(history, system) if own is None else history.once(own)


def build(history: History, system: System) -> Report:
    """Return the figures of a run."""
    against = failure(history)
    return Report(
        system=system.name,
        success=against is None,
        failure=against,
        communicates=counts.communicates(history, system.design),
        judged=judged(history),
        latency=counts.latencies(history, system.design),
        busy=busy(history),
        seed=history.setting.seed if history.setting else None,
        speed=history.setting.speed if history.setting else None,
        scene=history.setting.scene if history.setting else None,
        began=history.begin,
        holes=holes(history),
        faults=faults(history),
    )


def failure(history: History) -> str | None:
    """Return why a run is not a success: nothing was said, somebody was down at its end, or
    something said is against the design; None where it is one.
    """
    if not history.said:
        return "no communicate was heard"
    if history.down:
        return "; ".join(
            f"{one.name} was {one.state} at the end{f': {one.note}' * bool(one.note)}"
            for one in history.down
        )
    against = [one for one in history.judged if one.violation]
    if against:
        return f"{len(against)} communicates are not as designed, the first one: {against[0].why}"
    return None


def write(run: Path, report: msgspec.Struct) -> Path:
    """Write report.json into the run folder, so that a reader sees the old one or the new one."""
    path = run / REPORT_FILE
    write_whole(path, msgspec.json.format(msgspec.json.encode(report), indent=2) + b"\n")
    return path


def judged(history: History) -> Judged | None:
    """Return the judge's verdicts; None where nothing was recorded that could be judged."""
    if not history.judged:
        return None
    wrong = [one for one in history.judged if one.violation]
    against = tuple(alike(NotAsDesigned, one, t=one.t - history.begin) for one in wrong)
    counted = Counter(one.verdict for one in history.judged)
    heard = {(one.t, one.sender, one.receiver, one.id) for one in history.judged}
    return Judged(
        communicates=len(heard),
        verdicts={verdict: counted[verdict] for verdict in Verdict if counted[verdict]},
        violations=against,
    )


def holes(history: History) -> tuple[HoleAt, ...]:
    """Return what was not recorded."""
    begin = history.begin
    return tuple(
        alike(HoleAt, hole, start=hole.start - begin, end=hole.end - begin)
        for hole in history.holes
    )


def faults(history: History) -> tuple[FaultAt, ...]:
    """Return the faults that were done on purpose."""
    begin = history.begin
    return tuple(
        alike(
            FaultAt,
            one,
            start=one.began - begin,
            end=None if one.ended is None else one.ended - begin,
        )
        for one in history.faults
    )


def busy(history: History) -> tuple[Busy, ...]:
    """Return the states of the agents over time, each until the next one; the last until the last
    communicate.
    """
    end = max((one.received for one in history.said[-1:]), default=history.begin)
    found: list[Busy] = []
    for agent in dict.fromkeys(one.agent for one in history.entered):
        own = [one for one in history.entered if one.agent == agent]
        until = [*(one.at for one in own[1:]), max(end, own[-1].at)]
        for one, last in zip(own, until, strict=True):
            state, times = one.state if one.alive else "", (one.at, last)
            found.append(Busy(agent, state, *(at - history.begin for at in times)))
    return tuple(found)
