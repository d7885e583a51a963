"""Beliefs as an RDF dataset in memory, for people's questions.

Default graph: O_RoCo, all that is believed, and who told what when. Named graphs: one per observation with the facts
that have been true since it, one per hypothetical state with all that would be so in it.
"""

from collections.abc import Iterator

import pyoxigraph as ox
from rdflib import RDF

from companion.asking import PREFIXES
from services.knowledge.beliefs import Beliefs, Source
from services.knowledge.subjects import CONTENT, ROCO, THING, iri, read


def dataset(beliefs: Beliefs, begin: float) -> ox.Store:
    """Everything believed; times are seconds since `begin` [unix s]."""
    triples = ox.Store()
    triples.load(read().serialize(format="nt").encode(), format=ox.RdfFormat.N_TRIPLES)
    triples.extend(_quads(beliefs, begin))
    return triples


def _quads(beliefs: Beliefs, begin: float) -> Iterator[ox.Quad]:
    for fact, source in beliefs.facts.items():
        yield fact
        yield _in(_said(source), fact)
    for source in beliefs.sources:
        yield from _told(_said(source), "Observation", source, begin)
        if (about := _about(source.about)) is not None:
            yield ox.Quad(_said(source), _term("about"), about)
    for state, source in beliefs.states.items():
        yield from _told(_state(state), "HypotheticalState", source, begin)
        if source.parent:
            yield ox.Quad(_state(state), _term("madeFrom"), _state(source.parent))
        for subject in beliefs.supposed(state):
            yield from (_in(_state(state), quad) for quad in subject.quads())


def _told(node: ox.NamedNode, kind: str, source: Source, begin: float) -> Iterator[ox.Quad]:
    agent = ox.NamedNode(iri(PREFIXES["agent"], source.by))
    yield ox.Quad(node, _TYPE, _term(kind))
    yield ox.Quad(agent, _TYPE, _term("Agent"))
    yield ox.Quad(node, _term("toldBy"), agent)
    yield ox.Quad(node, _term("toldAt"), ox.Literal(round(source.at - begin, 3)))


def _about(key: str) -> ox.NamedNode | None:
    """The node of a subject's key; a posture is of the robot."""
    kind, _, name = key.partition(":")
    match kind:
        case "object":
            return ox.NamedNode(iri(THING, name))
        case "content":
            return ox.NamedNode(iri(CONTENT, name))
        case "hand":
            return _term(f"{name}_hand")
        case _:
            return _term("velma")


def _said(source: Source) -> ox.NamedNode:
    """`said:ta.object.jar_1.1.8` for object/jar_1@1.8 of ta: a name that SPARQL takes after a prefix."""
    return ox.NamedNode(iri(PREFIXES["said"], f"{source.by}.{source.name}".replace("/", ".").replace("@", ".")))


def _state(name: str) -> ox.NamedNode:
    return ox.NamedNode(iri(PREFIXES["state"], name))


def _term(name: str) -> ox.NamedNode:
    return ox.NamedNode(str(ROCO[name]))


def _in(graph: ox.NamedNode, quad: ox.Quad) -> ox.Quad:
    return ox.Quad(quad.subject, quad.predicate, quad.object, graph)


_TYPE = ox.NamedNode(str(RDF.type))
