"""Beliefs of km at a time, and their sources, from the communicates it heard and said.

Each observation makes facts true and ends others; a fact's source is the observation since which it has been true.
Made by km's own functions from a recording, without km. Must not know: where communicates come from, SPARQL.
"""

from collections.abc import Iterable

import msgspec
import pyoxigraph as ox

from agent_runtime.core.streams import parse_observation
from companion.all_languages import LANGUAGES
from companion.asking import Heard
from companion.languages import wm
from fipa_codec.communicate import Communicate, decode
from fipa_codec.errors import FipaError
from services.knowledge.observe import observed, subject_of
from services.knowledge.overlays import Overlays
from services.knowledge.scene import Scene
from services.knowledge.subjects import Subject, differing, subjects


class Source(msgspec.Struct, frozen=True):
    """Source and time [unix s] of an observation or a hypothetical state of km; `name`: subject with version, or state.

    `about`: key of the subject (services.knowledge.observe.subject_of); `parent`: what a state was made from.
    """

    name: str
    by: str
    at: float
    about: str = ""
    parent: str = ""


class Beliefs:
    """`scene`: the observed world; `sources`: observations in the order they came; `facts`: triple -> its source.

    `overlays`: the hypothetical states there are; `states`: their sources.
    """

    def __init__(self) -> None:
        self.scene = Scene()
        self.sources: list[Source] = []
        self.facts: dict[ox.Quad, Source] = {}
        self.overlays = Overlays()
        self.states: dict[str, Source] = {}
        self._asked: dict[str, tuple[wm.HypotheticalState | wm.DropStates, Source]] = {}

    def hear(self, one: Heard) -> None:
        """Take what km heard or said next; contents that cannot be read are left out, as km does."""
        if not one.wire:
            self.overlays, self.states, self._asked = Overlays(), {}, {}
            return
        try:
            communicate = decode(one.wire)
            content, _ = LANGUAGES.read(communicate)
        except FipaError:
            return
        match content:
            case _ if isinstance(content, wm.AnySight):
                self._observe(communicate, content, one.at)
            case wm.HypotheticalState(id=name, state=parent):
                told = Source(name, communicate.sender, one.at, parent=parent)
                self._asked[communicate.conversation] = content, told
            case wm.DropStates(prefix=prefix):
                self._asked[communicate.conversation] = content, Source(prefix, communicate.sender, one.at)
            case wm.Made():
                self._made(communicate.conversation)

    def _observe(self, communicate: Communicate, sight: wm.AnySight, at: float) -> None:
        parsed = parse_observation(communicate.id)
        if parsed is None:
            return
        scene = observed(self.scene, sight, parsed[1], at)
        if scene is self.scene:
            return
        source = Source(communicate.id, communicate.sender, at, subject_of(sight))
        self.sources.append(source)
        gone, come = (_quads(some) for some in differing(self.scene, scene))
        for quad in gone - come:
            del self.facts[quad]
        for quad in come - gone:
            self.facts[quad] = source
        self.scene = scene

    def _made(self, conversation: str) -> None:
        """km did what it was asked: made a state, or dropped some."""
        if conversation not in self._asked:
            return
        query, source = self._asked.pop(conversation)
        if isinstance(query, wm.DropStates):
            self.overlays = self.overlays.drop(query.prefix)
        else:
            self.overlays, _ = self.overlays.make(query, self.scene)
            self.states.setdefault(query.id, source)
        self.states = {id: told for id, told in self.states.items() if id in self.overlays.states}

    def supposed(self, state: str) -> Iterable[Subject]:
        """Return the scene of a hypothetical state."""
        return subjects(self.overlays.states[state].scene).values()


def _quads(subjects: Iterable[Subject]) -> set[ox.Quad]:
    return {quad for subject in subjects for quad in subject.quads()}


def believed(heard: Iterable[Heard]) -> Beliefs:
    """Return the beliefs of km after all this."""
    beliefs = Beliefs()
    for one in heard:
        beliefs.hear(one)
    return beliefs
