"""Whether a run did the main job, and if not, why.

From the truth of the simulation at the end of the task, whatever was asked for later, as the task
itself judges it (companion.tools.report.plans), and from what the agents said about plans; nothing
is assumed. A missing record is a failure that says so, and so is one from before the end.
"""

from collections import Counter
from collections.abc import Iterator

from companion.languages import cmd, rc, sw
from companion.telemetry import RobotState, TrueState
from companion.tools.report.plans import (
    Judge,
    acts,
    asked,
    judge_of,
    judges,
    made,
    others_plans,
    outcome,
    ran,
    reason,
    task_command,
    task_end,
)
from companion.tools.telemetry import every, newest, next_one
from operate.recording.history import History
from operate.recording.records import Spoken

MOST_TILT_DEG = 10.0
LEAST_LINKS = 2
"""Finger or palm links of a hand that touch what it holds; one alone only leans on it."""
STALE_S = 1.0
"""A true state from longer before the end of the task shows another world; they come 20 times a
second.
"""
OWN_OUTCOMES = (sw.WorkerState.SUCCEEDED, sw.WorkerState.REPLAN)


def truth_at_end(history: History, command: Spoken | None) -> TrueState | None:
    """Return the true state at the end of a task: the newest before it, else the next one before
    the robot acts again.

    Of a task that did not end, or without one, it is the newest of the recording. None where none
    was recorded then.
    """
    end = task_end(history, command) if command is not None else None
    if end is None:
        last = newest(history, TrueState)
        return None if last is None else last[1]
    before = newest(history, TrueState, end.received)
    if before is not None and before[0] >= end.received - STALE_S:
        return before[1]
    later = (act.start for act in acts(history) if act.start > end.received)
    behind = next_one(history, TrueState, end.received)
    if behind is None or behind[0] >= min(later, default=float("inf")):
        return None
    return behind[1]


def last_truth(history: History) -> TrueState | None:
    """Return the newest true state; None where none was recorded, or none after the end of the
    task.
    """
    last, command = newest(history, TrueState), task_command(history)
    end = task_end(history, command) if command is not None else None
    if last is None or (end is not None and last[0] < end.received - STALE_S):
        return None
    return last[1]


def failure(history: History) -> str | None:
    """Return why the run did not do the main job, in words; None: it did."""
    command = task_command(history)
    if command is not None and judge_of(command.content) is None:
        return (
            f"nobody asked to {' or '.join(one.verb for one in judges())}, but to {asked(command)}"
        )
    if command is None:
        return "; ".join(_not_whole(history)) or "no command of a person was heard"
    reasons = list(_against(history, command))
    return "; ".join((*_not_whole(history), *reasons)) if reasons else None


def failure_of(history: History, command: Spoken) -> str | None:
    """Return why a task failed, in words; None: it did not. A task without a verdict of its own is
    as co said.
    """
    return "; ".join(_against(history, command)) or None


def _against(history: History, command: Spoken) -> Iterator[str]:
    """Yield the reasons from plans, else those from the truth: where a plan failed, they need no
    words.
    """
    judge = judge_of(command.content)
    if judge is None:
        yield from _of_end(history, command)
        return
    of_plans = list(_of_plans(history, command))
    yield from of_plans or _of_truth(history, command, judge)


def _not_whole(history: History) -> Iterator[str]:
    """Processes of the fleet that did not run in the end, though nobody had ended them: the cause
    of all else.
    """
    for process in history.down:
        note = f": {process.note}" if process.note else ""
        yield f"{process.name} did not run ({process.state}{note})"


def _of_plans(history: History, command: Spoken) -> Iterator[str]:
    """Yield the failures of the command and its plans; plans of other commands are not the job."""
    end, of_others = task_end(history, command), others_plans(history, command)
    why = reason(end) if outcome(end) != cmd.TaskState.DONE else ""
    yield from _of_end(history, command)
    for plan in made(history):
        if plan.network in of_others:
            continue
        if plan.outcome != "found" and not (plan.reason and plan.reason in why):
            yield f"plan {plan.number}: {plan.reason or plan.outcome or 'no answer came'}"
    plans = [run for run in ran(history) if run.plan not in of_others]
    if not plans and not why:
        yield "no plan was carried out"
    for run in plans:
        if run.outcome not in OWN_OUTCOMES and not (run.reason and run.reason in why):
            how = f"ended {run.outcome}" if run.outcome else "did not end"
            yield f"plan {run.number} {how}{': ' + run.reason if run.reason else ''}"
    if plans and plans[-1].outcome is sw.WorkerState.REPLAN:
        yield "the last plan wanted another one"


def _of_end(history: History, command: Spoken) -> Iterator[str]:
    """Yield how a task ended, unless co said that it is done."""
    end = task_end(history, command)
    if end is None:
        yield "the task did not end"
    elif outcome(end) != cmd.TaskState.DONE:
        why = reason(end)
        yield f"the task ended, {outcome(end)}{': ' + why if why else ''}"


def _of_truth(history: History, command: Spoken, judge: Judge) -> Iterator[str]:
    if truth_at_end(history, command) is None:
        when = ", only at other times" if newest(history, TrueState) is not None else ""
        yield f"the true state of the simulation was not recorded at the end of the task{when}"
        return
    yield from judge.against(history, command)


MODES = ("", "motion", "damping", "hold", "stopped")
"""Of the control loop; "" before it has told one. A test compares them with
services.executor.loop.
"""


def broken(history: History) -> Iterator[str]:
    """Yield what is broken: an act that was begun twice, a mode that is not one, a vessel that
    fell.
    """
    yield from (
        f"the act {key} was begun {times} times" for key, times in begun_twice(history).items()
    )
    yield from (
        f"the control loop was in mode {mode!r}"
        for mode in {one.mode for _, one in every(history, RobotState)} - {*MODES}
    )
    _, last = newest(history, TrueState) or (0.0, TrueState(0.0))
    for name, tilt in last.tilt_deg.items():
        if tilt >= MOST_TILT_DEG and not sum(last.fingers_on.get(name, {}).values()):
            yield f"{name} has fallen: it is tilted by {tilt:.0f} degrees, and in no hand"


def begun_twice(history: History) -> dict[str, int]:
    """The acts that ex agreed to begin more than once, with how often."""
    keys = Counter(one.content.key for one in history.said if isinstance(one.content, rc.Accepted))
    return {key: times for key, times in keys.items() if times > 1}
