"""Whether a run did the main job, and if not, why: poured, jar in a hand, bowl level on the table, plans ended.

From the truth of the simulation at the end of the task, whatever was asked for later, and from what the agents said
about plans; nothing is assumed. A missing record is a failure that says so, and so is one from before the end.
"""

from collections.abc import Iterator

import msgspec

from companion.languages import cmd, sw, wm
from companion.languages.values import Pose
from companion.models import KNOWN_AS, MODELS
from companion.telemetry import TrueState
from companion.tools.report.plans import acts, asked, made, others_plans, outcome, ran, reason, task_command, task_end
from companion.tools.telemetry import truth
from operate.recording.history import History
from operate.recording.records import Spoken

LEAST_POURED = 0.9
MOST_TILT_DEG = 10.0
LEAST_LINKS = 2
"""Finger or palm links of a hand that touch what it holds; one alone only leans on it."""
ON_TABLE_M = 0.02
"""Between a vessel's base and the table's top; estimate: contacts are soft, table poses may be observed ones (4 mm)."""
STALE_S = 1.0
"""A true state from longer before the end of the task shows another world; they come 20 times a second."""
OWN_OUTCOMES = (sw.WorkerState.SUCCEEDED, sw.WorkerState.REPLAN)
TABLES = {name for name, model in MODELS.items() if model.kind == "Table"}


class Poured(msgspec.Struct, frozen=True):
    """What was true of jar and bowl at the end of a task; None where it was not recorded."""

    fraction: float | None = None
    bowl_tilt_deg: float | None = None
    jar_links: int | None = None
    bowl_links: int | None = None
    bowl_on_table: bool | None = None


def poured(history: History, command: Spoken | None) -> Poured:
    """Return what was true at the end of a task; without a command at the end of the recording."""
    now = truth_at_end(history, command)
    if now is None:
        return Poured()
    jar, bowl = _vessel(now, "jar"), _vessel(now, "bowl")
    return Poured(
        fraction=now.grains_in.get(bowl, 0) / now.grains if bowl and now.grains else None,
        bowl_tilt_deg=now.tilt_deg.get(bowl),
        jar_links=max(now.fingers_on[jar].values(), default=0) if jar in now.fingers_on else None,
        bowl_links=sum(now.fingers_on[bowl].values()) if bowl in now.fingers_on else None,
        bowl_on_table=_on_table(history, now, bowl) if bowl else None,
    )


def truth_at_end(history: History, command: Spoken | None) -> TrueState | None:
    """Return the true state at the end of a task: the newest before it, else the next one before the robot acts again.

    Of a task that did not end, or without one, it is the newest of the recording. None where none was recorded then.
    """
    recorded, end = truth(history), task_end(history, command) if command is not None else None
    if end is None:
        return recorded[-1][1] if recorded else None
    moved = min((act.start for act in acts(history) if act.start > end.received), default=float("inf"))
    before = [one for at, one in recorded if end.received - STALE_S <= at <= end.received]
    after = [one for at, one in recorded if end.received < at < moved]
    return next(iter((*before[-1:], *after)), None)


def last_truth(history: History) -> TrueState | None:
    """Return the newest true state; None where none was recorded, or none after the end of the task."""
    recorded, command = truth(history), task_command(history)
    end = task_end(history, command) if command is not None else None
    if not recorded or (end is not None and recorded[-1][0] < end.received - STALE_S):
        return None
    return recorded[-1][1]


def failure(history: History) -> str | None:
    """Return why the run did not do the main job, in words; None: it did."""
    command = task_command(history)
    if command is not None and not isinstance(command.content, cmd.PourInto):
        return f"nobody asked to pour, but to {asked(command)}"
    if command is None:
        return "; ".join(_not_whole(history)) or "no command of a person was heard"
    reasons = list(_against(history, command))
    return "; ".join((*_not_whole(history), *reasons)) if reasons else None


