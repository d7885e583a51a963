"""The scene of the simulated world, for child processes of ex: light to import, since some have the lowest priority."""

from pathlib import Path

from services.executor.local import Setup
from velma.model import scene as scenes
from velma.model.scene import Scene


def scene_of(setup: Setup) -> Scene:
    """Return the scene of the loop: from its file or the canonical one, varied by the seed. Raises VelmaError."""
    asked = scenes.load(Path(setup.scene)) if setup.scene else scenes.load()
    return scenes.vary(asked, setup.seed)
