"""Telemetry of the robot, the sealed truth of the simulation, and pictures: 20 times a second while
anything changes.

A thread with its own link to the loop. Only the newest state counts, and nothing waits for it. The
truth is passed on as the loop wrote it; ex does not read it.
"""

import contextlib
import sys
import threading
import time
from functools import partial
from pathlib import Path

import msgspec
import numpy as np

from agent_runtime.io.devices import Post
from companion.skills.loop_messages import Phase
from companion.telemetry import PICTURE_S, RATE_HZ, Lateness, Picture, RobotState
from services.executor.device_messages import Setup, scene_of
from services.executor.loop.link import AgentLink, LoopAnswer, LoopState, Timing, reopened
from services.executor.renderer import Renderer, Show
from velma.errors import SlotError
from velma.names import Array

# --- Pictures of the head camera, and of the robot from the room, as telemetry --------------------
# They are made when the robot or a thing has moved, by the process that renders for the robot's
# looks, after the looks. One picture is made at a time, at most one in PICTURE_S; states that come
# meanwhile are skipped. Nobody waits for a picture. At rest the last one is told again. After a
# process that ends without a first one, as it does without OpenGL, there are none.


STILL = 0.002
"""A coordinate that changed less counts as at rest [rad, m]; estimate: less than a pixel."""
AGAIN_S = 10.0
"""Between two times that the last picture is told, for viewers that were opened meanwhile;
estimate.
"""
LATE_S, PAUSE_S = 60.0, 30.0
"""After LATE_S without an answer the process is replaced; then the next picture waits for PAUSE_S;
estimates.
"""


class Pictures:
    """Publishes pictures as telemetry. Call `offer` and `close` from one thread at a time."""

    def __init__(self, post: Post, setup: Setup) -> None:
        self._post, self._blind = post, False
        self.renderer = Renderer(partial(scene_of, setup), self._made, self._ended)
        self._begin = 0.0  # no picture before
        self._asked = self._told = -AGAIN_S  # when, by the monotonic clock
        self._drawing = self._failed = False
        self._shown: Array = np.zeros(0)
        self._last = b""

    def offer(self, sim_time_s: float, world: Array, now: float | None = None) -> bool:
        """Start a picture of the state `world` (nq,) if one is due and no other is being made;
        return whether it was.

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


# --- Telemetry of the robot, the sealed truth of the simulation, and pictures ---------------------


STILL_S = 0.5
"""Seconds between two messages while nothing changes. Estimate; below LOOSE_S of
companion/tools/telemetry.py.
"""


class News:
    """Whether something is to be told: at once if it has changed, else every `still_s` [s]."""

    def __init__(self, still_s: float = STILL_S) -> None:
        self._still_s, self._due = still_s, 0.0
        self._told: tuple[object, ...] = ()

    def due(self, seen: tuple[object, ...], now: float) -> bool:
        """Whether `seen` is to be told now [s, monotonic]; if so, it is noted as told."""
        if seen == self._told and now < self._due:
            return False
        self._told, self._due = seen, now + self._still_s
        return True


class Telemetry:
    """`skill`: the name of the act under way; set by the device that hands acts out."""

    def __init__(self, post: Post, path: Path, pictures: Pictures) -> None:
        self.skill = ""
        self._post, self._path, self._pictures = post, path, pictures
        self._link: AgentLink | None = None
        self._news = News()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="telemetry", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread."""
        self._over.set()
        self._thread.join(timeout=1.0)
        self._pictures.close()

    def _serve(self) -> None:
        while not self._over.wait(1.0 / RATE_HZ):
            with contextlib.suppress(SlotError):  # no loop at present
                self._link = reopened(self._link, self._path)
                self._tell(self._link)

    def _tell(self, link: AgentLink) -> None:
        state, told = link.state(), link.told()
        if state is None or not self._news.due(seen(state, told, self.skill), time.monotonic()):
            return
        self._post.publish(
            "telemetry", msgspec.msgpack.encode(robot_state(state, told, link.timing(), self.skill))
        )
        self._pictures.offer(state.time_s, state.configuration)
        truth = link.sealed_truth()
        if truth:
            self._post.publish("truth", truth)


def seen(state: LoopState, told: LoopAnswer, skill: str) -> tuple[object, ...]:
    """Return what a viewer would see change: all but the time, the count of cycles and their
    timing.
    """
    return state.body, state.hands, state.world, state.mode, state.faults, told, skill


def robot_state(state: LoopState, told: LoopAnswer, timing: Timing, skill: str) -> RobotState:
    """Return the state of the loop as telemetry."""
    acting = told.report.phase is Phase.RUNNING
    (right, right_distal), (left, left_distal) = state.fingers(0), state.fingers(1)
    return RobotState(
        sim_time_s=state.time_s,
        body=tuple(float(x) for x in state.q),
        head=(float(state.head[0]), float(state.head[1])),
        proximal=tuple(float(x) for x in (*right, *left)),
        distal=tuple(float(x) for x in (*right_distal, *left_distal)),
        mode=str(state.mode),
        act=told.report.key if acting else "",
        skill=skill if acting else "",
        work_J=state.work_J,
        cycles=state.cycles,
        missed=timing.missed,
        skipped=timing.skipped,
        lateness_us=_figures(timing.lateness_us),
        compute_us=_figures(timing.compute_us),
        realtime=timing.realtime,
        faults=state.faults,
        last_fault=state.last_fault,
        saturated=state.saturated,
        page_faults=timing.page_faults,
    )


def _figures(us: dict[str, float]) -> Lateness:
    """Return the figures, 0 where nothing was counted."""
    return Lateness(**{name: us.get(name, 0.0) for name in ("p50", "p99", "p999", "max")})
