"""The triple store beside a_km: it is told of each observed scene and holds the same as facts, for SPARQL and export.

Never read by the agent: the journal is the truth, and after a death the store is made equal to it again.
"""

from pathlib import Path

from agent_runtime.io.devices import DeviceMaker, Post
from services.knowledge.behaviours import Mirror
from services.knowledge.store import Store


class TripleStore:
    """A device that writes what it is told and posts nothing."""

    busy = False

    def __init__(self, store: Store) -> None:
        self.store = store

    def tell(self, content: Mirror) -> None:
        """Make the stored facts those of the scene."""
        self.store.write(content.scene)

    def close(self) -> None:
        """Nothing to close."""


def at(path: Path | None) -> DeviceMaker:
    """Makes the store in the folder `path`, or in memory."""

    def make(post: Post) -> TripleStore:
        return TripleStore(Store.open(path))

    return make
