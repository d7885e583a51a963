"""The device of km: a triple store that is told of each observed scene, for SPARQL and export.

The agent never reads it. The journal is the truth; after a death the store is made equal to it again.
"""

from pathlib import Path

from agent_runtime.io.devices import DeviceMaker, Post
from services.knowledge.memory import Mirror
from services.knowledge.store import Store


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


def at(path: Path | None) -> DeviceMaker:
    """Return what makes the device, its store in the folder `path` or (None) in memory."""

    def make(post: Post) -> StoreDevice:
        return StoreDevice(Store.open(path))

    return make
