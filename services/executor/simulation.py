"""The simulated world as ex's own processes need it: its scene and its receptor."""

from pathlib import Path

from services.executor.local import Setup
from services.executor.receptor import Receptor
from velma.model import scene as scenes
from velma.model.scene import Model, Scene
from velma.sim.mujoco_backend import compiled

# What a marker tells: the models of the scene under the names that km uses.
KNOWN_AS = {Model.JAR: "jar", Model.BOWL: "bowl_high", Model.CABINET: "cabinet_no_door", Model.TABLE: "table"}


def scene_of(setup: Setup) -> Scene:
    """Return the scene of the loop: from its file or the canonical one, varied by the seed. Raises VelmaError."""
    asked = scenes.load(Path(setup.scene)) if setup.scene else scenes.load()
    return asked if setup.seed is None else scenes.vary(asked, setup.seed)


def things(scene: Scene) -> dict[str, str]:
    """Return the model name by id of everything with a marker."""
    return {thing.id: KNOWN_AS[thing.model] for thing in scene.things}


def receptor(scene: Scene) -> Receptor:
    """Return the receptor of a scene, with its own copy of the world."""
    return Receptor(compiled(scene), tuple(t.id for t in scene.things), scene.noise.position, scene.noise.seed)
