"""Observations put into a store, as km does when it saves its memory."""

from companion.languages import wm
from companion.world.observe import Version, observed
from services.knowledge.answers import ask
from services.knowledge.overlays import Overlays
from services.knowledge.store import Store


def store_observation(
    store: Store, observation: wm.AnySight, version: Version, now: float = 0.0
) -> bool:
    """Store an observation and its version in one transaction; return False if the store is as new
    or newer.
    """
    scene = observed(store.scene, observation, version, now)
    if scene is store.scene:
        return False
    store.write(scene)
    return True


def answer(store: Store, query: wm.AnyQuery, overlays: Overlays | None = None) -> wm.AnyAnswer:
    """The answer from the store and the hypothetical states; neither changes."""
    return ask(store.scene, overlays or Overlays(), query)[1]
