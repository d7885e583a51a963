"""The process that renders, as ex has it: its messages, and when it is started, asked and ended.

Light to import: the child needs nothing else of ex.
"""

import threading
import time
from collections.abc import Callable
from queue import Empty

import msgspec
import numpy as np
from numpy.typing import NDArray

from agent_runtime.io.inbox import OneReaderQueue
from agent_runtime.io.worker import Worker
from companion.languages.values import Uncertainty
from companion.telemetry import Camera, Picture
from velma.model.scene import Scene

SHRINK = 2
"""The robot's picture is smaller by this for people; estimate: 15 kB, and grains in the jar can be
told apart.
"""


class Show(msgspec.Struct, frozen=True, tag=True):
    """To the child: make pictures of this state, all coordinates of the world model as float64
    bytes -> Picture; or that of one camera alone, in full size -> Drawn.
    """

    sim_time_s: float
    world: bytes
    camera: Camera | None = None


class Drawn(msgspec.Struct, frozen=True, tag=True):
    """From the child: a picture in full size, as a JPEG file."""

    jpeg: bytes


class See(msgspec.Struct, frozen=True, tag=True):
    """To the child: look at this state (float64 bytes), as look `number`, with the camera thought
    to be there.
    """

    number: int
    world: bytes
    rotation: tuple[float, ...]
    position: tuple[float, ...]


class SightedObject(msgspec.Struct, frozen=True):
    """A thing that was seen: rotation (9 numbers, row by row) and position in the world [m].

    `content`: mass of what is seen in it [kg]; None for a thing that cannot be looked into from
    there. `whole`: of all that is in it, else there may be more. `uncertainty`: of the pose.
    """

    name: str
    rotation: tuple[float, ...]
    position: tuple[float, ...]
    content: float | None = None
    whole: bool = True
    uncertainty: Uncertainty | None = None


class Saw(msgspec.Struct, frozen=True, tag=True):
    """From the child: the things that look `number` showed; none if the camera or the neck's
    encoders are faulty.

    `wrong`: fault of the picture (velma.eyes.health.Wrong), "" for none. `off`: error of torso and
    head [rad], or 0.
    """

    number: int
    things: tuple[SightedObject, ...]
    wrong: str = ""
    off: float = 0.0


class Blind(msgspec.Struct, frozen=True, tag=True):
    """To who asked for a look: no child sees, and why."""

    reason: str


def uncertainty(covariance: NDArray[np.float64]) -> Uncertainty:
    """Return the uncertainty of a pose by its covariance [m, rad].

    It is (4, 4), of x, y, z and the rotation about the vertical, or (6, 6), of x, y, z and the
    rotations about x, y, z.
    """
    xyz = covariance[:3, :3][np.triu_indices(3)]
    turn = covariance[3, 3] if len(covariance) == 4 else covariance[5, 5]
    return Uncertainty(tuple(_short(value) for value in xyz), _short(turn))  # type: ignore[arg-type]


def _short(value: float) -> float:
    return float(f"{value:.4g}")


# --- The process that renders, as the executor has it ---------------------------------------------
# Looks and pictures for people are asked for from any thread; a thread of its own waits for the
# child. A look that gets no answer is asked again of a new child, once. Where the child hangs amid
# a picture, the next look finds out.


ENTRY = "services.executor.renderer_process:serve"
WITHIN_S, TRIES = 60.0, 2
"""Of a look. Estimate: the first takes 2 s, or 20 s on a machine with much other work."""
REST_S = 60.0
"""Without a look or a picture, until the child is ended; estimate: a task rests for less between
its motions.
"""


class Renderer:
    """`scene` makes the scene when the child starts; `seen` and `ended` take its pictures, and why
    it ended.
    """

    def __init__(
        self,
        scene: Callable[[], Scene],
        seen: Callable[[Picture | Drawn], None] = lambda _: None,
        ended: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._scene, self._seen, self._ended = scene, seen, ended
        self._asked = OneReaderQueue[Callable[[], object] | None]()
        self._answers = OneReaderQueue[Saw | str]()
        self._child: Worker | None = None
        self._thread = threading.Thread(target=self._serve, name="renderer", daemon=True)
        self._thread.start()

    @property
    def pid(self) -> int:
        """The child's process; 0: none runs."""
        child = self._child
        return child.pid if child is not None and child.alive else 0

    def look(self, see: See, answer: Callable[[Saw | Blind], None]) -> None:
        """Have it look; `answer` gets what it saw, on another thread. Never waits."""
        self._asked.put(lambda: answer(self._looked(see)))

    def show(self, show: Show) -> None:
        """Have it make a picture for people. Never waits."""
        self._asked.put(lambda: self._running().tell(show))

    def start(self) -> None:
        """Have it ready for a look or a picture, and stay so for REST_S. Never waits."""
        self._asked.put(self._running)

    def again(self) -> None:
        """Have the child replaced when it is needed next. Never waits."""
        self._asked.put(self._end)

    def close(self) -> None:
        """End the child."""
        self._asked.put(None)
        if self._child is not None:
            self._child.kill()  # for the thread may wait for it
        self._thread.join(timeout=1.0)

    # --- the thread -------------------------------------------------------------------------------

    def _serve(self) -> None:
        while True:
            try:
                asked = self._asked.get(REST_S if self._child is not None else None)
            except Empty:
                self._end()
                continue
            if asked is None:
                return self._end()
            asked()

    def _looked(self, see: See) -> Saw | Blind:
        """Return what the child sees, or why none does."""
        reason = ""
        for _ in range(TRIES):
            self._running().tell(see)
            saw = self._answer(see.number)
            if isinstance(saw, Saw):
                return saw
            reason = saw
            self._end()
        return Blind(reason)

    def _answer(self, number: int) -> Saw | str:
        until = time.monotonic() + WITHIN_S
        try:
            while True:
                match self._answers.get(max(0.0, until - time.monotonic())):
                    case Saw() as saw if saw.number == number:
                        return saw
                    case str() as reason:
                        return reason
                    case _:  # of a look that was given up
                        continue
        except Empty:
            return f"no answer within {WITHIN_S:g} s"

    def _running(self) -> Worker:
        if self._child is not None and not self._child.alive:
            self._end()
        if self._child is None:
            self._answers = answers = OneReaderQueue[Saw | str]()

            def heard(word: Saw | Picture | Drawn) -> None:
                answers.put(word) if isinstance(word, Saw) else self._seen(word)

            def over(reason: str) -> None:
                answers.put(reason)
                self._ended(reason)

            answered = Saw | Picture | Drawn
            self._child = Worker(ENTRY, answers=answered, on_message=heard, on_end=over)
            self._child.tell(self._scene())
        return self._child

    def _end(self) -> None:
        if self._child is not None:
            self._child.kill()
        self._child = None
