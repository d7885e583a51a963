"""Memory of km between two steps: the observed scene, the hypothetical states, what waits for the
next state; conditions of the design.
"""

import msgspec
from msgspec.structs import replace

from companion.languages import wm
from companion.languages.facts import Fact, Facts, Kind, fact
from companion.world.relations import related
from companion.world.scene import PARTS, Held, Scene

# --- Hypothetical states --------------------------------------------------------------------------
# A hypothesis is the observed world, or another hypothesis, with changes: the world as it would be
# after a part of a plan. pl chooses its id, so making it twice has no effect. Their number is
# bounded; the oldest is dropped first, and a query for a dropped one is answered UnknownState. All
# are immutable values: making and dropping return a new `Overlays`. They are lost with the process.

# A search for the pouring plan makes some tens of states of a few kB; estimate.
LARGEST = 1024


class Impossible(Exception):
    """A change that cannot be made, and why."""

    def __init__(self, why: Fact) -> None:
        self.why = (why,)
        super().__init__(why.kind)


class Hypothesis(msgspec.Struct, frozen=True):
    """A state with the query that made it."""

    parent: str
    changes: tuple[wm.AnyChange, ...]
    scene: Scene


class Overlays(msgspec.Struct, frozen=True):
    """All hypothetical states by id, oldest first. `Overlays()` has none."""

    states: dict[str, Hypothesis] = {}
    largest: int = LARGEST

    def scene(self, id: str, observed: Scene) -> Scene | None:
        """Return the scene of a state ("": the observed one), None if there is no such state."""
        if id == "":
            return observed
        found = self.states.get(id)
        return found.scene if found else None

    def make(self, query: wm.HypotheticalState, observed: Scene) -> "tuple[Overlays, wm.AnyAnswer]":
        """Make a state, unless the same query has made it already; return the overlays and the
        answer.
        """
        if query.id == "":
            # "" is the world as observed
            return self, wm.Unknown((fact(Kind.UNKNOWN_TO_KM, "id"),))
        known = self.states.get(query.id)
        if known is not None:
            same = (known.parent, known.changes) == (query.state, query.changes)
            return self, wm.Made(query.id) if same else wm.Unknown(
                (fact(Kind.UNKNOWN_TO_KM, query.id),)
            )
        parent = self.scene(query.state, observed)
        if parent is None:
            return self, wm.UnknownState(query.state)
        try:
            scene = changed(parent, query.changes)
        except Impossible as error:
            return self, wm.Unknown(error.why)
        return self._with(query.id, Hypothesis(query.state, query.changes, scene)), wm.Made(
            query.id
        )

    def drop(self, prefix: str) -> "Overlays":
        """Return the overlays without all states whose id has this prefix."""
        kept = {id: state for id, state in self.states.items() if not id.startswith(prefix)}
        return self if len(kept) == len(self.states) else replace(self, states=kept)

    def _with(self, id: str, made: Hypothesis) -> "Overlays":
        states = {**self.states, id: made}
        for oldest in list(states)[: max(0, len(states) - self.largest)]:
            del states[oldest]
        return replace(self, states=states)


def changed(scene: Scene, changes: tuple[wm.AnyChange, ...]) -> Scene:
    """Return the scene after the changes, in order. Raises Impossible."""
    for change in changes:
        scene = _changed(scene, change)
    return scene


def _changed(scene: Scene, change: wm.AnyChange) -> Scene:
    match change:
        case wm.Moved():
            return _moved(scene, change)
        case wm.Grasped(object=name, side=side, grasp=grasp, pose=pose):
            _require(scene, name)
            before = scene.hands.get(side, Held()).object
            after = scene.with_hand(side, Held(name, grasp, pose))
            return related(after, scene.things[name].related_at, before, name)
        case wm.Released(side=side):
            before = scene.hands.get(side, Held()).object
            return related(scene.with_hand(side, Held()), 0.0, before)
        case wm.Configured(part=part, q=q):
            if len(q) != PARTS.get(part):
                raise Impossible(fact(Kind.UNKNOWN_TO_KM, part))
            return replace(scene, joints={**scene.joints, part: q})
        case wm.Reserved(name=name, volume=None):
            return replace(scene, reserved={k: v for k, v in scene.reserved.items() if k != name})
        case wm.Reserved(name=name, volume=volume):
            return replace(scene, reserved={**scene.reserved, name: volume})
        case wm.Poured(source=source, destination=destination):
            _require(scene, source)
            _require(scene, destination)
            return replace(scene, contents={**scene.contents, source: destination})


def _moved(scene: Scene, change: wm.Moved) -> Scene:
    """Move an object. What pl says it stands on overrides what geometry finds."""
    _require(scene, change.object)
    object = replace(scene.things[change.object], pose=change.pose, exact=change.exact)
    after = related(scene.with_object(object), object.related_at, object.id)
    if not change.on:
        return after
    _require(scene, change.on)
    return after.with_object(replace(after.things[change.object], on=change.on))


def _require(scene: Scene, name: str) -> None:
    if name not in scene.things:
        raise Impossible(fact(Kind.NOT_SEEN, name))


# --- The memory -----------------------------------------------------------------------------------


class Question(msgspec.Struct, frozen=True):
    """A query with its conversation."""

    conversation: str
    query: wm.AnyQuery


class News(msgspec.Struct, frozen=True):
    """An observation with its version and arrival time [unix s]."""

    observation: wm.AnyObservation
    version: tuple[int, int]
    at: float


class Soft(msgspec.Struct, frozen=True):
    """Memory that is lost with the process: hypothetical states, the subscription and the
    incarnation it is for, what was just taken.

    `agreed`: the observer agreed to the subscription. `held`: the next question has waited long
    enough.
    """

    overlays: Overlays = Overlays()
    subscription: str = ""
    incarnation: int = 0
    agreed: bool = False
    held: bool = False
    question: Question | None = None
    news: News | None = None


class Memory(msgspec.Struct, frozen=True):
    """The observed scene. `patient`: questions wait for a look around. `blind`: why the look around
    showed nothing.
    """

    scene: Scene = Scene()
    patient: bool = True
    blind: Facts = ()
    soft: Soft = Soft()


class Mirror(msgspec.Struct, frozen=True):
    """To the triple store: the observed scene as it is now."""

    scene: Scene


CONDITIONS = {
    "message_taken": lambda memory: (
        memory.soft.question is not None or memory.soft.news is not None
    ),
    "question_waits": lambda memory: memory.soft.question is not None,
    "observation_waits": lambda memory: memory.soft.news is not None,
    "question_answered": lambda memory: memory.soft.question is None,
    "knowledge_saved": lambda memory: memory.soft.news is None,
}
