"""The triples of a scene in the terms of O_RoCo, and the differences between two scenes.

Facts (class, model, relations, who holds what, time of observation) are triples. The numbers of a subject are one
literal (a record): as nodes they would cost ten times as much. Must not know: stores, queries.
"""

from collections.abc import Iterator, Mapping, Set
from functools import cache
from importlib import resources

import msgspec
import pyoxigraph as ox
from rdflib import RDF, RDFS, Graph, Namespace
from rdflib.namespace import OWL

from services.knowledge.scene import Held, Scene, Thing

# --- The terms of O_RoCo: their IRIs, and which class is below which. Read once from companion's roco.ttl ------------
# `ROCO.Jar` is the IRI of a term. The class tree is materialised here, so that no query walks it. Must not know: facts.


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


# --- The triples of a scene in the terms of O_RoCo, and the differences between two scenes ----------------------------


THING = "urn:robot-companion:thing/"
CONTENT = "urn:robot-companion:content/"
MODEL = "urn:robot-companion:model/"
GRASP = "urn:robot-companion:grasp/"

RECORD = ox.NamedNode(str(ROCO.record))
VERSION = ox.NamedNode(str(ROCO.version))
OBSERVED = ox.NamedNode(str(ROCO.observedAt))

_encoder = msgspec.json.Encoder()


class Stored(msgspec.Struct, frozen=True, omit_defaults=True):
    """The record of a subject: those of these that it has, and its key in the versions."""

    subject: str
    thing: Thing | None = None
    held: Held | None = None
    joints: tuple[float, ...] | None = None
    content: str | None = None


class Subject(msgspec.Struct, frozen=True):
    """All that is written on one node."""

    node_iri: str
    stored: Stored
    version: tuple[int, int] | None
    time: float | None
    facts: tuple[tuple[str, str], ...] = ()
    values: tuple[tuple[str, bool | float], ...] = ()

    @property
    def node(self) -> ox.NamedNode:
        return ox.NamedNode(self.node_iri)

    def quads(self) -> Iterator[ox.Quad]:
        yield ox.Quad(self.node, RECORD, ox.Literal(_encoder.encode(self.stored).decode()))
        if self.version is not None:
            yield ox.Quad(self.node, VERSION, ox.Literal("{}.{}".format(*self.version)))
        if self.time is not None:
            yield ox.Quad(self.node, OBSERVED, ox.Literal(self.time))
        for predicate, value in self.facts:
            yield ox.Quad(self.node, ox.NamedNode(predicate), ox.NamedNode(value))
        for predicate, number in self.values:
            yield ox.Quad(self.node, ox.NamedNode(predicate), ox.Literal(number))


def subjects(scene: Scene, names: Set[str] | None = None) -> dict[str, Subject]:
    """Return the contents of a scene by subject. Reserved space belongs to a plan and is never observed.

    `names`: of the things and contents that are wanted, None for all.
    """
    found: dict[str, Subject] = {}
    for name in (name for name in scene.things if names is None or name in names):
        found[name] = _thing(scene, scene.things[name])
    for side, held in scene.hands.items():
        found[f"{side.value} hand"] = _part(scene, f"{side.value}_hand", Stored(f"hand:{side.value}", held=held))
    for part, q in scene.joints.items():
        name = part.removesuffix("_hand") + "_fingers" if part.endswith("_hand") else part
        found[name] = _part(scene, name, Stored(f"body:{part}", joints=q), "body")
    for source in (source for source in scene.contents if names is None or source in names):
        found[f"content {source}"] = _content(scene, source, scene.contents[source])
    return found


def differing(old: Scene, new: Scene) -> tuple[list[Subject], list[Subject]]:
    """Return the subjects of the old scene that are not so in the new one, and those of the new one that were not."""
    names = _touched(old, new)
    before, after = subjects(old, names), subjects(new, names)
    gone = [one for key, one in before.items() if after.get(key) != one]
    return gone, [one for key, one in after.items() if before.get(key) != one]


def _touched(old: Scene, new: Scene) -> set[str]:
    """Return the names of all things and contents that may differ: their objects are not the same in both scenes.

    A new time comes with a new version.
    """
    names = {key.partition(":")[2] for key in _changed(old.versions, new.versions)}
    held = {held.object for scene in (old, new) for held in scene.hands.values()}
    return names | held | _changed(old.things, new.things) | _changed(old.contents, new.contents)


def _changed(old: Mapping[str, object], new: Mapping[str, object]) -> set[str]:
    """Return the keys whose values are not the same object."""
    if old is new:
        return set()
    return {key for key, value in new.items() if old.get(key) is not value} | (old.keys() - new.keys())


def _thing(scene: Scene, thing: Thing) -> Subject:
    key = f"object:{thing.id}"
    facts = [(str(RDF.type), str(ROCO[thing.kind])), (str(ROCO.isInstanceOf), iri(MODEL, thing.model))]
    facts += [(str(ROCO.isOn), iri(THING, thing.on))] if thing.on else []
    facts += [(str(ROCO.isIn), iri(THING, other)) for other in thing.inside]
    if (side := scene.holder(thing.id)) is not None:
        facts.append((str(ROCO.isGraspedBy), str(ROCO[f"{side.value}_hand"])))
        facts.append((str(ROCO.isGraspedWith), iri(GRASP, f"{thing.model}/{scene.hands[side].grasp}")))
    values: tuple[tuple[str, bool | float], ...] = (
        (str(ROCO.isMoveable), thing.moveable),
        (str(ROCO.hasExactPose), thing.exact),
        (str(ROCO.relatedAt), thing.related_at),
    )
    values += () if thing.content is None else ((str(ROCO.contentSeen), thing.content),)
    values += () if thing.uncertainty is None else ((str(ROCO.placeDeviation), thing.uncertainty.deviation),)
    stored = Stored(key, thing=thing)
    return Subject(iri(THING, thing.id), stored, scene.versions.get(key), scene.times.get(key), tuple(facts), values)


def _part(scene: Scene, name: str, stored: Stored, key: str = "") -> Subject:
    key = key or stored.subject
    return Subject(str(ROCO[name]), stored, scene.versions.get(key), scene.times.get(key))


def _content(scene: Scene, source: str, destination: str) -> Subject:
    key = f"content:{source}"
    facts = ((str(RDF.type), str(ROCO.Substance)), (str(ROCO.isIn), iri(THING, destination)))
    stored = Stored(key, content=destination)
    return Subject(iri(CONTENT, source), stored, scene.versions.get(key), scene.times.get(key), facts)


def iri(space: str, name: str) -> str:
    """Return the IRI of something observed; characters that an IRI may not have are percent-encoded."""
    return space + "".join(c if c.isalnum() or c in "-._/" else f"%{ord(c):02X}" for c in name)
