"""The simulated world as ex's own processes need it: its scene, its receptor, and the loop in the
same process.

The agent reaches the loop through slots in another process; tests and benchmarks use InProcess.
Both give the skills the same Sensed.
"""

from collections.abc import Callable

import numpy as np

from companion.eyes import Eyes
from companion.languages import rc
from companion.models import KNOWN_AS
from companion.skills.loop_messages import Cancel, LookAgain, Motion, Phase
from companion.skills.performing import Performance
from companion.skills.situation import Eye
from companion.skills.skill import Asked, Sensed
from services.executor.loop.core import LoopCore
from services.executor.receptor import OwnPixelReceptor, Receptor
from velma.model.markers import of_scene
from velma.model.scene import Scene
from velma.names import TORSO, Array
from velma.sim.mujoco_backend import compiled


def model_names(scene: Scene) -> dict[str, str]:
    """Return the model name, as km has it, by id of everything with a marker."""
    return {thing.id: KNOWN_AS.get(thing.model, thing.model) for thing in scene.things}


def markers(scene: Scene) -> dict[str, Array]:
    """Return the corners (n, 4, 3) [m] of the markers of each thing, in its frame."""
    return {
        name: np.array([one.corners for one in every]) for name, every in of_scene(scene).items()
    }


def receptor(scene: Scene, eyes: Eyes = Eyes.RAYS) -> Eye:
    """Return the eyes for a scene, with their own copy of the world."""
    if eyes is Eyes.PIXELS:
        return OwnPixelReceptor(scene)
    return Receptor(compiled(scene), {thing.id: thing.model for thing in scene.things}, scene.noise)


class InProcess:
    """A loop and a receptor in this process, called one after the other."""

    def __init__(self, core: LoopCore, eye: Eye) -> None:
        self.core, self.eye = core, eye

    def perform(self, work: Performance) -> rc.Done | rc.NotDone:
        """Run an act to its outcome."""
        try:
            asked = next(work)
            while True:
                assert isinstance(asked, Motion)
                asked = work.send(self.do(asked, work.send))
        except StopIteration as stop:
            outcome: rc.Done | rc.NotDone = stop.value
            return outcome

    def do(self, motion: Motion, judge: Callable[[Sensed], Asked] | None = None) -> Sensed:
        """Run a motion to its end, then look. `judge` answers the looks at it on the way; None:
        nobody looks.
        """
        self.core.begin(motion)
        while self.core.report.phase is Phase.RUNNING:
            self.cycle()
            if judge is not None and self.core.look_due:
                self.answer(judge(self.sensed()))
        return self.sensed()

    def cycle(self) -> None:
        """Run a cycle of the loop."""
        self.core.cycle()

    def answer(self, word: Asked) -> None:
        """Do what the skill answered to a look."""
        match word:
            case LookAgain():
                self.core.look_again(word.key, word.in_s)
            case Cancel():
                self.core.cancel(word.key)

    def sensed(self) -> Sensed:
        """Return how the last motion ended and what is seen now."""
        report, state = self.core.report, self.core.state
        return Sensed(
            ended=str(report.phase),
            why=report.why,
            q=self.core.setpoint.copy(),
            measured=state.q.copy(),
            touched={"right": report.right.touched, "left": report.left.touched},
            fingers={
                "right": float(np.mean(report.right.proximal)),
                "left": float(np.mean(report.left.proximal)),
            },
            grips={"right": report.right.grip, "left": report.left.grip},
            head=(float(state.head[0]), float(state.head[1])),
            sights=self.eye.look(
                self.core.backend.configuration(), (state.q[TORSO], state.head[0], state.head[1])
            ),
            time=float(state.time),
            wrong=self.eye.wrong,
            off=self.eye.off,
        )
