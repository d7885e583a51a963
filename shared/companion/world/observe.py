"""Observations become facts: the newest one of a subject counts, older ones are ignored; poses that
agree are fused.

Pure: a scene in, a scene out. Must not know: who observed, protocols.
"""

import math

from msgspec.structs import replace

from companion.languages import wm
from companion.languages.values import Pose
from companion.world.fusing import fused
from companion.world.relations import related
from companion.world.scene import Held, Origin, Scene, SceneObject

ELSEWHERE_M = 0.1
"""Farther than an object is pushed by a hand that misses it, and than a sight errs (estimate)."""
Version = tuple[int, int]
"""Incarnation of the observer and number of the observation."""


WORLD = "world"
"""Subject of the loss of the world: no older observation of any subject counts."""


def subject_of(observation: wm.AnySight) -> str:
    """Return the subject of an observation; the latest version of each subject counts."""
    match observation:
        case (
            wm.SeenObject(object=name)
            | wm.PlacedObject(object=name)
            | wm.LostObject(object=name)
            | wm.GivenObject(object=name)
            | wm.MissingObject(object=name)
        ):
            return f"object:{name}"
        case wm.SeenHand(side=side):
            return f"hand:{side.value}"
        case wm.FeltContent(source=name):
            return f"content:{name}"
        case wm.SeenBody():
            return "body"


def observed(scene: Scene, observation: wm.AnySight, version: Version, now: float = 0.0) -> Scene:
    """Return the scene with this observation, or the same object if the scene is as new or newer
    for this subject.

    `now`: time of observations that do not carry one themselves [s].
    """
    subject = subject_of(observation)
    if any(
        version <= scene.versions[known] for known in (subject, WORLD) if known in scene.versions
    ):
        return scene
    at = observation.at if isinstance(observation, wm.SeenObject | wm.PlacedObject) else now
    stamped = replace(
        scene, versions={**scene.versions, subject: version}, times={**scene.times, subject: at}
    )
    return _noted(stamped, observation, at)


def forgotten(scene: Scene, version: Version) -> Scene:
    """Return a scene of which nothing is known, after the loss of the world; the same object if
    that is old news.
    """
    if version <= max(scene.versions.values(), default=(0, 0)):
        return scene
    return Scene(reserved=scene.reserved, versions={**scene.versions, WORLD: version})


def _noted(scene: Scene, observation: wm.AnySight, at: float) -> Scene:
    match observation:
        case wm.SeenObject(object=name, model=model, pose=pose, content=content):
            # A held object moves with the hand: its pose is valid only at the moment of the
            # observation.
            exact = scene.holder(name) is None
            kept = scene.things.get(name, SceneObject(name, model, pose))
            origin = None if _moved_by_others(kept, pose) else kept.origin
            sure = kept.uncertainty if exact and kept.exact else None
            pose, uncertainty = fused((kept.pose, sure), (pose, observation.uncertainty))
            content = kept.content if content is None else content
            told = {"pose": pose, "uncertainty": uncertainty, "content": content}
            seen = replace(kept, model=model, at=at, exact=exact, origin=origin, **told)
            return related(scene.with_object(seen), at, name)
        case wm.PlacedObject(object=name, model=model, pose=pose):
            kept = scene.things.get(name, SceneObject(name, model, pose))
            left = replace(kept, model=model, pose=pose, at=at, exact=False, uncertainty=None)
            return related(scene.with_object(left), at, name)
        case wm.SeenHand(side=side, object=name, grasp=grasp, pose=pose):
            before = scene.hands.get(side, Held()).object
            return related(
                _taken(scene, name).with_hand(side, Held(name, grasp, pose)), at, before, name
            )
        case wm.LostObject(object=name, side=side):
            return scene.without(name, side)
        case wm.GivenObject(object=name, side=side):
            return scene.without(name, side, given=True)
        case wm.MissingObject(object=name):
            return scene.without(name, None)
        case wm.FeltContent(source=source, destination=destination):
            return replace(scene, contents={**scene.contents, source: destination})
        case wm.SeenBody(body=body):
            joints = {
                "torso": (body.torso,),
                "right_arm": body.right_arm,
                "left_arm": body.left_arm,
                "head": body.head,
                "right_hand": body.right_hand,
                "left_hand": body.left_hand,
            }
            return replace(scene, joints=joints)


def _taken(scene: Scene, name: str) -> Scene:
    """Return the scene in which an object that is now in a hand has its origin, if it was seen
    where it stood.
    """
    object = scene.things.get(name)
    if object is None or object.origin is not None or not object.exact:
        return scene
    return scene.with_object(replace(object, origin=Origin(object.pose, object.on)))


def _moved_by_others(object: SceneObject, pose: Pose) -> bool:
    """Whether an object that was seen where it stood is now seen elsewhere, and no hand of the
    robot had it between.
    """
    return object.exact and math.dist(object.pose.xyz, pose.xyz) > ELSEWHERE_M
