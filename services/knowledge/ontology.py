"""The terms of O_RoCo: their IRIs, and which class is below which. Read once from companion's roco.ttl.

`ROCO.Jar` is the IRI of a term. The class tree is materialised here, so that no query walks it. Must not know: facts.
"""

from functools import cache
from importlib import resources

from rdflib import RDF, RDFS, Graph, Namespace
from rdflib.namespace import OWL

ROCO = Namespace("urn:robot-companion:roco#")


@cache
def text() -> str:
    """Return the ontology in Turtle."""
    return resources.files("companion").joinpath("ontology/roco.ttl").read_text("utf-8")


def read() -> Graph:
    """Return the ontology as a new graph."""
    return Graph().parse(data=text(), format="turtle")


@cache
def below() -> dict[str, frozenset[str]]:
    """Return, by class name, the names of the class and all its subclasses."""
    graph = read()
    classes = {str(term).removeprefix(str(ROCO)): term for term in graph.subjects(RDF.type, OWL.Class)}
    return {
        name: frozenset(str(sub).removeprefix(str(ROCO)) for sub in graph.transitive_subjects(RDFS.subClassOf, term))
        for name, term in classes.items()
    }


def is_kind(kind: str, wanted: str) -> bool:
    """Whether a class is the wanted one or a subclass; False for an unknown wanted class."""
    return kind in below().get(wanted, ())
