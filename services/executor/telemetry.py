"""Telemetry of the robot, the sealed truth of the simulation, and pictures: 20 times a second while
anything changes. Frames for a page: while somebody watches.

A thread with its own link to the loop. Only the newest state counts, and nothing waits for it. The
truth is passed on as the loop wrote it; ex does not read it.
"""

import contextlib
import math
import sys
import threading
import time
from functools import partial
from pathlib import Path

import msgspec
import numpy as np

from agent_runtime.io.devices import Post
from companion.skills.loop_messages import Phase
from companion.telemetry import (
    ASK_S,
    FRAME_S,
    PICTURE_S,
    RATE_HZ,
    WATCHED_S,
    Camera,
    Frame,
    Lateness,
    Picture,
    RobotState,
    Watch,
)
from services.executor.device_messages import Setup, scene_of
from services.executor.loop.link import AgentLink, LoopAnswer, LoopState, Timing, reopened
from services.executor.renderer import Drawn, Renderer, Show
from velma.errors import SlotError
from velma.names import Array

STILL = 0.002
"""A coordinate that changed less counts as at rest [rad, m]; estimate: less than a pixel."""


def moved(world: Array, before: Array) -> bool:
    """Whether a picture of the state `world` (nq,) would show more than one of the state before."""
    return before.shape != world.shape or bool(np.abs(world - before).max() > STILL)


# --- Frames for a page in which people watch ------------------------------------------------------
# A page says each second that somebody watches, and which frames it has. As long as it does, the
# picture that is large in a browser is made as often as FRAME_S says, of the other camera there is
# what is made for recorders. A frame that was lost is told again. At rest no picture is made: a few
# bytes say that the last one is still true, so that a page can show how old a picture is.

WATCH, FRAME, PAGE = "watch", "frame", "page"
"""Kinds of signals of the design, and who watches."""
LOST_S = ASK_S + 0.5
"""A page that does not have a frame so long after it was told has lost it; estimate: its next word
takes ASK_S and some milliseconds.
"""


class Shot(msgspec.Struct, frozen=True):
    """The newest picture of a camera: of the state `world`, as it was `at` [s, monotonic]; `full`:
    it has full size.
    """

    number: int
    at: float
    world: Array
    jpeg: bytes
    full: bool


class Frames:
    """Tells a page the newest picture of each camera. Times are of the monotonic clock [s]."""

    def __init__(self, post: Post) -> None:
        self._post, self._lock = post, threading.Lock()
        self._fresh: Watch | None = None  # came since `wanted` was asked last
        self._watch, self._until = Watch(), -math.inf
        self._shots: dict[Camera, Shot] = {}
        self._begun: dict[Camera, float] = {}
        # when the file of a camera was told, and when it was said to be true
        self._told: dict[Camera, float] = {}
        self._true: dict[Camera, float] = {}
        self._count = time.time_ns()  # numbers of an agent that died are none of this one's
        post.hear(WATCH, self._asked)

    def _asked(self, data: bytes) -> None:
        with contextlib.suppress(msgspec.MsgspecError):
            self._fresh = msgspec.msgpack.decode(data, type=Watch)

    def watched(self, now: float) -> bool:
        """Whether somebody watches."""
        fresh, self._fresh = self._fresh, None
        if fresh is not None:
            self._watch, self._until = fresh, now + WATCHED_S
        return now < self._until

    def due(self, world: Array, now: float) -> Camera | None:
        """The camera that is to be drawn in full size now; noted as begun."""
        waits = [
            (self._begun.get(camera, -math.inf), camera)
            for camera in self._watch.large
            if now < self._until and self._old(camera, world)
        ]
        begun, camera = min(waits, default=(math.inf, None))
        if camera is None or now < begun + FRAME_S:
            return None
        self._begun[camera] = now
        return camera

    def _old(self, camera: Camera, world: Array) -> bool:
        shot = self._shots.get(camera)
        return shot is None or not shot.full or moved(world, shot.world)

    def take(self, camera: Camera, jpeg: bytes, world: Array, at: float, now: float) -> None:
        """Keep a picture in full size, and tell it to who watches."""
        self._take(camera, jpeg, world, at, now, full=True)

    def take_small(self, picture: Picture, world: Array, at: float, now: float) -> None:
        """Keep pictures of telemetry for cameras that nobody has large."""
        for camera, jpeg in ((Camera.HEAD, picture.jpeg), (Camera.ROOM, picture.room)):
            if now >= self._until or camera not in self._watch.large:
                self._take(camera, jpeg, world, at, now, full=False)

    def _take(
        self, camera: Camera, jpeg: bytes, world: Array, at: float, now: float, *, full: bool
    ) -> None:
        with self._lock:
            self._count += 1
            self._shots[camera] = shot = Shot(self._count, at, world, jpeg, full)
            if now < self._until:
                self._tell(camera, shot, now, now - at)

    def look(self, world: Array, now: float) -> None:
        """Tell what was lost again, and what is still true of the state `world` (nq,)."""
        with self._lock:
            for camera, shot in self._shots.items() if now < self._until else ():
                still = not moved(world, shot.world)
                if self._watch.had.get(camera) != shot.number:
                    if now > self._told.get(camera, -math.inf) + LOST_S:
                        self._tell(camera, shot, now, 0.0 if still else now - shot.at)
                elif still and now > self._true.get(camera, 0.0) + PICTURE_S - 1.0 / RATE_HZ:
                    self._true[camera] = now
                    self._publish(Frame(camera, shot.number, 0.0))

    def _tell(self, camera: Camera, shot: Shot, now: float, age_s: float) -> None:
        self._told[camera] = self._true[camera] = now
        self._publish(Frame(camera, shot.number, age_s, shot.jpeg))

    def _publish(self, frame: Frame) -> None:
        self._post.publish(FRAME, msgspec.msgpack.encode(frame), PAGE)


