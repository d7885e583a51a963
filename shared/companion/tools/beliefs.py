"""Beliefs of km about things, from the observations that it hears, by the functions that km itself
uses. Live and of a recording alike. Must not know: the truth.
"""

import msgspec

from agent_runtime.core.streams import parse_observation
from companion.languages import wm
from companion.languages.values import BodyPosture, Pose, Side
from companion.tools.asking import KM
from companion.world.observe import forgotten, observed, subject_of
from companion.world.scene import Scene
from operate.recording.records import Spoken

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
        parsed = parse_observation(one.id) if one.receiver == KM else None
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
