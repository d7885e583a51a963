"""The scene that a child process of ex is told to make its model of."""

from pathlib import Path

from services.executor.words import Setup
from velma.model import scene


def scene_of(setup: Setup) -> scene.Scene:
    """The scene as the loop has it: from its file or the canonical one, varied by the seed. Raises VelmaError."""
    asked = scene.load(Path(setup.scene)) if setup.scene else scene.load()
    return asked if setup.seed is None else scene.vary(asked, setup.seed)
