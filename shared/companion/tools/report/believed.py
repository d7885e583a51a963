"""The robot's belief beside the truth at the end of a run: where each thing is, and how much was poured.

The belief is that of km, by what ta told it: the newest observation of a subject counts (services.knowledge.observe;
a test compares). Must not know: success.
"""

import math

import msgspec
import numpy as np

from agent_runtime.core.streams import parse_observation
from companion.languages import rc, wm
from companion.languages.values import BodyPosture, Pose, Side, Vector
from companion.telemetry import TrueState
from companion.tools.asking import KM
from companion.tools.pictures import robot
from companion.tools.report import plans, verdict
from companion.wording import spaced
from operate.recording.history import History
from operate.recording.records import Spoken
from velma.names import BODY, GRIP_BODY


class Believed(msgspec.Struct, frozen=True):
    """Belief about a thing: `how` it is known, `t` [s after the first communicate] since when, `id` of the observation,
    `after`: the act that ended last before it. `at`, `true_at`: its origin [m, world], `apart_mm` between them; null
    where one is not known. `held`: in which hand it is believed to be, "" for none.
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


class Share(msgspec.Struct, frozen=True):
    """The part of the content that the robot believes to have poured, from the weight [kg] that left the source in its
    last pour that was done and what it took the content to weigh; `seen_kg`: in the bowl then, null where it was not
    looked into; `true`: grains in the bowl of all grains.
    """

    believed: float | None
    left_kg: float | None
    content_kg: float | None
    true: float | None
    seen_kg: float | None = None


def things(history: History) -> tuple[Believed, ...]:
    """Return the belief about each thing that km was told of or that there is, by id."""
    newest, truth = _newest(history), verdict.last_truth(history)
    told = {
        one.content.object for one in newest.values() if isinstance(one.content, _OF_OBJECTS) and one.content.object
    }
    true = _places(truth)
    return tuple(_believed(history, name, newest, true.get(name)) for name in sorted(told | set(true)))


def share(history: History) -> Share:
    """Return how much was poured by belief and by truth."""
    true = verdict.poured(history).fraction
    done = [
        (one.content.weighed, act.command, one.content.seen)
        for act in plans.acts(history)
        if act.done and isinstance(act.command, rc.Pour)
        for one in history.said
        if isinstance(one.content, rc.Done) and one.content.key == act.command.key and one.content.weighed
    ]
    if not done:
        return Share(None, None, None, true)
    (before, after), pour, seen = done[-1]
    content = before - pour.empty_mass
    inside = next((one.content for one in seen if one.object == pour.destination), None)
    return Share((before - after) / content if content > 0.0 else None, before - after, content, true, inside)


_OF_OBJECTS = (wm.SeenObject, wm.PlacedObject, wm.LostObject, wm.MissingObject, wm.SeenHand)


def _newest(history: History) -> dict[str, Spoken]:
    """Return the newest observation of each subject that km was told of, by "object:", "hand:" or "body"."""
    newest: dict[str, tuple[tuple[int, int], Spoken]] = {}
    for one in history.said:
        parsed = parse_observation(one.id) if one.receiver == KM else None
        if parsed is None:
            continue
        _, version = parsed
        if isinstance(one.content, wm.WorldLost):
            newest = {key: found for key, found in newest.items() if found[0] > version}
        elif (key := _key(one.content)) and version > newest.get(key, ((-1, -1),))[0]:
            newest[key] = version, one
    return {key: one for key, (_, one) in newest.items()}


def _key(content: object) -> str:
    match content:
        case wm.SeenHand(side=side):
            return f"hand:{side}"
        case _ if isinstance(content, _OF_OBJECTS):
            return f"object:{content.object}"
        case wm.SeenBody():
            return "body"
    return ""


def _believed(history: History, name: str, newest: dict[str, Spoken], true_at: Vector | None) -> Believed:
    where, how, held = newest.get(f"object:{name}"), "never seen", ""
    at: Vector | None = None
    match where.content if where else None:
        case wm.SeenObject(pose=Pose(xyz=xyz)):
            how, at = "seen", xyz
        case wm.PlacedObject(pose=Pose(xyz=xyz)):
            how, at = "put down, not seen since", xyz
        case wm.LostObject(side=side):
            how = f"lost by the {side} hand"
        case wm.MissingObject():
            how = "missing where it was"
    for side in Side:
        hand = newest.get(f"hand:{side}")
        if hand is not None and isinstance(hand.content, wm.SeenHand) and hand.content.object == name:
            where, how, held = hand, f"in the {side} hand", str(side)
            at = _in_hand(newest.get("body"), hand.content)
    apart = math.dist(at, true_at) * 1000.0 if at is not None and true_at is not None else None
    if where is None:
        return Believed(name, how, None, "", "", at, true_at, apart)
    since = where.received - history.begin
    return Believed(name, how, since, where.id, _after(history, where), at, true_at, apart, held)


def _in_hand(body: Spoken | None, hand: wm.SeenHand) -> Vector | None:
    """Return where a held thing is by the last posture that km was told of; None without one."""
    if body is None or not isinstance(body.content, wm.SeenBody) or hand.pose is None:
        return None
    frames = robot.world_frames(robot.links(), _joints(body.content.body))
    x, y, z, _ = (float(part) for part in frames[GRIP_BODY[hand.side]] @ np.array([*hand.pose.xyz, 1.0]))
    return x, y, z


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
