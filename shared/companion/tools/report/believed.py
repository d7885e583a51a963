"""The robot's belief beside the truth at the end of a run: where each thing is, and what it said to
be true.

Beliefs of km are made of the observations that it hears, by the functions that km itself uses; live
and of a recording alike. Must not know: success.
"""

import math
from operator import itemgetter

import msgspec

from agent_runtime.core.streams import parse_observation
from companion.design import AgentName
from companion.languages import cmd, wm
from companion.languages.evidence import Claim, ClaimOfAct, Evidence, Sense
from companion.languages.values import BodyPosture, Pose, Side, Vector
from companion.sentences import evidence, plain, spaced
from companion.telemetry import TrueState
from companion.tools.pictures import robot
from companion.tools.report import plans, verdict
from companion.tools.report.plans import judges
from companion.world.geometry import place
from companion.world.observe import forgotten, observed, subject_of
from companion.world.scene import Scene
from operate.recording.history import History
from operate.recording.records import Spoken
from operate.structs import alike
from velma.model import tree
from velma.names import BODY, GRIP_BODY

MOST_APART_MM = 30.0
"""Between belief and truth of a thing; more is shown as wrong. Estimate: a jar 20 mm aside is still
grasped well.
"""


class Belief(msgspec.Struct, frozen=True):
    """Belief about a thing: `how` it is known and `told` by which communicate, None if by none;
    `model`: "" if unknown.

    `pose`: T_world_thing of what stands; `side` and `in_grip`, T_grip_thing, of what a hand holds.
    None: not known. `deviation`: root mean square of how far a seen place may be off [m], None: not
    told.
    """

    object: str
    how: str = "never seen"
    told: Spoken | None = None
    model: str = ""
    pose: Pose | None = None
    side: Side | None = None
    in_grip: Pose | None = None
    deviation: float | None = None


class Beliefs:
    """Beliefs of km after what it has heard so far."""

    def __init__(self) -> None:
        self._scene = Scene()
        self._newest: dict[str, Spoken] = {}  # by subject
        self._models: dict[str, str] = {}  # also of what was lost, which the scene forgets

    @property
    def objects(self) -> set[str]:
        """The things of which km was told."""
        held = {hand.object for hand in self._scene.hands.values() if hand.object}
        return {*self._scene.things, *self._scene.lost, *held}

    @property
    def posture(self) -> BodyPosture | None:
        """The newest posture that km was told of."""
        body = self._newest.get("body")
        return body.content.body if body is not None else None

    def hear(self, one: Spoken) -> bool:
        """Take the next communicate; return whether it was an observation for km, newer than what
        km knew.
        """
        parsed = parse_observation(one.id) if one.receiver == AgentName.KM else None
        before, content = self._scene, one.content
        if parsed is not None and isinstance(content, wm.WorldLost):
            self._scene = forgotten(before, parsed[1])
            self._newest = self._newest if self._scene is before else {}
        elif parsed is not None and isinstance(content, wm.AnySight):
            self._scene = observed(before, content, parsed[1], one.received)
            if self._scene is not before:
                self._newest[subject_of(content)] = one
                if isinstance(content, wm.SeenObject | wm.PlacedObject):
                    self._models[content.object] = content.model
        return self._scene is not before

    def about(self, name: str) -> Belief:
        """The belief about a thing."""
        model, side = self._models.get(name, ""), self._scene.holder(name)
        if side is not None:
            hand = self._newest[f"hand:{side}"]
            how = f"in the {side} hand" + ("" if hand.content.by else ", not checked")
            return Belief(name, how, hand, model, side=side, in_grip=hand.content.pose)
        told, thing = self._newest.get(f"object:{name}"), self._scene.things.get(name)
        if told is None:
            return Belief(name)
        pose = thing.pose if thing is not None else None
        match told.content:
            case wm.PlacedObject():
                return Belief(name, "put down, not seen since", told, model, pose)
            case wm.LostObject(side=side):
                return Belief(name, f"lost by the {side} hand", told, model)
            case wm.GivenObject(side=side):
                return Belief(name, f"given to a person by the {side} hand", told, model)
            case wm.MissingObject():
                return Belief(name, "missing where it was", told, model)
        sure = thing.uncertainty if thing is not None else None
        deviation = sure.deviation if sure is not None else None
        return Belief(name, "seen", told, model, pose, deviation=deviation)


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
    arms = (body.torso, *body.right_arm, *body.left_arm)
    frames = robot.world_frames(tree.links(), dict(zip(BODY, arms, strict=True)))
    return place(frames[GRIP_BODY[one.side]], one.in_grip.xyz)


def _after(history: History, told: Spoken) -> str:
    """Return the kind of the act that ended last before an observation was told, "" for none."""
    ended = [(act.end, act) for act in plans.acts(history) if act.end is not None]
    before = [one for one in ended if one[0] <= told.received]
    last = max(before, key=itemgetter(0), default=None)
    return "" if last is None else spaced(type(last[1].command).__name__)


def _places(truth: TrueState | None) -> dict[str, Vector]:
    """Return the true origin of each thing."""
    if truth is None:
        return {}
    return {**truth.at, **{name: pose.xyz for name, pose in truth.poses.items()}}
