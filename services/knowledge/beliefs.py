"""Beliefs of km at a time, and their sources, from the messages it received and sent; as an RDF
dataset for questions.

Each observation makes facts true and ends others; a fact's source is the observation since which it
has been true. Made by km's own functions from a recording, without km. Must not know: where
messages come from, SPARQL.
"""

from collections.abc import Iterable, Iterator

import msgspec
import pyoxigraph as ox

from agent_runtime.core.streams import parse_observation
from companion.asking import Heard
from companion.design import LANGUAGES
from companion.languages import wm
from companion.world.observe import observed, subject_of
from companion.world.scene import Scene
from fipa_codec.communicate import Communicate, decode
from fipa_codec.errors import FipaError
from services.knowledge.overlays import Overlays
from services.knowledge.subjects import TYPE, Subject, differing, node, read, subjects, term


class Source(msgspec.Struct, frozen=True):
    """Source and time [unix s] of an observation or a hypothetical state of km; `name`: subject
    with version, or state.

    `about`: key of the subject (companion.world.observe.subject_of); `parent`: what a state was
    made from.
    """

    name: str
    by: str
    at: float
    about: str = ""
    parent: str = ""


class Beliefs:
    """`scene`: the observed world; `sources`: observations in the order they came; `facts`: triple
    -> its source.

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
        """Take what km received or sent next; contents that cannot be read are left out, as km
        does.
        """
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
                told = Source(prefix, communicate.sender, one.at)
                self._asked[communicate.conversation] = content, told
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


def _quads(subjects: Iterable[Subject]) -> set[ox.Quad]:
    return {quad for subject in subjects for quad in subject.quads}


def believed(heard: Iterable[Heard]) -> Beliefs:
    """The beliefs of km after all this."""
    beliefs = Beliefs()
    for one in heard:
        beliefs.hear(one)
    return beliefs


# --- as an RDF dataset ----------------------------------------------------------------------------


def dataset(beliefs: Beliefs, begin: float) -> ox.Store:
    """Everything believed, in memory; times are seconds since `begin` [unix s].

    Default graph: O_RoCo, all that is believed, and who told what when. Named graphs: one per
    observation with the facts that have been true since it, one per hypothetical state with all
    that would be so in it.
    """
    triples = ox.Store()
    triples.load(read().serialize(format="nt").encode(), format=ox.RdfFormat.N_TRIPLES)
    triples.extend(_all_quads(beliefs, begin))
    return triples


def _all_quads(beliefs: Beliefs, begin: float) -> Iterator[ox.Quad]:
    for fact, source in beliefs.facts.items():
        yield fact
        yield _in(_observation(source), fact)
    for source in beliefs.sources:
        yield from _source_quads(_observation(source), "Observation", source, begin)
        yield ox.Quad(_observation(source), term("about"), _about(source.about))
    for name, source in beliefs.states.items():
        state = node("state", name)
        yield from _source_quads(state, "HypotheticalState", source, begin)
        if source.parent:
            yield ox.Quad(state, term("madeFrom"), node("state", source.parent))
        for quad in _quads(subjects(beliefs.overlays.states[name].scene).values()):
            yield _in(state, quad)


def _source_quads(of: ox.NamedNode, kind: str, source: Source, begin: float) -> Iterator[ox.Quad]:
    agent = node("agent", source.by)
    yield ox.Quad(of, TYPE, term(kind))
    yield ox.Quad(agent, TYPE, term("Agent"))
    yield ox.Quad(of, term("toldBy"), agent)
    yield ox.Quad(of, term("toldAt"), ox.Literal(round(source.at - begin, 3)))


def _about(key: str) -> ox.NamedNode:
    """The node of a subject's key; a posture is of the robot."""
    kind, _, name = key.partition(":")
    match kind:
        case "object":
            return node("thing", name)
        case "content":
            return node("content", name)
        case "hand":
            return term(f"{name}_hand")
        case _:
            return term("velma")


def _observation(source: Source) -> ox.NamedNode:
    """`said:ta.object.jar_1.1.8` for object/jar_1@1.8 of ta: a name that SPARQL takes after a
    prefix.
    """
    return node("said", f"{source.by}.{source.name}".replace("/", ".").replace("@", "."))


def _in(graph: ox.NamedNode, quad: ox.Quad) -> ox.Quad:
    return ox.Quad(quad.subject, quad.predicate, quad.object, graph)
