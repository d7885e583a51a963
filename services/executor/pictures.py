"""Pictures of the head camera, and of the robot from the room, as telemetry: a child process makes them when the robot
or a thing has moved.

The child has the lowest priority, so it uses only idle time. One picture is made at a time, at most one in PICTURE_S;
states that come meanwhile are skipped. Nobody waits for a picture. After a child that ends without a first one, as it
does without OpenGL, there are none.
"""

import sys
import time

import msgspec
import numpy as np

from agent_runtime.io.devices import Post
from agent_runtime.io.worker import Worker
from companion.telemetry import PICTURE_S, Picture
from services.executor.local import Array, Setup

ENTRY = "services.executor.picture_process:serve"
NICENESS = 19
STILL = 0.002
"""A coordinate that changed less counts as at rest [rad, m]; estimate: less than a pixel."""
AGAIN_S = 10.0
"""Between pictures at rest, for viewers that were opened meanwhile; estimate."""
SHRINK = 2
"""The robot's picture is smaller by this for people; estimate: 15 kB, and grains in the jar can be told apart."""
LATE_S, PAUSE_S = 60.0, 30.0
"""After LATE_S without an answer the child is killed; the next one starts after PAUSE_S; estimates."""


class Show(msgspec.Struct, frozen=True, tag=True):
    """To the child: make pictures of this state, all coordinates of the world model as float64 bytes -> Picture."""

    sim_time_s: float
    world: bytes


class Pictures:
    """Publishes pictures as telemetry. Call `offer` and `close` from one thread at a time."""

    def __init__(self, post: Post, setup: Setup, *, blind: bool = False) -> None:
        """`blind`: nothing can be drawn here, so no child is started."""
        self._post, self._setup = post, setup
        self._child: Worker | None = None
        self._begin = 0.0  # no child before
        self._asked = -AGAIN_S  # when, by the monotonic clock
        self._drawing = self._proved = False
        self._blind = blind
        self._shown: Array = np.zeros(0)

    def offer(self, sim_time_s: float, world: Array, now: float | None = None) -> bool:
        """Start a picture of the state `world` (nq,) if one is due and no other is being made; return whether it was.

        Never waits. `now`: by the monotonic clock [s].
        """
        now = time.monotonic() if now is None else now
        if self._drawing and now > self._asked + LATE_S:
            self.close()
            self._begin = now + PAUSE_S
        if self._blind or self._drawing or not self._due(world, now) or not self._ready(now):
            return False
        assert self._child is not None
        self._drawing, self._asked, self._shown = True, now, world.copy()
        self._child.tell(Show(sim_time_s, world.tobytes()))
        return True

    def close(self) -> None:
        """Kill the child."""
        if self._child is not None:
            self._child.kill()
        self._child, self._drawing = None, False

    def _due(self, world: Array, now: float) -> bool:
        if world.size == 0 or now < self._asked + PICTURE_S:  # empty: a back-end without a world
            return False
        moved = self._shown.shape != world.shape or bool(np.abs(world - self._shown).max() > STILL)
        return moved or now > self._asked + AGAIN_S

    def _ready(self, now: float) -> bool:
        if self._child is not None and not self._child.alive:
            self.close()
            self._begin = now + PAUSE_S
        if self._child is None and now >= self._begin:
            self._proved = False
            self._child = Worker(ENTRY, answers=Picture, on_message=self._made, on_end=self._ended, nice=NICENESS)
            self._child.tell(self._setup)
        return self._child is not None

    def _made(self, made: Picture) -> None:
        self._drawing, self._proved = False, True
        self._post.publish("telemetry", msgspec.msgpack.encode(made))

    def _ended(self, reason: str) -> None:
        self._drawing, self._blind = False, not self._proved
        if self._blind:
            sys.stderr.write(f"no pictures of the robot: {reason}\n")
