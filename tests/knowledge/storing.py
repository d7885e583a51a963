"""Observations put into a store, as km does when it saves its memory."""

from companion.world.observe import observed
from services.knowledge.answers import ask
from services.knowledge.memory import Overlays


def store_observation(store, observation, version, now=0.0):
    """Store an observation and its version in one transaction; return False if the store is as new
    or newer.
    """
    scene = observed(store.scene, observation, version, now)
    if scene is store.scene:
        return False
    store.write(scene)
    return True


def answer(store, query, overlays=None):
    """The answer from the store and the hypothetical states; neither changes."""
    return ask(store.scene, overlays or Overlays(), query)[1]
