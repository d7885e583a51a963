"""The observed world in a triple store (pyoxigraph), in the terms of O_RoCo, in memory or on disk:
the device of km.

The agent tells the store each observed scene, for SPARQL and export, and never reads it: the
journal is the truth, and after a death the store is made equal to it again.

`scene` is the same as typed records. A write replaces all triples of each changed subject, with its
version, in one transaction, so after a death the store has an observation whole or not at all. Only
one process can own a store on disk. Must not know: queries, hypothetical states.
"""

from pathlib import Path

import msgspec
import pyoxigraph as ox
from rdflib import Graph
from rdflib.graph import DATASET_DEFAULT_GRAPH_ID

from agent_runtime.io.devices import DeviceMaker, Post
from companion.languages.values import Side
from companion.world.scene import PARTS, Held, Scene, SceneObject
from services.knowledge.memory import Mirror
from services.knowledge.subjects import OBSERVED, RECORD, ROCO, VERSION, Stored, differing, text

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
