"""Object models and grasps: numbers that belong together do."""

import math
from importlib import resources

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rdflib import RDF, RDFS, Graph, Namespace, URIRef
from rdflib.namespace import OWL

from companion.design import DESIGN, WM
from companion.languages.values import Box, Cylinder, Pose
from companion.models import CLOSINGS, GRASPS, HANDLE, LYING, MODELS, REACH, fitting, looked_into
from companion.skills.motions import aim
from velma import names
from velma.eyes.content import LOW_RISE, rise
from velma.kinematics.frames import lies
from velma.kinematics.robot import Robot


def turned(pose, v):
    """A point of the inner frame in the outer one."""
    w, x, y, z = pose.quat_wxyz
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return tuple(sum(row[i] * v[i] for i in range(3)) + pose.xyz[k] for k, row in enumerate(rows))


def test_there_are_as_many_grasps_as_were_published():
    """96 for the jar, 32 for the bowl; boxes 24, 16, 8. Two of a jar that lies, and those of
    handles, are of trials.
    """
    standing = {
        name: [g for g in all_of if g.kind not in (LYING, HANDLE)]
        for name, all_of in GRASPS.items()
    }
    counts = {name: len(some) for name, some in standing.items()}
    assert [counts.pop(name) for name in ("door_left", "door_right")] == [0, 0]
    assert counts == {"jar": 96, "bowl_high": 32, "box1": 24, "box2": 16, "box3": 8}
    others = {name: len(GRASPS[name]) - count for name, count in counts.items()}
    assert {name: count for name, count in others.items() if count} == {"jar": 2}


@given(st.floats(-math.pi, math.pi), st.floats(-math.pi, math.pi), st.floats(-math.pi, math.pi))
def test_grasps_fit_a_thing_as_it_stands_or_lies(yaw, pitch, roll):
    """By the same angle as the geometry of the hand; a bowl that lies has no other ones."""
    matrix = pin.rpy.rpyToMatrix(roll, pitch, yaw)
    x, y, z, w = pin.Quaternion(matrix).coeffs()
    pose = Pose((0.5, 0.0, 0.8), (float(w), float(x), float(y), float(z)))
    if abs(matrix[2, 2] - math.cos(math.radians(15.0))) > 1e-9:
        kinds = {grasp.kind for grasp in fitting(GRASPS["jar"], pose)}
        assert kinds == ({LYING} if lies(pin.SE3(matrix, np.zeros(3))) else {"side"})
    assert fitting(GRASPS["bowl_high"], pose) == GRASPS["bowl_high"]


@pytest.mark.parametrize("model", GRASPS)
def test_a_grasp_comes_nearer_with_every_step(model):
    """From the outermost step on the object comes closer to the hand, with unit quaternions and
    names of its own.
    """
    assert len({grasp.id for grasp in GRASPS[model]}) == len(GRASPS[model])
    for grasp in GRASPS[model]:
        distances = [step.pose.xyz[2] for step in grasp.steps]
        assert distances == sorted(distances, reverse=True)
        assert grasp.closed > grasp.steps[-1].fingers
        for step in grasp.steps:
            assert math.hypot(*step.pose.quat_wxyz) == pytest.approx(1.0)


def test_the_jar_sits_deeper_in_the_hand_than_published():
    """Published at 0.02 in front of the grip; closing drags it to the palm from there, so 18 mm
    less.

    One that lies is 35 mm before it, or the fingers would meet the table.
    """
    depths = {grasp.kind: round(grasp.steps[-1].pose.xyz[2], 6) for grasp in GRASPS["jar"]}
    assert depths == {"side": 0.002, LYING: 0.035}


def test_the_jars_axis_is_across_the_approach():
    """Every jar grasp is one from the side."""
    for grasp in GRASPS["jar"]:
        pose = Pose((0.0, 0.0, 0.0), grasp.steps[-1].pose.quat_wxyz)
        assert turned(pose, (0.0, 0.0, 1.0))[2] == pytest.approx(0.0, abs=1e-5)


