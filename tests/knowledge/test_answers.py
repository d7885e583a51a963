"""Every kind of query has its answer, answers are pure, and nothing is known that was not
observed.
"""

from typing import get_args

import msgspec
import pytest
from msgspec.structs import replace

from companion.design import DESIGN, LANGUAGES, WM
from companion.languages import wm
from companion.languages.facts import Kind, fact
from companion.languages.values import Box, Cylinder, Pose, Side
from companion.models import GRASPS, MODELS
from companion.world.scene import PARTS, Scene, SceneObject
from fipa_codec.performatives import Performative
from services.knowledge.answers import ANSWERS, MAKERS, ask
from services.knowledge.memory import Overlays
from services.knowledge.store import Store
from topdown.check.agreement import check_supported
from topdown.model.findings import Kind as Found
from topdown.model.interfaces import interfaces

from .storing import answer, store_observation

VOLUME = Cylinder(0.1, 0.3, Pose((0.85, 0.37, 1.25)))

FITTING = {
    "object": "jar_1",
    "subject": "jar_1",
    "side": Side.LEFT,
    "volume": VOLUME,
    "prefix": "p",
}
"""A value for each field, about the recorded scene."""
OF_THEIR_OWN = (
    wm.ListObjects(),
    wm.FlatSurfaces(object="table_1"),
    wm.GraspDefinition(object="jar_1", grasp="7"),
    wm.Holds(relation="isIn", subject="jar_1", value="cabinet_2"),
    wm.HypotheticalState(id="p", changes=(wm.Poured("jar_1", "bowl_1"),)),
)
"""Queries whose fields are not filled in by those values."""


def example(kind):
    """A query of a kind."""
    own = next((one for one in OF_THEIR_OWN if type(one) is kind), None)
    fields = [field.name for field in msgspec.structs.fields(kind)]
    needed = {field.name for field in msgspec.structs.fields(kind) if field.required}
    assert own or needed <= set(FITTING), (
        f"add an example of wm.{kind.__name__} to OF_THEIR_OWN in this file"
    )
    return own or kind(**{name: value for name, value in FITTING.items() if name in fields})


EXAMPLES = tuple(map(example, get_args(wm.AnyQuery)))
"""One query of each kind."""
ABOUT_AN_OBJECT = [
    query for query in EXAMPLES if getattr(query, "object", "") or getattr(query, "subject", "")
]
ABOUT_THE_BODY = [
    query
    for query in EXAMPLES
    if isinstance(query, wm.GraspAtSide) or "Configuration" in type(query).__name__
]


def test_every_kind_of_query_has_a_function_and_an_entry_in_the_interface():
    """Language, table and design agree."""
    for name in sorted(
        type(one).__name__ for one in EXAMPLES if type(one) not in {*ANSWERS, *MAKERS}
    ):
        pytest.fail(f"add a row wm.{name} to ANSWERS in services/knowledge/answers.py")
    kinds = set(get_args(wm.AnyQuery))
    assert set(ANSWERS) | MAKERS == kinds
    assert not set(ANSWERS) & MAKERS
    asked = interfaces(DESIGN, LANGUAGES)["ask_for_planning"]
    assert {argument for entry in asked for argument in entry.arguments} == kinds


def test_the_answer_is_of_the_class_the_design_promises(handled):
    """And it fits its language and the size budget, as the query does with an envelope of 120
    bytes.

    Answers are pure: asked twice, the same answer; and nothing observed has changed.
    """
    interface, before = interfaces(DESIGN, LANGUAGES)["ask_for_planning"], handled.scene
    for query in EXAMPLES:
        said = answer(handled, query)
        (entry,) = [one for one in interface if one.arguments == (type(query),)]
        assert type(said) in entry.answers, query
        raw = WM.encode(said)
        assert WM.decode(raw) == said == answer(handled, query)
        most = DESIGN.rules["km", "pl", "query", Performative.INFORM_REF].bytes
        assert len(bytes(raw)) < most, query
        rule = DESIGN.rules["pl", "km", "query", Performative.QUERY_REF]
        budget = rule.sizes[f"WM.{type(query).__name__}"]
        assert len(bytes(WM.encode(query))) + 120 <= budget, query
    assert handled.scene is before


def test_who_has_observed_nothing_knows_nothing():
    """A starved store answers Unknown, and names what was asked."""
    store = Store.open()
    for query in (*ABOUT_AN_OBJECT, *ABOUT_THE_BODY):
        said = answer(store, query)
        assert isinstance(said, wm.Unknown), query
        name = getattr(query, "object", "") or getattr(query, "subject", "")
        if name:
            assert said.why == (fact(Kind.NOT_SEEN, name), fact(Kind.SEEN_NOTHING)), query
        else:
            assert said.why[0] in [fact(Kind.UNKNOWN_TO_KM, part) for part in PARTS], query


