"""The robot's belief beside the truth at the end of a run: where each thing is, and what it said to
be true.

Must not know: success.
"""

import math

import msgspec

from companion.languages import cmd
from companion.languages.evidence import Claim, ClaimOfAct, Evidence, Sense
from companion.languages.values import BodyPosture, Vector
from companion.sentences import evidence, plain, spaced
from companion.telemetry import TrueState
from companion.tools.beliefs import Belief, Beliefs
from companion.tools.pictures import robot
from companion.tools.report import plans, verdict
from companion.tools.report.judges import judges
from companion.world.geometry import place
from operate.recording.history import History
from operate.recording.records import Spoken
from operate.structs import alike
from velma.names import BODY, GRIP_BODY


class Believed(msgspec.Struct, frozen=True):
    """Belief about a thing: `how` it is known, `t` [s after the first communicate] since when, `id`
    of the observation, `after`: the act that ended last before it. `at`, `true_at`: its origin [m,
    world], `apart_mm` between them; null where one is not known. `held`: in which hand it is
    believed to be, "" for none.
    """

    object: str
    how: str
    t: float | None
    id: str
    after: str
    at: Vector | None
    true_at: Vector | None
    apart_mm: float | None
    held: str = ""


class Claimed(msgspec.Struct, frozen=True):
    """A claim about a thing at the end of a task: `by` which senses, none: not checked; `at` [s,
    simulated], `within` [m] as the robot said; `true`: by the simulation, null where that does not
    tell. `words`: all of it but the truth.
    """

    claim: ClaimOfAct
    of: str
    by: tuple[Sense, ...]
    at: float
    within: float
    true: bool | None
    words: str


def claims(history: History, command: Spoken) -> tuple[Claimed, ...]:
    """Return what the robot said to be true at the end of a task, beside the truth."""
    end, truth = plans.task_end(history, command), verdict.truth_at_end(history, command)
    said = (
        end.content.evidence if end is not None and isinstance(end.content, cmd.TaskReport) else ()
    )
    rows = ((one, _true(one, truth), plain(evidence(one))) for one in said)
    return tuple(alike(Claimed, one, true=true, words=words) for one, true, words in rows)


def _true(one: Evidence, truth: TrueState | None) -> bool | None:
    """Whether a claim is true; None where the simulation does not tell."""
    if truth is None:
        return None
    held = max(truth.fingers_on.get(one.of, {}).values(), default=0) >= verdict.LEAST_LINKS
    match one.claim:
        case Claim.HELD if one.of in truth.fingers_on:
            return held
        case Claim.STANDS if one.of in truth.tilt_deg:
            return not held and truth.tilt_deg[one.of] < verdict.MOST_TILT_DEG
    return next((told for judge in judges() if (told := judge.true(one, truth)) is not None), None)


def beliefs(history: History) -> tuple[Believed, ...]:
    """Return the belief about each thing that km was told of or that there is, by id."""
    beliefs = Beliefs()
    for one in history.said:
        beliefs.hear(one)
    true = _places(verdict.last_truth(history))
    names = sorted(beliefs.objects | set(true))
    return tuple(_believed(history, beliefs, name, true.get(name)) for name in names)


def _believed(history: History, beliefs: Beliefs, name: str, true_at: Vector | None) -> Believed:
    one = beliefs.about(name)
    at = one.pose.xyz if one.pose is not None else _in_hand(beliefs.posture, one)
    apart = math.dist(at, true_at) * 1000.0 if at is not None and true_at is not None else None
    if one.told is None:
        return Believed(name, one.how, None, "", "", at, true_at, apart)
    since, held = one.told.received - history.begin, str(one.side or "")
    return Believed(
        name, one.how, since, one.told.id, _after(history, one.told), at, true_at, apart, held
    )


def _in_hand(body: BodyPosture | None, one: Belief) -> Vector | None:
    """Return where a held thing is by the last posture that km was told of; None without one."""
    if body is None or one.side is None or one.in_grip is None:
        return None
    frames = robot.world_frames(robot.links(), _joints(body))
    return place(frames[GRIP_BODY[one.side]], one.in_grip.xyz)


def _joints(body: BodyPosture) -> dict[str, float]:
    return dict(zip(BODY, (body.torso, *body.right_arm, *body.left_arm), strict=True))


def _after(history: History, told: Spoken) -> str:
    """Return the kind of the act that ended last before an observation was told, "" for none."""
    ended = [act for act in plans.acts(history) if act.end is not None and act.end <= told.received]
    return spaced(type(max(ended, key=_end).command).__name__) if ended else ""


def _end(act: plans.Act) -> float:
    return act.end or 0.0


def _places(truth: TrueState | None) -> dict[str, Vector]:
    """Return the true origin of each thing."""
    if truth is None:
        return {}
    return {**truth.at, **{name: pose.xyz for name, pose in truth.poses.items()}}
