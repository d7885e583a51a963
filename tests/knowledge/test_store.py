"""The store keeps what was observed, whole and with its version, and says it in the terms of the
ontology.
"""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rdflib import RDF, URIRef

from companion.asking import PREFIXES
from companion.languages import wm
from companion.languages.values import BodyPosture, Pose, Side, Uncertainty
from services.knowledge.store import ROCO, Store, below, node

from .conftest import KITCHEN
from .storing import store_observation

SURE = Uncertainty((3e-6, 0.0, 0.0, 4e-6, 0.0, 2e-6), 1e-6)

number = st.floats(-2.0, 2.0, allow_nan=False)
poses = st.builds(Pose, st.tuples(number, number, number))
names = st.sampled_from(["jar_1", "bowl_1", 'odd "name" > x', "schüssel"])
observations = st.one_of(
    st.builds(
        wm.SeenObject,
        names,
        st.sampled_from(["jar", "bowl_high", "table", "teapot"]),
        poses,
        number,
        st.none() | st.floats(0.0, 1.0),
    ),
    st.builds(
        wm.SeenHand, st.sampled_from(Side), st.one_of(st.just(""), names), st.just("3"), poses
    ),
    st.builds(wm.FeltContent, names, names, st.floats(0.0, 1.0)),
    st.builds(
        wm.SeenBody,
        st.builds(
            BodyPosture,
            number,
            *(st.tuples(*[number] * 7),) * 2,
            st.tuples(number, number),
            *(st.tuples(*[number] * 4),) * 2,
        ),
    ),
)
versions = st.tuples(st.integers(1, 3), st.integers(0, 9))


@given(st.lists(st.tuples(observations, versions), max_size=8))
def test_what_is_read_back_is_what_was_written(story):
    """A store opened on the same triples has the same scene, whatever was observed in whatever
    order.
    """
    store = Store.open()
    for observation, version in story:
        store_observation(store, observation, version, now=1.5)
    assert Store(store._triples).scene == store.scene


def test_a_store_on_disk_is_found_again(tmp_path):
    """Facts, versions and times survive; an old version is ignored afterwards too."""
    store = Store.open(tmp_path / "km")
    for count, observation in enumerate(KITCHEN):
        store_observation(store, observation, (1, count), now=2.0)
    scene = store.scene
    del store
    again = Store.open(tmp_path / "km")
    assert again.scene == scene
    assert not store_observation(again, KITCHEN[2], (1, 2))


def test_an_older_version_is_not_stored(kitchen):
    """`store_observation` returns False, and the scene is the very same object."""
    before = kitchen.scene
    assert not store_observation(kitchen, KITCHEN[0], (1, 0))
    assert kitchen.scene is before


def test_facts_are_in_the_terms_of_the_ontology(kitchen):
    """Class, model, relations, time and version of an object are triples."""
    graph, jar = kitchen.graph(), URIRef(node("thing", "jar_1").value)
    assert (jar, RDF.type, ROCO.Jar) in graph
    assert (jar, ROCO.isIn, URIRef(node("thing", "cabinet_2").value)) in graph
    assert float(graph.value(jar, ROCO.observedAt)) == 1.2
    assert str(graph.value(jar, ROCO.version)) == "1.3"


def test_people_may_ask_in_sparql(kitchen):
    """Everything that is in a container, by class and superclass."""
    rows = kitchen.graph().query(
        """
        PREFIX : <urn:robot-companion:roco#>
        PREFIX rdfs: <http://www.w3.org/2000/01/rdf-schema#>
        SELECT ?thing WHERE { ?thing :isIn ?where . ?where a/rdfs:subClassOf* :Container }
        """
    )
    assert {str(row[0]).removeprefix(PREFIXES["thing"]) for row in rows} == {"jar_1", "bowl_1"}


def test_facts_of_a_changed_subject_are_replaced_and_not_added(kitchen):
    """A jar taken out of the cabinet is no longer in it; what the ontology says of the hand
    stays.
    """
    held = wm.SeenHand(Side.LEFT, "jar_1", "3", Pose((0.0, 0.0, 0.002)))
    store_observation(kitchen, held, (1, 20))
    store_observation(kitchen, wm.SeenObject("jar_1", "jar", Pose((0.4, 0.4, 1.4)), 9.0), (1, 21))
    graph, jar = kitchen.graph(), URIRef(node("thing", "jar_1").value)
    assert not list(graph.objects(jar, ROCO.isIn))
    assert list(graph.objects(jar, ROCO.isGraspedBy)) == [ROCO.left_hand]
    assert len(list(graph.objects(jar, ROCO.record))) == 1
    assert str(graph.value(ROCO.left_hand, ROCO.atSide)) == "left"
    assert (ROCO.left_hand, RDF.type, ROCO.Gripper) in graph


def test_every_predicate_that_is_written_is_in_the_ontology(kitchen):
    """No property is made up by the store."""
    store_observation(kitchen, wm.FeltContent("jar_1", "bowl_1", 0.06), (1, 30))
    held = wm.SeenHand(Side.RIGHT, "bowl_1", "2", Pose((0.0, 0.0, 0.1)))
    store_observation(kitchen, held, (1, 31))
    full = wm.SeenObject("bowl_1", "bowl_high", Pose((0.0, 0.0, 0.1)), 1.0, 0.06, SURE)
    store_observation(kitchen, full, (1, 32))
    graph = kitchen.graph()
    assert graph.value(URIRef(node("thing", "bowl_1").value), ROCO.contentSeen).toPython() == 0.06
    assert graph.value(
        URIRef(node("thing", "bowl_1").value), ROCO.placeDeviation
    ).toPython() == pytest.approx(0.003)
    used = {p for p in graph.predicates() if p in ROCO}
    assert all((p, RDF.type, None) in graph for p in used)


def test_classes_below_a_class_are_known_at_once():
    """A cabinet without doors is a container."""
    assert "CabinetNoDoor" in below()["Container"]
    assert "Table" not in below()["Container"]