def test_the_hands_close_as_the_trials_say():
    """The jar is squeezed hard and the bowl hardly at all, closed upon slowly and taken less far
    out.
    """
    jar, bowl = GRASPS["jar"][0], GRASPS["bowl_high"][0]
    assert (math.degrees(jar.squeeze), jar.speed, jar.out) == (pytest.approx(40.0), 0.6, 0.28)
    assert (math.degrees(bowl.squeeze), bowl.speed, bowl.out) == (pytest.approx(0.8), 0.3, 0.22)
    kinds = [CLOSINGS["bowl_high"].kind_of(number) for number in (0, 15, 16, 31)]
    assert kinds == ["rim_two_inside"] * 2 + ["rim_one_inside"] * 2


def test_the_bowls_boards_lean_from_its_base_to_its_rim():
    """Twenty boards; the top of each is near the rim radius, the bottom near the base radius, all
    outwards alike.
    """
    boards = [shape for shape in MODELS["bowl_high"].shapes if isinstance(shape, Box)]
    assert len(boards) == 20
    for board in boards:
        half = board.size[2] / 2
        x, y, z = turned(board.at, (0.0, 0.0, half))
        assert math.hypot(x, y) == pytest.approx(0.1, abs=0.005)
        assert z == pytest.approx(0.1, abs=0.002)
        x, y, z = turned(board.at, (0.0, 0.0, -half))
        assert math.hypot(x, y) == pytest.approx(0.06, abs=0.005)
        assert z == pytest.approx(0.003, abs=0.002)
    assert any(isinstance(shape, Cylinder) for shape in MODELS["bowl_high"].shapes)


def test_a_model_says_where_it_is_from_and_has_shapes():
    """Each has a source, some shape, and mass."""
    for model in MODELS.values():
        assert model.source
        assert model.shapes
        assert model.mass > 0
        answer = model.of("x")
        assert WM.decode(WM.encode(answer)) == answer


def test_arms_reach_from_their_own_shoulder():
    """Left is where y is positive."""
    left_of_body = {side.value: reach.shoulders[0][1] > 0 for side, reach in REACH.items()}
    assert left_of_body == {"left": True, "right": False}


@pytest.mark.parametrize("model", ["door_left", "door_right"])
def test_a_hand_at_a_handle_has_the_bar_between_its_fingers(model):
    """The bar is upright in the hand's x, in the middle of its y, and as far before the grip at
    every slant; the hand comes from the front, and each grasp is another one.
    """
    boxes = (shape for shape in MODELS[model].shapes if isinstance(shape, Box))
    bar = next(box.at.xyz for box in boxes if box.size[2] == 0.136)
    depth, found = turned(GRASPS[model][0].steps[-1].pose, bar)[2], set()
    for grasp in GRASPS[model]:
        at = [turned(step.pose, bar) for step in grasp.steps]
        along = np.subtract(turned(grasp.steps[-1].pose, (bar[0], bar[1], bar[2] + 1.0)), at[-1])
        assert np.abs(along) == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)
        assert [x for x, _, _ in at] + [y for _, y, _ in at] == pytest.approx([0.0] * 4, abs=1e-9)
        assert at[0][2] > at[-1][2] == pytest.approx(depth)
        pose = grasp.steps[-1].pose
        outwards = np.subtract(turned(pose, (1.0, 0.0, 0.0)), pose.xyz)
        assert outwards[2] < -0.7
        found.add(tuple(np.round([*along, *outwards], 6)))
    assert len(found) == len(GRASPS[model])


# --- O_RoCo is readable, says something of every term in it, and imports nothing


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


@given(
    st.floats(names.LOWER[names.TORSO], names.UPPER[names.TORSO]),
    st.floats(-1.2, 1.2),
    st.floats(0.55, 1.1),
    st.floats(0.7, 1.6),
)
def test_the_eyes_look_into_what_stands_low(torso, around, away, height):
    """As the camera does that is turned to it, but for two degrees."""
    point = np.array([away * math.cos(around), away * math.sin(around), height])
    head = aim(torso, point)
    above = rise(Robot().camera(torso, head.pan, head.tilt).translation, point[None, :])
    if abs(above - LOW_RISE) > math.radians(2.0):
        assert looked_into(*point) == (above > LOW_RISE)
