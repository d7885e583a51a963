"""The observed world in a triple store (pyoxigraph), in the terms of O_RoCo, in memory or on disk.

Facts (class, model, relations, who holds what, time of observation) are triples. The numbers of a subject are one
literal (a record): as nodes they would cost ten times as much. `scene` is the same as typed records. A write replaces
all triples of each changed subject, with its version, in one transaction, so after a death the store has an
observation whole or not at all. Only one process can own a store on disk. Must not know:
queries, hypothetical states.
"""

from collections.abc import Iterator
from pathlib import Path

import msgspec
import pyoxigraph as ox
from oxrdflib import OxigraphStore
from rdflib import RDF, Graph
from rdflib.graph import DATASET_DEFAULT_GRAPH_ID

from companion.languages.values import Side
from services.knowledge.ontology import ROCO, read
from services.knowledge.scene import PARTS, Held, Scene, Thing

THING = "urn:robot-companion:thing/"
CONTENT = "urn:robot-companion:content/"
MODEL = "urn:robot-companion:model/"
GRASP = "urn:robot-companion:grasp/"

_RECORD = ox.NamedNode(str(ROCO.record))
_VERSION = ox.NamedNode(str(ROCO.version))
_OBSERVED = ox.NamedNode(str(ROCO.observedAt))


class Stored(msgspec.Struct, frozen=True, omit_defaults=True):
    """The record of a subject: those of these that it has, and its key in the versions."""

    subject: str
    thing: Thing | None = None
    held: Held | None = None
    joints: tuple[float, ...] | None = None
    content: str | None = None


_record = msgspec.json.Encoder()
_stored = msgspec.json.Decoder(Stored)


class Store:
    """A store, made by `Store.open`; `scene` is the observed scene, `write` replaces it."""

    def __init__(self, triples: ox.Store) -> None:
        self._triples = triples
        self._scene = _read(triples)

    @classmethod
    def open(cls, path: Path | None = None) -> "Store":
        """Return the store in the folder `path`, or an empty one in memory. OSError if another process has it open."""
        triples = ox.Store(str(path)) if path is not None else ox.Store()
        if not any(triples.quads_for_pattern(None, None, None)):
            triples.load(read().serialize(format="nt").encode(), format=ox.RdfFormat.N_TRIPLES)
        return cls(triples)

    @property
    def scene(self) -> Scene:
        """Return the observed scene as typed records."""
        return self._scene

    def write(self, scene: Scene) -> None:
        """Replace the observed scene: all that differs, in one transaction."""
        old, new = subjects(self._scene), subjects(scene)
        gone = [quad for key, subject in old.items() if new.get(key) != subject for quad in self._about(subject.node)]
        come = [quad for key, subject in new.items() if old.get(key) != subject for quad in subject.quads()]
        if gone or come:
            self._triples.update(f"DELETE DATA {{ {_lines(gone)} }} ; INSERT DATA {{ {_lines(come)} }}")
        self._scene = scene

    def graph(self) -> Graph:
        """Return ontology and facts as an rdflib graph over the same triples, for export and SPARQL."""
        return Graph(store=OxigraphStore(store=self._triples), identifier=DATASET_DEFAULT_GRAPH_ID)

    def _about(self, node: ox.NamedNode) -> list[ox.Quad]:
        """Return the written triples of a subject; what else stands on a part of the robot is the ontology's."""
        part = node.value.startswith(str(ROCO))
        found = self._triples.quads_for_pattern(node, None, None)
        return [quad for quad in found if not part or quad.predicate in _OF_PARTS]


_OF_PARTS = (_RECORD, _VERSION, _OBSERVED)
"""Predicates that are written on a part of the robot."""


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
        yield ox.Quad(self.node, _RECORD, ox.Literal(_record.encode(self.stored).decode()))
        if self.version is not None:
            yield ox.Quad(self.node, _VERSION, ox.Literal("{}.{}".format(*self.version)))
        if self.time is not None:
            yield ox.Quad(self.node, _OBSERVED, ox.Literal(self.time))
        for predicate, value in self.facts:
            yield ox.Quad(self.node, ox.NamedNode(predicate), ox.NamedNode(value))
        for predicate, number in self.values:
            yield ox.Quad(self.node, ox.NamedNode(predicate), ox.Literal(number))


def subjects(scene: Scene) -> dict[str, Subject]:
    """Return the contents of a scene by subject. Reserved space belongs to a plan and is never observed."""
    found: dict[str, Subject] = {}
    for thing in scene.things.values():
        found[thing.id] = _thing(scene, thing)
    for side, held in scene.hands.items():
        found[f"{side.value} hand"] = _part(scene, f"{side.value}_hand", Stored(f"hand:{side.value}", held=held))
    for part, q in scene.joints.items():
        name = part.removesuffix("_hand") + "_fingers" if part.endswith("_hand") else part
        found[name] = _part(scene, name, Stored(f"body:{part}", joints=q), "body")
    for source, destination in scene.contents.items():
        found[f"content {source}"] = _content(scene, source, destination)
    return found


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


def _lines(quads: list[ox.Quad]) -> str:
    return " ".join(f"{quad.subject} {quad.predicate} {quad.object} ." for quad in quads)


def _text(quad: ox.Quad) -> str:
    """Return the text of a literal."""
    assert isinstance(quad.object, ox.Literal)
    return quad.object.value


def _read(triples: ox.Store) -> Scene:
    """Return the scene that was written last."""
    things: dict[str, Thing] = {}
    hands: dict[Side, Held] = {}
    joints: dict[str, tuple[float, ...]] = {}
    contents: dict[str, str] = {}
    versions: dict[str, tuple[int, int]] = {}
    times: dict[str, float] = {}
    for quad in triples.quads_for_pattern(None, _RECORD, None):
        stored = _stored.decode(_text(quad))
        kind, _, name = stored.subject.partition(":")
        if stored.thing is not None:
            things[name] = stored.thing
        elif stored.held is not None:
            hands[Side(name)] = stored.held
        elif stored.joints is not None:
            joints[name] = stored.joints
        elif stored.content is not None:
            contents[name] = stored.content
        key = "body" if kind == "body" else stored.subject
        for found in triples.quads_for_pattern(quad.subject, _VERSION, None):
            incarnation, _, count = _text(found).partition(".")
            versions[key] = int(incarnation), int(count)
        for found in triples.quads_for_pattern(quad.subject, _OBSERVED, None):
            times[key] = float(_text(found))
    ordered = {part: joints[part] for part in PARTS if part in joints}
    return Scene(things=things, hands=hands, joints=ordered, contents=contents, versions=versions, times=times)