def test_who_has_observed_nothing_lists_nothing():
    """No object, surface, shape or collision comes from anywhere else."""
    store = Store.open()
    for query in (
        wm.ListObjects(),
        wm.MoveableObjects(),
        wm.StaticObjects(),
        wm.CollisionsInVolume(volume=VOLUME),
    ):
        assert answer(store, query) == wm.Objects(())
    assert answer(store, wm.EnvironmentShapes()) == wm.Shapes(())
    assert answer(store, wm.FlatSurfaces()) == wm.Surfaces(())


def test_an_object_that_was_seen_is_known_and_its_neighbour_is_not():
    """Knowledge comes by subject."""
    store = Store.open()
    store_observation(store, wm.SeenObject("jar_1", "jar", Pose((1.0, 0.0, 1.0)), 0.0), (1, 1))
    assert isinstance(answer(store, wm.ObjectPose(object="jar_1")), wm.PoseOf)
    said = answer(store, wm.ObjectPose(object="bowl_1"))
    assert isinstance(said, wm.Unknown)
    assert said.why == (fact(Kind.NOT_SEEN, "bowl_1"), fact(Kind.SEEN, "jar_1"))


def test_what_is_told_of_a_thing_not_seen_stays_small():
    """Of very many things that were seen the names are left out; and whatever it is called, it can
    be read.
    """
    jar = SceneObject("jar", "jar", Pose((1.0, 0.0, 1.0)))
    names = [f"jar_{n}" for n in range(60)]
    scene = Scene(things={name: replace(jar, id=name) for name in names})
    _, said = ask(scene, Overlays(), wm.ObjectPose(object="mała miska " * 10))
    assert isinstance(said, wm.Unknown)
    assert [one.kind for one in said.why] == [Kind.NOT_SEEN]
    assert WM.decode(WM.encode(said)) == said


def test_objects_are_listed_by_class_and_superclass(kitchen):
    """A container is a jar, a bowl or a cabinet; an unknown class is told."""
    said = answer(kitchen, wm.ListObjects(kind="Container"))
    assert isinstance(said, wm.Objects)
    kinds = {"jar_1": "Jar", "bowl_1": "Bowl", "cabinet_2": "CabinetNoDoor"}
    assert {thing.id: thing.kind for thing in said.objects} == kinds
    said = answer(kitchen, wm.ListObjects(kind="Teapot"))
    assert isinstance(said, wm.Unknown)
    assert said.why == (fact(Kind.UNKNOWN_TO_KM, "Teapot"),)


def test_surfaces_are_in_the_world(kitchen):
    """A table's top is at its height, a cabinet has two shelves and a roof."""
    said = answer(kitchen, wm.FlatSurfaces())
    assert isinstance(said, wm.Surfaces)
    of_cabinet = (one.at.xyz[2] for one in said.surfaces if one.object == "cabinet_2")
    heights = sorted(round(height, 3) for height in of_cabinet)
    assert heights == [0.88, 1.18, 1.475]
    (top,) = (surface for surface in said.surfaces if surface.object == "table_1")
    assert top.at.xyz == pytest.approx((0.783, -0.84, 0.775))


def test_a_held_object_moves_with_its_hand(kitchen):
    """PoseOf names the hand, CurrentGrasp gives T_grip_object, and the object is not part of the
    surroundings.
    """
    grip = Pose((0.0, 0.0, 0.002), (0.0, 1.0, 0.0, 0.0))
    store_observation(kitchen, wm.SeenHand(Side.LEFT, "jar_1", "7", grip), (1, 50))
    pose = answer(kitchen, wm.ObjectPose(object="jar_1"))
    assert isinstance(pose, wm.PoseOf)
    assert (pose.held_by, pose.exact) == (Side.LEFT, False)
    grasp = wm.GraspOf("jar_1", Side.LEFT, "7", grip)
    assert answer(kitchen, wm.CurrentGrasp(object="jar_1")) == grasp
    assert answer(kitchen, wm.GraspAtSide(side=Side.LEFT)) == grasp
    assert answer(kitchen, wm.GraspAtSide(side=Side.RIGHT)) == wm.GraspOf("", Side.RIGHT)
    shapes = answer(kitchen, wm.EnvironmentShapes(ignored=("table_2",)))
    assert isinstance(shapes, wm.Shapes)
    assert {shape.object for shape in shapes.shapes} == {"table_1", "cabinet_2", "bowl_1"}


