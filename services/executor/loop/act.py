"""A motion under way: its track, how far the hands are from it, when and how it ends."""

import math

import numpy as np
from numpy.typing import NDArray

from companion.languages.facts import Facts, Kind, fact
from companion.skills.loop_messages import HandReport, Motion, Phase, Report, Until
from services.executor.loop.track import Track
from velma.names import SIDES

Array = NDArray[np.float64]
Verdict = tuple[Phase, Facts]
"""How a motion ends, and why."""

LATE_S = 3.0  # for a joint that follows late; estimate: a light robot (MockBackend) comes within 0.06 rad in 1.3 s
HANDS_S = 120.0  # since the begin; the slowest that may be asked for closes in 25 s, squeezes in 25, waits 60


class Act:
    """One motion from its start to its report. `track` is None as soon as the body has to stay where it is."""

    def __init__(self, motion: Motion, told: Array, began_s: float) -> None:
        """Raise MotionError if the motion does not start near `told` (15,), the last set-point."""
        self.motion, self._began_s = motion, began_s
        self.track: Track | None = Track(motion.path(), told)
        self.cancelled = False
        self._ended_by: Until | None = None
        self._settling_s: float | None = None
        self._late_s: float | None = None
        self._largest = [0.0, 0.0]
        self._below_at_start: float | None = None
        self._look_s = began_s + motion.look_every_s if motion.look_every_s else math.inf

    def cancel(self) -> None:
        """Come to rest along the path."""
        self.cancelled = True
        if self.track is not None:
            self.track.brake()

    def pause(self, paused: bool) -> None:
        """Come to rest along the path, or go on from there. Hands and head go on moving."""
        if self.track is not None:
            self.track.pause() if paused else self.track.resume()

    @property
    def given_way(self) -> bool:
        """Whether it ended because a hand is pulled: that one is beside its set-point."""
        return self._ended_by is Until.PULL

    def look_due(self, now_s: float) -> bool:
        """Whether a look is due. A cancelled motion needs none."""
        return now_s >= self._look_s - 1e-9 and not self.cancelled

    def look_again(self, in_s: float) -> None:
        """Let the next look be due `in_s` [s] after the last one was due."""
        self._look_s += in_s

    def interrupt(self, verdict: Verdict | None) -> Verdict | None:
        """Come to rest along the path; return how it ends, at rest. None before, or while that is unknown."""
        if self.track is not None:
            self.track.brake()
        return verdict if self._at_rest else None

    def judge(
        self, now_s: float, error: Array, *, hands_done: bool, head_done: bool, pulled: bool = False
    ) -> Verdict | None:
        """Return how the motion ends in this cycle and why, or None. `error` (12,): of both hands.

        `pulled`: somebody pulls at what a hand holds out.
        """
        beside = self.beside(error)
        if beside is not None:
            return beside
        if self.cancelled:
            return (Phase.CANCELLED, (fact(Kind.CANCELLED),)) if self._at_rest else None
        if not (hands_done and head_done) and self._at_rest and now_s - self._began_s > HANDS_S:
            return Phase.FAILED, (fact(Kind.NOT_ARRIVED, "head" if hands_done else "hand", HANDS_S),)
        if pulled and self._at_rest:
            self._ended_by = Until.PULL
            return Phase.DONE, ()
        if self._ended_by is None:
            self._ended_by = self._reached(error, hands_done)
            return None
        if not (hands_done and head_done):
            self._settling_s = None
            return None
        if self._settling_s is None:
            self._settling_s = now_s
        return (Phase.DONE, ()) if now_s - self._settling_s >= self.motion.settle_s - 1e-9 else None

    def wait(self, now_s: float, why: Facts) -> Verdict | None:
        """Wait for what is not at the end of the motion; return how it ends if it does not come. `why`: what is off."""
        if self._late_s is None:
            self._late_s = now_s
        if now_s - self._late_s < LATE_S:
            return None
        self.track = None
        return Phase.BLOCKED, why

    @property
    def _at_rest(self) -> bool:
        return self.track is None or self.track.ended

    def beside(self, error: Array) -> Verdict | None:
        """Return the end of a motion that a hand is too far from. `error` (12,): of both hands."""
        values = error.tolist()
        for row, side in enumerate(SIDES):
            distance = math.hypot(*values[6 * row : 6 * row + 3])
            self._largest[row] = max(self._largest[row], distance)
            if distance > self.motion.tolerance_m:
                self.track = None
                return Phase.BLOCKED, (fact(Kind.BESIDE_ITS_PATH, side, distance),)
        return None

    def _reached(self, error: Array, hands_done: bool) -> Until | None:
        """Return the rule that ends the path now, if any."""
        asked = self.motion
        if asked.until is Until.CONTACT:
            below = -error[6 * SIDES.index(asked.contact_side) + 2]
            if self._below_at_start is None:
                self._below_at_start = below  # the error of a load that is not fed forward exactly is not a contact
            if below - self._below_at_start > asked.contact_m:
                self.track = None
                return Until.CONTACT
        if asked.until is Until.TOUCH:
            if hands_done and self.track is not None:
                self.track.brake()
            return Until.TOUCH if hands_done and self._at_rest else None
        return Until.END if self._at_rest else None

    def report(self, phase: Phase, why: Facts, now_s: float, right: HandReport, left: HandReport) -> Report:
        """Return the report of the motion at this time."""
        return Report(
            key=self.motion.key,
            phase=phase,
            why=why,
            ended_by=self._ended_by,
            time_s=now_s - self._began_s,
            right=right,
            left=left,
            largest_error_m=(self._largest[0], self._largest[1]),
        )
