"""The terms of O_RoCo: their IRIs, and which class is below which. Read once from companion's roco.ttl.

`ROCO.Jar` is the IRI of a term. The class tree is materialised here, so that no query walks it. Must not know: facts.
"""

from functools import cache
from importlib import resources

from rdflib import RDF, RDFS, Graph, Namespace
from rdflib.namespace import OWL

ROCO = Namespace("urn:robot-companion:roco#")


def read() -> Graph:
    """The ontology as a graph of its own."""
    text = resources.files("companion").joinpath("ontology/roco.ttl").read_text("utf-8")
    return Graph().parse(data=text, format="turtle")


@cache
def below() -> dict[str, frozenset[str]]:
    """Class name -> names of all its subclasses and its own."""
    graph = read()
    classes = {str(term).removeprefix(str(ROCO)): term for term in graph.subjects(RDF.type, OWL.Class)}
    return {
        name: frozenset(str(sub).removeprefix(str(ROCO)) for sub in graph.transitive_subjects(RDFS.subClassOf, term))
        for name, term in classes.items()
    }


def is_kind(kind: str, wanted: str) -> bool:
    """Is a class the wanted one or below it? An unknown word has nothing below it."""
    return kind in below().get(wanted, ())
