"""Telemetry of the robot, the sealed truth of the simulation, and pictures: 20 times a second while anything changes.

A thread with its own link to the loop. Only the newest state counts, and nothing waits for it. The truth is passed on
as the loop wrote it; ex does not read it.
"""

import contextlib
import threading
import time
from pathlib import Path

import msgspec

from agent_runtime.io.devices import Post
from companion.skills.loop_messages import Phase
from companion.telemetry import RATE_HZ, Lateness, RobotState
from services.executor.loop.link import AgentLink, LoopState, Timing, Told
from services.executor.pictures import Pictures
from velma.errors import SlotError

STILL_S = 0.5
"""Seconds between two messages while nothing changes. Estimate; below LOOSE_S of companion/tools/report/clock.py."""


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
                self._tell(self._reached())

    def _reached(self) -> AgentLink:
        if self._link is not None and self._link.file.replaced:
            self._link.file.close()
            self._link = None
        if self._link is None:
            self._link = AgentLink(self._path)
        return self._link

    def _tell(self, link: AgentLink) -> None:
        state, told = link.state(), link.told()
        if state is None or not self._news.due(seen(state, told, self.skill), time.monotonic()):
            return
        self._post.publish("telemetry", msgspec.msgpack.encode(robot_state(state, told, link.timing(), self.skill)))
        self._pictures.offer(state.time_s, state.configuration)
        truth = link.sealed_truth()
        if truth:
            self._post.publish("truth", truth)


def seen(state: LoopState, told: Told, skill: str) -> tuple[object, ...]:
    """Return what a viewer would see change: all but the time, the count of cycles and their timing."""
    return state.body, state.hands, state.world, state.mode, state.faults, told, skill


def robot_state(state: LoopState, told: Told, timing: Timing, skill: str) -> RobotState:
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
