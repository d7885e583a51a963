"""The triples of a scene in the terms of O_RoCo, and the differences between two scenes.

Facts (class, model, relations, who holds what, time of observation) are triples. The numbers of a
subject are one literal (a record): as nodes they would cost ten times as much. Must not know:
stores, queries.
"""

from collections.abc import Mapping, Set
from functools import cache
from importlib import resources
from typing import Any

import msgspec
import pyoxigraph as ox
from rdflib import RDF, RDFS, Graph, Namespace
from rdflib.namespace import OWL

from companion.asking import PREFIXES
from companion.world.scene import Held, Scene, SceneObject

# --- the terms of O_RoCo: `ROCO.Jar` is the IRI of a term -----------------------------------------

ROCO = Namespace(PREFIXES["roco"])


@cache
def term(name: str) -> ox.NamedNode:
    return ox.NamedNode(str(ROCO[name]))


@cache
def text() -> str:
    """The ontology in Turtle."""
    return resources.files("companion").joinpath("ontology/roco.ttl").read_text("utf-8")


def read() -> Graph:
    """The ontology as a new graph."""
    return Graph().parse(data=text(), format="turtle")


@cache  # so that no query walks the class tree
def below() -> dict[str, frozenset[str]]:
    """By class name, the names of the class and all its subclasses."""
    graph = read()
    classes = {
        str(term).removeprefix(str(ROCO)): term for term in graph.subjects(RDF.type, OWL.Class)
    }
    return {
        name: frozenset(
            str(sub).removeprefix(str(ROCO))
            for sub in graph.transitive_subjects(RDFS.subClassOf, term)
        )
        for name, term in classes.items()
    }


def is_kind(kind: str, wanted: str) -> bool:
    """Whether a class is the wanted one or a subclass; False for an unknown wanted class."""
    return kind in below().get(wanted, ())


# --- the triples of a scene -----------------------------------------------------------------------

TYPE = ox.NamedNode(str(RDF.type))
RECORD, VERSION, OBSERVED = term("record"), term("version"), term("observedAt")

_encoder = msgspec.json.Encoder()


def node(prefix: str, name: str) -> ox.NamedNode:
    """`thing:jar_1` and the like; characters that an IRI may not have are percent-encoded."""
    return ox.NamedNode(
        PREFIXES[prefix]
        + "".join(c if c.isalnum() or c in "-._/" else f"%{ord(c):02X}" for c in name)
    )


class Stored(msgspec.Struct, frozen=True, omit_defaults=True):
    """The record of a subject, by its key in the versions; one of the other fields is set."""

    subject: str
    # as stores of earlier releases
    object: SceneObject | None = msgspec.field(default=None, name="thing")
    held: Held | None = None
    joints: tuple[float, ...] | None = None
    content: str | None = None


class Subject(msgspec.Struct, frozen=True):
    """A node, and all that is written on it."""

    node: ox.NamedNode
    quads: tuple[ox.Quad, ...]


def subjects(scene: Scene, names: Set[str] | None = None) -> dict[str, Subject]:
    """The contents of a scene by subject. Reserved space belongs to a plan and is never observed.

    `names`: of the objects, hands (by side), contents and parts of the body ("" for all of it) that
    are wanted.
    """
    found: dict[str, Subject] = {}
    for name in (name for name in scene.things if names is None or name in names):
        found[name] = _of_object(scene, scene.things[name])
    for side, held in (
        (side, held) for side, held in scene.hands.items() if names is None or side in names
    ):
        part = f"{side.value}_hand"
        found[f"{side.value} hand"] = _subject(
            scene, term(part), Stored(f"hand:{side.value}", held=held)
        )
    for part, q in scene.joints.items() if names is None or "" in names else ():
        name = part.removesuffix("_hand") + "_fingers" if part.endswith("_hand") else part
        found[name] = _subject(scene, term(name), Stored(f"body:{part}", joints=q), key="body")
    for source in (source for source in scene.contents if names is None or source in names):
        destination = scene.contents[source]
        facts = ((TYPE, term("Substance")), (term("isIn"), node("thing", destination)))
        stored = Stored(f"content:{source}", content=destination)
        found[f"content {source}"] = _subject(scene, node("content", source), stored, *facts)
    return found


def _of_object(scene: Scene, one: SceneObject) -> Subject:
    facts: list[tuple[ox.NamedNode, ox.NamedNode | ox.Literal]] = [
        (TYPE, term(one.kind)),
        (term("isInstanceOf"), node("model", one.model)),
        *((term("isIn"), node("thing", other)) for other in one.inside),
        (term("isMoveable"), ox.Literal(one.moveable)),
        (term("hasExactPose"), ox.Literal(one.exact)),
        (term("relatedAt"), ox.Literal(one.related_at)),
    ]
    if one.on:
        facts.append((term("isOn"), node("thing", one.on)))
    if (side := scene.holder(one.id)) is not None:
        facts.append((term("isGraspedBy"), term(f"{side.value}_hand")))
        facts.append(
            (term("isGraspedWith"), node("grasp", f"{one.model}/{scene.hands[side].grasp}"))
        )
    if one.content is not None:
        facts.append((term("contentSeen"), ox.Literal(one.content)))
    if one.uncertainty is not None:
        facts.append((term("placeDeviation"), ox.Literal(one.uncertainty.deviation)))
    return _subject(scene, node("thing", one.id), Stored(f"object:{one.id}", object=one), *facts)


def _subject(
    scene: Scene,
    on: ox.NamedNode,
    stored: Stored,
    *facts: tuple[ox.NamedNode, ox.NamedNode | ox.Literal],
    key: str = "",
) -> Subject:
    """`key`: in the versions, where it is not that of the record."""
    key = key or stored.subject
    quads = [ox.Quad(on, RECORD, ox.Literal(_encoder.encode(stored).decode()))]
    if key in scene.versions:
        quads.append(ox.Quad(on, VERSION, ox.Literal("{}.{}".format(*scene.versions[key]))))
    if key in scene.times:
        quads.append(ox.Quad(on, OBSERVED, ox.Literal(scene.times[key])))
    return Subject(on, (*quads, *(ox.Quad(on, predicate, value) for predicate, value in facts)))


# --- differences ----------------------------------------------------------------------------------


def differing(old: Scene, new: Scene) -> tuple[list[Subject], list[Subject]]:
    """The subjects of the old scene that are not so in the new one, and those of the new one that
    were not.
    """
    # An object that is the same instance in both scenes did not change, and a new time comes with a
    # new version.
    versions = {key.partition(":")[2] for key in _changed(old.versions, new.versions)}
    held = {held.object for scene in (old, new) for held in scene.hands.values()}
    changed = _changed(old.things, new.things) | _changed(old.contents, new.contents)
    names = versions | held | changed
    names |= _changed(old.hands, new.hands) | ({""} if _changed(old.joints, new.joints) else set())
    before, after = subjects(old, names), subjects(new, names)
    gone = [one for key, one in before.items() if after.get(key) != one]
    return gone, [one for key, one in after.items() if before.get(key) != one]


def _changed(old: Mapping[Any, object], new: Mapping[Any, object]) -> set[str]:
    """The keys whose values are not the same instance."""
    if old is new:
        return set()
    return {key for key, value in new.items() if old.get(key) is not value} | (
        old.keys() - new.keys()
    )