def failure_of(history: History, command: Spoken) -> str | None:
    """Return why a task failed, in words; None: it did not. A task that is no pour is believed to be as co said."""
    return "; ".join(_against(history, command)) or None


def _against(history: History, command: Spoken) -> Iterator[str]:
    """Yield the reasons from plans, else those from the truth: of a plan that failed an empty bowl needs no words."""
    if not isinstance(command.content, cmd.PourInto):
        yield from _of_end(history, command)
        return
    of_plans = list(_of_plans(history, command))
    yield from of_plans or _of_truth(history, command)


def _not_whole(history: History) -> Iterator[str]:
    """Processes of the fleet that did not run in the end, though nobody had ended them: the cause of all else."""
    for process in history.down:
        yield f"{process.name} did not run ({process.state}{': ' + process.note if process.note else ''})"


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


def _of_truth(history: History, command: Spoken) -> Iterator[str]:
    if truth_at_end(history, command) is None:
        when = ", only at other times" if truth(history) else ""
        yield f"the true state of the simulation was not recorded at the end of the task{when}"
        return
    state = poured(history, command)
    if state.fraction is None:
        yield "it was not recorded how much is in the bowl"
    elif state.fraction < LEAST_POURED:
        yield f"{state.fraction:.0%} of the content is in the bowl, at least {LEAST_POURED:.0%} are wanted"
    if state.jar_links is None:
        yield "it was not recorded whether a hand holds the jar"
    elif state.jar_links < LEAST_LINKS:
        yield "no hand holds the jar"
    if state.bowl_tilt_deg is None:
        yield "the bowl's tilt was not recorded"
    elif state.bowl_tilt_deg >= MOST_TILT_DEG:
        yield f"the bowl is tilted by {state.bowl_tilt_deg:.0f} degrees, less than {MOST_TILT_DEG:.0f} are wanted"
    if state.bowl_links:
        yield "a hand still touches the bowl"
    if not state.bowl_on_table:
        yield "the bowl is not on a table" if state.bowl_on_table is False else "where the bowl stands was not recorded"


def _vessel(truth: TrueState, kind: str) -> str:
    """The id of the first vessel of this kind, "" for none."""
    return next((name for name in sorted(truth.tilt_deg) if truth.models.get(name, name).startswith(kind)), "")


def _on_table(history: History, truth: TrueState, vessel: str) -> bool | None:
    """Whether a vessel's base stands over, and within a contact of, the top of a table; None: no table is known."""
    at = truth.at.get(vessel) or (truth.poses[vessel].xyz if vessel in truth.poses else None)
    tables = _tables(history, truth)
    if at is None or not tables:
        return None
    kind = truth.models.get(vessel, "")
    model = MODELS.get(KNOWN_AS.get(kind, kind))
    base = at[2] + (model.base.z if model else 0.0)
    return any(_stands_on(at[0], at[1], base, *table) for table in tables)


def _tables(history: History, truth: TrueState) -> list[tuple[str, Pose]]:
    """Models and poses of all tables: true ones, else the ones km was told of."""
    true = [
        (model, truth.poses[name]) for name, model in truth.models.items() if model in TABLES and name in truth.poses
    ]
    if true:
        return true
    seen = (one.content for one in history.said if isinstance(one.content, wm.SeenObject))
    return list({one.object: (one.model, one.pose) for one in seen if one.model in TABLES}.values())


def _stands_on(x: float, y: float, base: float, model: str, table: Pose) -> bool:
    """Tables stand upright, turned about z: w and z of the quaternion are all there is."""
    w, z = table.quat_wxyz[0], table.quat_wxyz[3]
    cosine, sine = w * w - z * z, 2 * w * z
    dx, dy = x - table.xyz[0], y - table.xyz[1]
    along, across = cosine * dx + sine * dy, cosine * dy - sine * dx
    return any(
        abs(along - top.x) <= top.along_x / 2
        and abs(across - top.y) <= top.along_y / 2
        and abs(base - top.z - table.xyz[2]) <= ON_TABLE_M
        for top in MODELS[model].surfaces
    )
