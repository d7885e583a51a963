"""Eyes by pixels: a child process renders the head camera's picture and reads the markers in it;
here one waits for it.

Where the camera is comes from the measured joints and the robot's model, never from the simulator.
"""

from collections.abc import Callable

from agent_runtime.core.errors import WorkerError
from agent_runtime.io.inbox import OneReaderQueue
from companion.skills.situation import Neck, Sight
from services.executor.device_messages import Array
from services.executor.eye_messages import Blind, Saw, See, SightedObject
from services.executor.renderer import ENTRY, Renderer
from velma.kinematics.frames import pose_of
from velma.kinematics.robot import Robot
from velma.model.scene import Scene


class PixelReceptor:
    """Sees the things of a scene by their markers. Calls come from one thread.

    `wrong`, `off`: as of Saw, of the last look. A new child has no look to compare its first one
    with.
    """

    def __init__(self, ask: Callable[[See], Saw | Blind], robot: Robot | None = None) -> None:
        """`ask` waits for the answer of the child."""
        self.wrong, self.off = "", 0.0
        self._ask, self._robot, self._looks = ask, robot or Robot(), 0

    def look(self, world: Array, neck: Neck) -> list[Sight]:
        """Return what the picture of the state `world` (nq,) shows. Raises WorkerError where no
        child sees, and why.
        """
        self._looks += 1
        eye = self._robot.camera(*neck)
        place = tuple(eye.rotation.ravel().tolist()), tuple(eye.translation.tolist())
        saw = self._ask(See(self._looks, world.tobytes(), *place))
        if isinstance(saw, Blind):
            raise WorkerError(ENTRY, f"does not see: {saw.reason}", "start with --eyes rays")
        self.wrong, self.off = saw.wrong, saw.off
        return [_sight(one) for one in saw.things]

    def close(self) -> None:
        """Nothing to close: the child is another's."""


def _sight(one: SightedObject) -> Sight:
    pose = pose_of(one.rotation, one.position)
    return Sight(one.name, pose, one.content, one.uncertainty, one.whole)


class OwnPixelReceptor(PixelReceptor):
    """Eyes by pixels with a child of their own."""

    def __init__(self, scene: Scene) -> None:
        self.renderer, self._answers = Renderer(lambda: scene), OneReaderQueue[Saw | Blind]()
        super().__init__(self._answered)

    def close(self) -> None:
        """End the child."""
        self.renderer.close()

    def _answered(self, see: See) -> Saw | Blind:
        self.renderer.look(see, self._answers.put)
        return self._answers.get()
