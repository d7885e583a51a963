"""The observed world in a triple store (pyoxigraph), in the terms of O_RoCo, in memory or on disk:
the device of km.

The agent tells the store each observed scene, for SPARQL and export, and never reads it: the
journal is the truth, and after a death the store is made equal to it again.

`scene` is the same as typed records. A write replaces all triples of each changed subject, with its
version, in one transaction, so after a death the store has an observation whole or not at all. Only
one process can own a store on disk. Facts (class, model, relations, who holds what, time of
observation) are triples. The numbers of a subject are one literal (a record): as nodes they would
cost ten times as much. Must not know: queries, hypothetical states.
"""

from collections.abc import Mapping, Set
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import msgspec
import pyoxigraph as ox
from rdflib import RDF, RDFS, Graph, Namespace
from rdflib.graph import DATASET_DEFAULT_GRAPH_ID
from rdflib.namespace import OWL

from agent_runtime.io.devices import DeviceMaker, Post
from companion.asking import PREFIXES
from companion.languages.values import Side
from companion.world.scene import PARTS, Held, Scene, SceneObject
from services.knowledge.memory import Mirror

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


# --- the store ------------------------------------------------------------------------------------

_stored = msgspec.json.Decoder(Stored)


class Store:
    """A store, made by `Store.open`; `scene` is the observed scene, `write` replaces it."""

    def __init__(self, triples: ox.Store) -> None:
        self._triples = triples
        self._scene = _read(triples)

    @classmethod
    def open(cls, path: Path | None = None) -> "Store":
        """The store in the folder `path`, or an empty one in memory. Raises OSError if another
        process has it open.
        """
        triples = ox.Store(str(path)) if path is not None else ox.Store()
        if not any(triples.quads_for_pattern(None, None, None)):
            triples.load(text().encode(), format=ox.RdfFormat.TURTLE)
        return cls(triples)

    @property
    def scene(self) -> Scene:
        return self._scene

    def write(self, scene: Scene) -> None:
        """Replace the observed scene: all that differs, in one transaction."""
        before, after = differing(self._scene, scene)
        gone = [quad for subject in before for quad in self._about(subject.node)]
        come = [quad for subject in after for quad in subject.quads]
        if gone or come:
            self._triples.update(
                f"DELETE DATA {{ {_lines(gone)} }} ; INSERT DATA {{ {_lines(come)} }}"
            )
        self._scene = scene

    def graph(self) -> Graph:
        """Ontology and facts as an rdflib graph over the same triples, for export and SPARQL."""
        # Imported here, since rdflib's SPARQL is a third of what km would import at its start.
        from oxrdflib import OxigraphStore

        return Graph(store=OxigraphStore(store=self._triples), identifier=DATASET_DEFAULT_GRAPH_ID)

    def _about(self, node: ox.NamedNode) -> list[ox.Quad]:
        """The written triples of a subject; what else stands on a part of the robot is the
        ontology's.
        """
        part = node.value.startswith(str(ROCO))
        found = self._triples.quads_for_pattern(node, None, None)
        return [quad for quad in found if not part or quad.predicate in _OF_PARTS]


_OF_PARTS = (RECORD, VERSION, OBSERVED)
"""Predicates that are written on a part of the robot."""


def _lines(quads: list[ox.Quad]) -> str:
    return " ".join(f"{quad.subject} {quad.predicate} {quad.object} ." for quad in quads)


def _text(quad: ox.Quad) -> str:
    assert isinstance(quad.object, ox.Literal)
    return quad.object.value


def _read(triples: ox.Store) -> Scene:
    """The scene that was written last."""
    objects: dict[str, SceneObject] = {}
    hands: dict[Side, Held] = {}
    joints: dict[str, tuple[float, ...]] = {}
    contents: dict[str, str] = {}
    versions: dict[str, tuple[int, int]] = {}
    times: dict[str, float] = {}
    for quad in triples.quads_for_pattern(None, RECORD, None):
        stored = _stored.decode(_text(quad))
        kind, _, name = stored.subject.partition(":")
        if stored.object is not None:
            objects[name] = stored.object
        elif stored.held is not None:
            hands[Side(name)] = stored.held
        elif stored.joints is not None:
            joints[name] = stored.joints
        elif stored.content is not None:
            contents[name] = stored.content
        key = "body" if kind == "body" else stored.subject
        for found in triples.quads_for_pattern(quad.subject, VERSION, None):
            incarnation, _, count = _text(found).partition(".")
            versions[key] = int(incarnation), int(count)
        for found in triples.quads_for_pattern(quad.subject, OBSERVED, None):
            times[key] = float(_text(found))
    ordered = {part: joints[part] for part in PARTS if part in joints}
    return Scene(objects, hands, ordered, contents=contents, versions=versions, times=times)


class StoreDevice:
    """A device that writes each observed scene and posts nothing."""

    busy = False

    def __init__(self, store: Store) -> None:
        self.store = store

    def tell(self, content: Mirror) -> None:
        """Make the stored facts those of the scene."""
        self.store.write(content.scene)

    def close(self) -> None:
        """Nothing to close."""


def device_at(path: Path | None) -> DeviceMaker:
    """What makes the device, its store in the folder `path` or (None) in memory."""

    def make(post: Post) -> StoreDevice:
        return StoreDevice(Store.open(path))

    return make