def test_grasps_are_those_of_the_model(kitchen):
    """All, or the one that is asked for; a table has none."""
    assert answer(kitchen, wm.GraspSet(object="bowl_1")) == wm.Grasps("bowl_1", GRASPS["bowl_high"])
    one = answer(kitchen, wm.GraspDefinition(object="jar_1", grasp="7"))
    assert isinstance(one, wm.Grasps)
    assert [grasp.id for grasp in one.grasps] == ["7"]
    for query, why in (
        (wm.GraspSet(object="table_1"), fact(Kind.NO_KNOWN_GRASP, "table_1")),
        (wm.GraspDefinition(object="jar_1", grasp="777"), fact(Kind.UNKNOWN_TO_KM, "777")),
    ):
        assert answer(kitchen, query) == wm.Unknown((why,))


def test_a_volume_is_met_by_what_reaches_into_it(kitchen):
    """Around the jar: jar and cabinet; a small one in mid air: nothing; ignored objects are not
    named.
    """
    around = wm.CollisionsInVolume(volume=VOLUME)
    said = answer(kitchen, around)
    assert isinstance(said, wm.Objects)
    assert {thing.id for thing in said.objects} == {"jar_1", "cabinet_2"}
    free = wm.CollisionsInVolume(volume=Box((0.1, 0.1, 0.1), Pose((0.3, 0.0, 1.5))))
    assert answer(kitchen, free) == wm.Objects(())
    said = answer(kitchen, wm.CollisionsInVolume(volume=VOLUME, ignored=("jar_1", "cabinet_2")))
    assert said == wm.Objects(())


def test_relations_hold_or_not(kitchen):
    """As in the recorded scene; content is known by the observation of a pouring only."""
    rows = [
        ("isIn", "jar_1", "cabinet_2", True),
        ("isIn", "jar_1", "", True),
        ("isIn", "jar_1", "bowl_1", False),
        ("isOn", "cabinet_2", "table_2", True),
        ("isOn", "table_1", "", False),
        ("isGraspedBy", "jar_1", "", False),
        ("isInstanceOf", "jar_1", "Container", True),
        ("isInstanceOf", "jar_1", "jar", True),
        ("isInstanceOf", "jar_1", "Bowl", False),
        ("hasExactPose", "bowl_1", "", True),
        ("isIn", "jar_1.content", "bowl_1", False),
    ]
    wrong = [row for row in rows if answer(kitchen, wm.Holds(*row[:3])) != wm.Truth(row[3])]
    assert wrong == []
    store_observation(kitchen, wm.FeltContent("jar_1", "bowl_1", 0.06), (1, 60))
    assert answer(kitchen, wm.Holds("isIn", "jar_1.content", "bowl_1")) == wm.Truth(True)
    unknown = wm.Unknown((fact(Kind.UNKNOWN_TO_KM, "likes"),))
    assert answer(kitchen, wm.Holds("likes", "jar_1")) == unknown


def test_a_model_says_what_pl_needs(kitchen):
    """The answer is the model's, under the object's name; a table has no opening."""
    assert answer(kitchen, wm.ObjectModel(object="jar_1")) == MODELS["jar"].of("jar_1")
    none = wm.Unknown((fact(Kind.NO_OPENING, "table_1"),))
    assert answer(kitchen, wm.ObjectHole(object="table_1")) == none


def test_reserved_space_is_a_hypotheticals_only(kitchen):
    """A plan keeps a volume free in its own states; the observed world has none."""
    query = wm.HypotheticalState(id="p", changes=(wm.Reserved("pouring", VOLUME),))
    overlays, _ = ask(kitchen.scene, Overlays(), query)
    said = answer(kitchen, wm.ReservedSpace(state="p"), overlays)
    assert isinstance(said, wm.Shapes)
    assert [(shape.object, shape.shapes) for shape in said.shapes] == [("pouring", (VOLUME,))]
    assert answer(kitchen, wm.ReservedSpace(), overlays) == wm.Shapes(())


def test_a_kind_that_loses_its_code_is_found():
    """Every kind of query that the design declares is answered, and no other (paper, section 5.6);
    one by one.
    """
    supported = {f"WM.{kind.__name__}" for kind in (*ANSWERS, *MAKERS)}
    assert "WM.ObserveWorld" not in supported, "km asks this one of ta, nobody asks km"
    assert check_supported(DESIGN, "km", supported) == ()
    for kind in supported:
        found = check_supported(DESIGN, "km", supported - {kind})
        assert [(one.kind, kind in one.where) for one in found] == [(Found.NOT_SUPPORTED, True)]
