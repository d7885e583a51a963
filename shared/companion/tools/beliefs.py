"""Beliefs of km about things, from the observations that it hears. The newest one counts; sights
are fused.

They follow services.knowledge.observe, which tools may not import; a test compares. Live and of a
recording alike. Must not know: the truth.
"""

import msgspec

from agent_runtime.core.streams import parse_observation
from companion.fusing import Sight, fused
from companion.languages import wm
from companion.languages.values import BodyPosture, Pose, Side
from companion.tools.asking import KM
from operate.recording.records import Spoken

MOST_APART_MM = 30.0
"""Between belief and truth of a thing; more is shown as wrong. Estimate: a jar 20 mm aside is still
grasped well.
"""
Version = tuple[int, int]
_OF_OBJECTS = wm.SeenObject | wm.PlacedObject | wm.LostObject | wm.GivenObject | wm.MissingObject


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
        self._newest: dict[str, tuple[Version, Spoken]] = {}
        self._models: dict[str, str] = {}
        self._sights: dict[str, Sight] = {}
        self._touched: set[str] = set()
        self._empty: set[str] = set()
        self._world: Version = (-1, -1)

    @property
    def objects(self) -> set[str]:
        """The things of which km was told."""
        told = (
            one.content.object
            for _, one in self._newest.values()
            if isinstance(one.content, _OF_OBJECTS)
        )
        return {*told, *self._held()}

    @property
    def posture(self) -> BodyPosture | None:
        """The newest posture that km was told of."""
        _, body = self._newest.get("body", (None, None))
        return body.content.body if body is not None else None

    def hear(self, one: Spoken) -> bool:
        """Take the next communicate; return whether it was an observation for km, newer than what
        km knew.
        """
        parsed = parse_observation(one.id) if one.receiver == KM else None
        key = _key(one.content) if parsed is not None else ""
        if parsed is None or not key or parsed[1] <= self._newest.get(key, (self._world,))[0]:
            return False
        version = parsed[1]
        if isinstance(one.content, wm.WorldLost):
            self._world = version
            self._newest = {
                name: found for name, found in self._newest.items() if found[0] > version
            }
            self._sights.clear()
            return True
        if isinstance(one.content, wm.LostObject | wm.GivenObject | wm.MissingObject | wm.SeenHand):
            self._empty |= {
                hand.id for hand in self._hands() if hand.content.object == one.content.object
            }
        self._newest[key] = version, one
        self._see(one.content)
        if isinstance(one.content, wm.SeenObject | wm.PlacedObject):
            self._models[one.content.object] = one.content.model
        return True

    def about(self, name: str) -> Belief:
        """The belief about a thing."""
        _, told = self._newest.get(f"object:{name}", (None, None))
        hand = self._held().get(name)
        if hand is not None:
            model, side = self._models.get(name, ""), hand.content.side
            how = f"in the {side} hand" + ("" if hand.content.by else ", not checked")
            return Belief(name, how, hand, model, side=side, in_grip=hand.content.pose)
        match told.content if told is not None else None:
            case wm.SeenObject(model=model) as seen:
                pose, uncertainty = self._sights.get(name, (seen.pose, seen.uncertainty))
                deviation = uncertainty.deviation if uncertainty is not None else None
                return Belief(name, "seen", told, model, pose, deviation=deviation)
            case wm.PlacedObject(model=model, pose=pose):
                return Belief(name, "put down, not seen since", told, model, pose)
            case wm.LostObject(side=side):
                return Belief(name, f"lost by the {side} hand", told, self._models.get(name, ""))
            case wm.GivenObject(side=side):
                return Belief(
                    name, f"given to a person by the {side} hand", told, self._models.get(name, "")
                )
            case wm.MissingObject():
                return Belief(name, "missing where it was", told, self._models.get(name, ""))
        return Belief(name)

    def _see(self, content: object) -> None:
        """Fuse the sights of what stands; of what a hand had meanwhile, the earlier ones say
        nothing any more.
        """
        match content:
            case wm.SeenObject(object=name, pose=pose, uncertainty=uncertainty):
                held, seen = name in self._held(), (pose, uncertainty)
                fresh = held or name in self._touched or name not in self._sights
                self._sights[name] = seen if fresh else fused(self._sights[name], seen)
                self._touched = self._touched | {name} if held else self._touched - {name}
            case wm.SeenHand(object=name):
                self._touched |= {name}
            case _ if isinstance(content, _OF_OBJECTS):
                self._sights.pop(content.object, None)

    def _held(self) -> dict[str, Spoken]:
        """What hands hold, each with the observation that says so."""
        return {hand.content.object: hand for hand in self._hands() if hand.content.object}

    def _hands(self) -> list[Spoken]:
        """The newest observation of each hand, but where what it held was lost or went to the other
        one.
        """
        hands = [self._newest[key][1] for key in map(_hand, Side) if key in self._newest]
        return [hand for hand in hands if hand.id not in self._empty]


def _hand(side: Side) -> str:
    return f"hand:{side}"


def _key(content: object) -> str:
    """The subject of an observation; "" for any other content."""
    match content:
        case wm.SeenHand(side=side):
            return _hand(side)
        case _ if isinstance(content, _OF_OBJECTS):
            return f"object:{content.object}"
        case wm.SeenBody():
            return "body"
        case wm.WorldLost():
            return "world"
    return ""
