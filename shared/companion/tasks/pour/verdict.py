"""Whether it was poured, by the truth of the simulation: content in the bowl, jar in a hand, bowl
level on the table.

A part for the tools alone (companion.tools.report).
"""

from collections.abc import Iterator

import msgspec

from companion.languages import wm
from companion.languages.evidence import Evidence
from companion.languages.rc import Done
from companion.languages.values import Pose
from companion.models import KNOWN_AS, MODELS
from companion.tasks.pour.command import PourInto
from companion.tasks.pour.done import Pour, PourClaim
from companion.telemetry import TrueState
from companion.tools.report import plans
from companion.tools.report.plans import Figures, Judge, Share
from companion.tools.report.verdict import LEAST_LINKS, MOST_TILT_DEG, truth_at_end
from companion.world.geometry import unplace
from operate.recording.history import History
from operate.recording.records import Spoken

LEAST_POURED = 0.9
ON_TABLE_M = 0.02
"""Between a vessel's base and the table's top; estimate: contacts are soft, table poses may be
observed ones (4 mm).
"""
TABLES = {name for name, model in MODELS.items() if model.kind == "Table"}


class Poured(msgspec.Struct, frozen=True):
    """What was true of jar and bowl at the end of a task; None where it was not recorded."""

    fraction: float | None = None
    bowl_tilt_deg: float | None = None
    jar_links: int | None = None
    bowl_links: int | None = None
    bowl_on_table: bool | None = None


def poured(history: History, command: Spoken | None) -> Poured:
    """What was true at the end of a task; without a command at the end of the recording."""
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


def against(history: History, command: Spoken) -> Iterator[str]:
    """Yield why it was not poured, by the truth at the end of the task."""
    state = poured(history, command)
    if state.fraction is None:
        yield "it was not recorded how much is in the bowl"
    elif state.fraction < LEAST_POURED:
        yield (
            f"{state.fraction:.0%} of the content is in the bowl, at least {LEAST_POURED:.0%} are"
            " wanted"
        )
    if state.jar_links is None:
        yield "it was not recorded whether a hand holds the jar"
    elif state.jar_links < LEAST_LINKS:
        yield "no hand holds the jar"
    if state.bowl_tilt_deg is None:
        yield "the bowl's tilt was not recorded"
    elif state.bowl_tilt_deg >= MOST_TILT_DEG:
        yield (
            f"the bowl is tilted by {state.bowl_tilt_deg:.0f} degrees, less than"
            f" {MOST_TILT_DEG:.0f} are wanted"
        )
    if state.bowl_links:
        yield "a hand still touches the bowl"
    if not state.bowl_on_table:
        told = state.bowl_on_table is False
        yield "the bowl is not on a table" if told else "where the bowl stands was not recorded"


def true(one: Evidence, truth: TrueState) -> bool | None:
    """Whether a claim about content is true; None for others, and where there is no content."""
    match one.claim:
        case PourClaim.ARRIVED if truth.grains:
            return truth.grains_in.get(one.of, 0) > 0
        case PourClaim.LEFT if truth.grains:
            return truth.grains_in.get(one.of, 0) < truth.grains
    return None


def share(history: History) -> Share:
    """How much was poured by belief and by truth."""
    true = poured(history, plans.task_command(history)).fraction
    contents = [one.content for one in history.said]
    weighed = [
        (one.key, one.weighed, one.seen)
        for one in contents
        if isinstance(one, Done) and one.weighed
    ]
    done = [
        (weights, act.command, seen)
        for act in plans.acts(history)
        if act.done and isinstance(act.command, Pour)
        for key, weights, seen in weighed
        if key == act.command.key
    ]
    if not done:
        return Share(None, None, None, true)
    (before, after), pour, seen = done[-1]
    content = before - pour.empty_mass
    inside = next((one.content for one in seen if one.object == pour.destination), None)
    return Share(
        (before - after) / content if content > 0.0 else None, before - after, content, true, inside
    )


def figures(history: History) -> Figures:
    """The figures of the report's task."""
    state = poured(history, plans.task_command(history))
    return Figures(state.fraction, state.bowl_tilt_deg, share(history))


def _vessel(truth: TrueState, kind: str) -> str:
    """The id of the first vessel of this kind, "" for none."""
    of_kind = (name for name in truth.tilt_deg if truth.models.get(name, name).startswith(kind))
    return min(of_kind, default="")


def _on_table(history: History, truth: TrueState, vessel: str) -> bool | None:
    """Whether a vessel's base stands over, and within a contact of, the top of a table; None: no
    table is known.
    """
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
    there = ((name, model) for name, model in truth.models.items() if name in truth.poses)
    true = [(model, truth.poses[name]) for name, model in there if model in TABLES]
    if true:
        return true
    seen = (one.content for one in history.said if isinstance(one.content, wm.SeenObject))
    return list({one.object: (one.model, one.pose) for one in seen if one.model in TABLES}.values())


def _stands_on(x: float, y: float, base: float, model: str, table: Pose) -> bool:
    along, across, up = unplace(table, (x, y, base))
    return any(
        abs(along - top.x) <= top.along_x / 2
        and abs(across - top.y) <= top.along_y / 2
        and abs(up - top.z) <= ON_TABLE_M
        for top in MODELS[model].surfaces
    )


JUDGE = Judge(PourInto, "pour", against, true, figures)
