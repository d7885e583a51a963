"""Virtual effectors and receptors of ex over a loop in the same process: a motion in, what was sensed out.

The agent reaches the loop through slots in another process; tests and the one-process runs use this. Both give the
skills the same Sensed.
"""

import numpy as np

from services.executor.loop.core import LoopCore
from services.executor.loop.program import Motion
from services.executor.receptor import Receptor
from services.executor.skills.skill import Sensed
from velma.model.scene import Model, Scene
from velma.sim.mujoco_backend import compiled

# What a marker says about its thing: the scene's models under the names km knows them by.
KNOWN_AS = {Model.JAR: "jar", Model.BOWL: "bowl_high", Model.CABINET: "cabinet_no_door", Model.TABLE: "table"}


def things(scene: Scene) -> dict[str, str]:
    """Model name by id of everything that carries a marker."""
    return {thing.id: KNOWN_AS[thing.model] for thing in scene.things}


def receptor(scene: Scene) -> Receptor:
    """The head camera in a scene, with a mirror of its own."""
    return Receptor(compiled(scene), tuple(t.id for t in scene.things), scene.noise.position, scene.noise.seed)


class InProcess:
    """A loop and a receptor, called one after the other."""

    def __init__(self, core: LoopCore, eye: Receptor) -> None:
        self.core, self.eye = core, eye

    def do(self, motion: Motion) -> Sensed:
        """Run a motion to its end, then look."""
        self.core.run(motion)
        return self.sensed()

    def sensed(self) -> Sensed:
        """How the last motion ended and what is seen now."""
        report, state = self.core.report, self.core.state
        return Sensed(
            ended=str(report.phase),
            reason=report.reason,
            q=self.core.setpoint.copy(),
            measured=state.q.copy(),
            touched={"right": report.right.touched, "left": report.left.touched},
            fingers={"right": float(np.mean(report.right.proximal)), "left": float(np.mean(report.left.proximal))},
            head=(float(state.head[0]), float(state.head[1])),
            sights=self.eye.look(self.core.backend.configuration()),
            time=float(state.time),
        )
