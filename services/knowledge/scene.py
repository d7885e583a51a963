"""A state of the world as km knows it: typed records by id, never changed in place.

A `Scene` is a value. The observed world is one, every hypothetical state is another; a change makes a new one that
shares all records it does not touch, so a hypothesis costs as much memory as its changes. It encodes, whole, into a
journal. Must not know: stores, agents, how a question is asked.
"""

import msgspec

from companion.languages.values import Pose, Shape, Side
from companion.models import MODELS, Model

PARTS = {"torso": 1, "right_arm": 7, "left_arm": 7, "head": 2, "right_hand": 4, "left_hand": 4}
"""Parts of the body that have a configuration -> number of joints."""


class Thing(msgspec.Struct, frozen=True, omit_defaults=True):
    """An object: where it was last seen or is predicted to be.

    `exact`: it was seen where it is. `on`, `inside`: computed from poses and shapes. `at`: when it was seen,
    `related_at`: when the newest of the observations was made that its relations rest on [s, observer's clock].
    """

    id: str
    model: str
    pose: Pose
    at: float = 0.0
    exact: bool = True
    on: str = ""
    inside: tuple[str, ...] = ()
    related_at: float = 0.0

    @property
    def known(self) -> Model | None:
        """Its model, if that is a known one."""
        return MODELS.get(self.model)

    @property
    def kind(self) -> str:
        """Its class in the ontology."""
        return self.known.kind if self.known else "PhysicalObject"

    @property
    def moveable(self) -> bool:
        """May the robot take it?"""
        return self.known is not None and self.known.moveable


class Held(msgspec.Struct, frozen=True, omit_defaults=True):
    """What a hand holds ("" nothing), by which grasp, and T_grip_object."""

    object: str = ""
    grasp: str = ""
    pose: Pose | None = None


class Scene(msgspec.Struct, frozen=True, omit_defaults=True):
    """Objects, hands, joints [rad] per part of the body, spaces kept free, contents poured (source -> destination).

    `versions`: the newest observation of each subject that is in here; `times`: when it was made, or, of what carries
    no time of its own, when it came.
    A hand or a part that is missing was never observed.
    """

    things: dict[str, Thing] = {}
    hands: dict[Side, Held] = {}
    joints: dict[str, tuple[float, ...]] = {}
    reserved: dict[str, Shape] = {}
    contents: dict[str, str] = {}
    versions: dict[str, tuple[int, int]] = {}
    times: dict[str, float] = {}

    def holder(self, object: str) -> Side | None:
        """The hand that holds an object."""
        return next((side for side, held in self.hands.items() if held.object == object), None)

    def with_thing(self, thing: Thing) -> "Scene":
        """The same scene with this object as given."""
        return msgspec.structs.replace(self, things={**self.things, thing.id: thing})

    def with_hand(self, side: Side, held: Held) -> "Scene":
        """The same scene with this hand; what it takes leaves the other hand, and is exact no more."""
        hands = {
            other: Held() if held.object and what.object == held.object else what for other, what in self.hands.items()
        }
        scene = msgspec.structs.replace(self, hands={**hands, side: held})
        thing = self.things.get(held.object)
        return scene.with_thing(msgspec.structs.replace(thing, exact=False, on="")) if thing else scene