# --- Pictures of the head camera, and of the robot from the room, as telemetry --------------------
# They are made when the robot or a thing has moved, by the process that renders for the robot's
# looks, after the looks. One picture is made at a time, at most one in PICTURE_S, and one frame,
# which the process draws between the parts of the picture; states that come meanwhile are skipped.
# Nobody waits for a picture. At rest the last one is told again. After a process that ends without
# a first one, as it does without OpenGL, there are none. While somebody watches, the process is
# kept: a first picture would wait for its start.


AGAIN_S = 10.0
"""Between two times that the last picture is told, for viewers that were opened meanwhile;
estimate.
"""
LATE_S, PAUSE_S = 60.0, 30.0
"""After LATE_S without an answer the process is replaced; then the next picture waits for PAUSE_S;
estimates.
"""


class Begun(msgspec.Struct, frozen=True):
    """What is being drawn: of which state, since when by the clock of `offer`, and by this
    process's own [s].
    """

    world: Array
    at: float
    began: float

    @property
    def now(self) -> float:
        """What the clock of `offer` shows."""
        return self.at + time.monotonic() - self.began


class Pictures:
    """Publishes pictures as telemetry, and frames. Call `offer` and `close` from one thread at a
    time.
    """

    def __init__(self, post: Post, setup: Setup) -> None:
        self._post, self._blind = post, False
        self._frames = Frames(post)
        self.renderer = Renderer(partial(scene_of, setup), self._made, self._ended)
        self._begin = 0.0  # no picture before
        self._asked = self._told = -AGAIN_S  # when, by the monotonic clock
        self._failed = False
        self._shown: Array = np.zeros(0)
        self._last = b""
        self._kept = -math.inf  # when the process was asked to stay
        # what is drawn now, and the frame's camera
        self._picture: Begun | None = None
        self._frame: Begun | None = None
        self._camera = Camera.ROOM

    def offer(self, sim_time_s: float, world: Array, now: float | None = None) -> bool:
        """Start a picture or a frame of the state `world` (nq,) if one is due and no other is being
        made; return whether it was.

        Never waits. `now`: by the monotonic clock [s].
        """
        now = time.monotonic() if now is None else now
        if any(one is not None and now > one.at + LATE_S for one in (self._picture, self._frame)):
            self.renderer.again()
            self._failed = True
        if self._failed:
            self._failed, self._picture, self._frame = False, None, None
            self._begin, self._shown = now + PAUSE_S, np.zeros(0)
        watched = self._frames.watched(now)
        self._frames.look(world, now)
        # empty: a back-end without a world
        if self._blind or now < self._begin or world.size == 0:
            return False
        if watched and now > self._kept + PICTURE_S:
            self._kept = now
            self.renderer.start()
        begun = Begun(world.copy(), now, time.monotonic())
        camera = self._frames.due(world, now) if self._frame is None else None
        if camera is not None:
            self._frame, self._camera = begun, camera
            self.renderer.show(Show(sim_time_s, world.tobytes(), camera))
        if self._picture is not None or not self._due(world, now):
            return camera is not None
        self._picture, self._asked, self._shown = begun, now, begun.world
        self.renderer.show(Show(sim_time_s, world.tobytes()))
        return True

    def close(self) -> None:
        """End the process."""
        self.renderer.close()

    def _due(self, world: Array, now: float) -> bool:
        if now < self._asked + PICTURE_S:
            return False
        if moved(world, self._shown):
            return True
        if self._last and now > self._told + AGAIN_S:
            self._tell(now)
        return False

    def _tell(self, now: float) -> None:
        self._told = now
        self._post.publish("telemetry", self._last)

    def _made(self, made: Picture | Drawn) -> None:
        if isinstance(made, Drawn):
            if (begun := self._frame) is not None:
                self._frames.take(self._camera, made.jpeg, begun.world, begun.at, begun.now)
            self._frame = None
        else:
            self._last = msgspec.msgpack.encode(made)
            if (begun := self._picture) is not None:
                self._frames.take_small(made, begun.world, begun.at, begun.now)
            self._tell(self._asked)
            self._picture = None

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
