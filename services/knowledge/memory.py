"""Memory of km between two steps: the observed scene, what waits for the next state; conditions of
the design.
"""

import msgspec

from companion.languages import wm
from companion.languages.facts import Facts
from companion.world.scene import Scene
from services.knowledge.overlays import Overlays


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
