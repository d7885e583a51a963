"""`python -m services.knowledge.asked`: a companion.asking.Question on standard input, its Answer
on standard output.

The operating system keeps the bounds: it ends the process when the query has taken its time,
wherever it is, gives it no more than so much memory, and no file or socket besides those that are
open.
"""

import re
import resource
import signal
import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from itertools import islice

import msgspec
import pyoxigraph as ox

from agent_runtime.core.streams import parse_observation
from companion.asking import PREFIXES, Answer, Heard, Question, Refused, Rows, Term, Triple, Verdict
from companion.design import LANGUAGES
from companion.languages import wm
from companion.world.observe import observed, subject_of
from companion.world.scene import Scene
from fipa_codec.communicate import Communicate, decode
from fipa_codec.errors import FipaError
from services.knowledge.memory import Overlays
from services.knowledge.store import TYPE, Subject, differing, node, read, subjects, term

# --- What km believed at a time, and its sources --------------------------------------------------
# From the messages it received and sent, and as an RDF dataset for questions. Each observation
# makes facts true and ends others; a fact's source is the observation since which it has been true.
# Made by km's own functions from a recording, without km.


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


# --- The answer -----------------------------------------------------------------------------------

MEMORY_BYTES = 2 * 1024**3
"""Beside a robot's own processes; estimate. A recording of a pour and its answer take a tenth of
it.
"""

_SERVICE = re.compile("service", re.IGNORECASE)


def answer(question: Question) -> Answer:
    """The answer, from what km had received."""
    text, triples = question.text, dataset(believed(question.heard), question.begin)
    bound(question.seconds)
    try:
        if asks_another_store(text):
            return Refused(
                "SERVICE asks another store over the network, and `roco ask` asks only this one;"
                " leave the word away"
            )
        return _answer(triples.query(text, prefixes=PREFIXES), question.rows)
    except SyntaxError as error:
        if is_update(text):
            return Refused(
                "this is empty or would change what km knows, and `roco ask` only reads; write"
                " SELECT or ASK"
            )
        return Refused(f"this is not SPARQL: {error}; write SELECT or ASK")


def asks_another_store(text: str) -> bool:
    """Whether SERVICE is a keyword of the query: it is if the text is no query with another word in
    its place.

    Raise SyntaxError if the text is no query as it is. Parsing evaluates on an empty store: call
    `bound` before.
    """
    if not _SERVICE.search(text):
        return False
    _parse(text)
    try:
        _parse(_SERVICE.sub(lambda found: f"{found[0][:3]}x{found[0][3:]}", text))
    except SyntaxError:
        return True
    return False


def _parse(text: str) -> None:
    with suppress(OSError, RuntimeError):  # of the evaluation
        ox.Store().query(text, prefixes=PREFIXES)


def is_update(text: str) -> bool:
    """Whether the text is a SPARQL update, or has no query at all. It changes an empty store: call
    `bound` before.
    """
    try:
        # of the evaluation: LOAD opens no socket, and there is no graph to move
        with suppress(OSError, RuntimeError):
            ox.Store().update(text, prefixes=PREFIXES)
    except SyntaxError:
        return False
    return True


def bound(seconds: float) -> None:
    """From here on this process lives that long at most, and opens nothing more: no SERVICE reaches
    the network.
    """
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_NOFILE, (0, 0))
    signal.setitimer(signal.ITIMER_REAL, seconds)


def _answer(found: ox.QuerySolutions | ox.QueryBoolean | ox.QueryTriples, most: int) -> Answer:
    if isinstance(found, ox.QueryBoolean):
        return Verdict(bool(found))
    if isinstance(found, ox.QueryTriples):
        return Refused(
            "CONSTRUCT and DESCRIBE give a graph, and `roco ask` gives rows; write SELECT or ASK"
        )
    columns = tuple(variable.value for variable in found.variables)
    rows = tuple(
        tuple(None if value is None else _term(value) for value in solution)
        for solution in islice(found, most)
    )
    return Rows(columns, rows, next(found, None) is not None)


def _term(value: object) -> Term:
    match value:
        case ox.NamedNode():
            return Term("uri", value.value)
        case ox.BlankNode():
            return Term("bnode", value.value)
        case ox.Literal(language=str(language)):
            return Term("literal", value.value, lang=language, direction=str(value.direction or ""))
        case ox.Literal():
            plain = value.datatype.value == f"{PREFIXES['xsd']}string"
            return Term("literal", value.value, "" if plain else value.datatype.value)
        case ox.Triple():
            return Term("triple", Triple(*map(_term, value)))
    raise TypeError(f"a {type(value).__name__} is no value of a row")


if __name__ == "__main__":
    question = msgspec.msgpack.decode(sys.stdin.buffer.read(), type=Question)
    sys.stdout.buffer.write(msgspec.msgpack.encode(answer(question)))
