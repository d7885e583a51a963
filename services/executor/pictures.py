"""Pictures of the head camera, and of the robot from the room, as telemetry: made when the robot or a thing has moved.

The process that renders for the robot's looks makes them, after these. One picture is made at a time, at most one in
PICTURE_S; states that come meanwhile are skipped. Nobody waits for a picture. At rest the last one is told again. After
a process that ends without a first one, as it does without OpenGL, there are none.
"""

import sys
import time
from functools import partial

import msgspec
import numpy as np

from agent_runtime.io.devices import Post
from companion.telemetry import PICTURE_S, Picture
from services.executor.local import Array, Setup
from services.executor.looks import Show
from services.executor.renderer import Renderer
from services.executor.world import scene_of

STILL = 0.002
"""A coordinate that changed less counts as at rest [rad, m]; estimate: less than a pixel."""
AGAIN_S = 10.0
"""Between two times that the last picture is told, for viewers that were opened meanwhile; estimate."""
LATE_S, PAUSE_S = 60.0, 30.0
"""After LATE_S without an answer the process is replaced; then the next picture waits for PAUSE_S; estimates."""


class Pictures:
    """Publishes pictures as telemetry. Call `offer` and `close` from one thread at a time."""

    def __init__(self, post: Post, setup: Setup, *, blind: bool = False) -> None:
        """`blind`: nothing can be drawn here, so no process is started."""
        self._post, self._blind = post, blind
        self.renderer = Renderer(partial(scene_of, setup), self._made, self._ended)
        self._begin = 0.0  # no picture before
        self._asked = self._told = -AGAIN_S  # when, by the monotonic clock
        self._drawing = self._failed = False
        self._shown: Array = np.zeros(0)
        self._last = b""

    def offer(self, sim_time_s: float, world: Array, now: float | None = None) -> bool:
        """Start a picture of the state `world` (nq,) if one is due and no other is being made; return whether it was.

        Never waits. `now`: by the monotonic clock [s].
        """
        now = time.monotonic() if now is None else now
        if self._drawing and now > self._asked + LATE_S:
            self.renderer.again()
            self._failed = True
        if self._failed:
            self._failed = self._drawing = False
            self._begin, self._shown = now + PAUSE_S, np.zeros(0)
        if self._blind or self._drawing or now < self._begin or not self._due(world, now):
            return False
        self._drawing, self._asked, self._shown = True, now, world.copy()
        self.renderer.show(Show(sim_time_s, world.tobytes()))
        return True

    def close(self) -> None:
        """End the process."""
        self.renderer.close()

    def _due(self, world: Array, now: float) -> bool:
        if world.size == 0 or now < self._asked + PICTURE_S:  # empty: a back-end without a world
            return False
        if self._shown.shape != world.shape or bool(np.abs(world - self._shown).max() > STILL):
            return True
        if self._last and now > self._told + AGAIN_S:
            self._tell(now)
        return False

    def _tell(self, now: float) -> None:
        self._told = now
        self._post.publish("telemetry", self._last)

    def _made(self, made: Picture) -> None:
        self._drawing, self._last = False, msgspec.msgpack.encode(made)
        self._tell(self._asked)

    def _ended(self, reason: str) -> None:
        self._failed = True
        if not self._last and not self._blind:
            self._blind = True
            sys.stderr.write(f"no pictures of the robot: {reason}\n")
