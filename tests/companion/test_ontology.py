"""O_RoCo is readable, says something of every term in it, and imports nothing."""

from importlib import resources

import pytest
from rdflib import RDF, RDFS, Graph, Namespace, URIRef
from rdflib.namespace import OWL

from companion.design import DESIGN
from companion.models import MODELS

ROCO = Namespace("urn:robot-companion:roco#")
KINDS = (OWL.Class, OWL.ObjectProperty, OWL.DatatypeProperty)


@pytest.fixture(scope="module")
def graph():
    """The ontology that the design names."""
    (entry,) = DESIGN.file.ontology
    text = resources.files("companion").joinpath(entry.file).read_text("utf-8")
    return Graph().parse(data=text, format="turtle")


def test_every_term_has_a_label_and_a_comment(graph):
    """In words."""
    terms = {term for kind in KINDS for term in graph.subjects(RDF.type, kind)}
    assert len(terms) > 40
    for term in terms:
        assert graph.value(term, RDFS.label), term
        assert graph.value(term, RDFS.comment), term


def test_every_term_that_is_used_is_defined(graph):
    """No misspelt term of our own, in any place of a triple."""
    kinds = (*KINDS, OWL.NamedIndividual)
    defined = {term for kind in kinds for term in graph.subjects(RDF.type, kind)}
    named = {s for s in graph.subjects() if isinstance(s, URIRef)}
    for triple in graph:
        for node in triple:
            if isinstance(node, URIRef) and node in ROCO:
                assert node in defined | named, node


def test_nothing_is_imported(graph):
    """Foreign terms are named by IRI only."""
    assert not list(graph.triples((None, OWL.imports, None)))


def test_every_model_is_of_a_class_of_the_ontology(graph):
    """And that class is a physical object."""
    for model in MODELS.values():
        above = graph.transitive_objects(ROCO[model.kind], RDFS.subClassOf)
        assert ROCO.PhysicalObject in set(above)


def test_our_top_classes_stand_below_foreign_ones(graph):
    """DUL, SOMA or CORA is named by every class that has no class of ours above it."""
    for term in graph.subjects(RDF.type, OWL.Class):
        above = set(graph.objects(term, RDFS.subClassOf))
        assert above, term
