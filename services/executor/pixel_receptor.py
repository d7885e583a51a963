"""Eyes by pixels: a child process renders the head camera's picture and reads the markers in it; here one waits for it.

Where the camera is comes from the measured joints and the robot's model, never from the simulator.
"""

from queue import Empty

from agent_runtime.core.errors import WorkerError
from agent_runtime.io.one_reader import OneReaderQueue
from agent_runtime.io.worker import Worker
from services.executor.local import Array
from services.executor.looks import Saw, See, Thing
from services.executor.sight import Neck, Sight
from velma.kinematics.frames import pose_of
from velma.kinematics.robot import Robot
from velma.model.scene import Scene

ENTRY = "services.executor.eye_process:serve"
WITHIN_S, TRIES = 60.0, 2
"""Of a look; a second child is tried. Estimate: the first takes 2 s, or 20 s on a machine with much other work."""


class PixelReceptor:
    """Sees the things of a scene by their markers. Calls come from one thread.

    `wrong`, `off`: as of Saw, of the last look. A new child has no look to compare its first one with.
    """

    def __init__(self, scene: Scene, robot: Robot | None = None) -> None:
        self.wrong, self.off = "", 0.0
        self._scene, self._robot, self._looks = scene, robot or Robot(), 0
        self._answers = OneReaderQueue[Saw | str]()
        self._child = self._new()

    def look(self, world: Array, neck: Neck) -> list[Sight]:
        """Return what the picture of the state `world` (nq,) shows. Raises WorkerError where no child sees, and why."""
        reason = ""
        self._looks += 1
        eye = self._robot.camera(*neck)
        place = tuple(eye.rotation.ravel().tolist()), tuple(eye.translation.tolist())
        for _ in range(TRIES):
            self._child.tell(See(self._looks, world.tobytes(), *place))
            saw = self._answer()
            if isinstance(saw, Saw):
                self.wrong, self.off = saw.wrong, saw.off
                return [_sight(one) for one in saw.things]
            reason = saw
            self._child.kill()
            self._child = self._new()
        raise WorkerError(ENTRY, f"does not see: {reason}", "start with --eyes rays")

    def close(self) -> None:
        """End the child."""
        self._child.kill()

    def _answer(self) -> Saw | str:
        """Return what this look showed, or why the child gives no answer."""
        try:
            while True:
                match self._answers.get(WITHIN_S):
                    case Saw(number=number) as saw if number == self._looks:
                        return saw
                    case str() as reason:
                        return reason
                    case _:  # of a look that was given up
                        continue
        except Empty:
            return f"no answer within {WITHIN_S:g} s"

    def _new(self) -> Worker:
        self._answers = answers = OneReaderQueue[Saw | str]()
        child = Worker(ENTRY, answers=Saw, on_message=answers.put, on_end=answers.put)
        child.tell(self._scene)
        return child


def _sight(one: Thing) -> Sight:
    return Sight(one.name, pose_of(one.rotation, one.position), one.content, one.uncertainty, one.whole)
