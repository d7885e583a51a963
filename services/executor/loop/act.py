"""A motion under way: its track, how far the hands are from it, when and how it ends."""

import math

import numpy as np

from companion.languages.facts import Facts, Kind, fact
from companion.skills.loop_messages import KNOT_S, HandReport, Motion, Phase, Report, Until
from velma.errors import MotionError
from velma.names import BODY, SIDES, Array

# --- A timed trajectory followed at a rate that may fall to zero: position and velocity set-points
# for each cycle Between knots the position is linear and the velocity is the central difference.
# The first knots are blended with the set-point before, so that set-points never jump.


# time in which a motion comes to rest along its path, or starts again; estimate: 0.35 m/s over 5 cm
BRAKE_S = 0.3
BLEND_S = 0.3
# rad: the largest difference that is blended; a hand is then at most 4 cm beside its path
FARTHEST_START = 0.05


class Track:
    """The set-points of the body over time."""

    def __init__(self, knots: Array, told: Array) -> None:
        """Raise MotionError if the knots (n, 15) do not start near `told` (15,), the last
        set-point.
        """
        self._knots, self._offset = knots, told - knots[0]
        worst = int(np.argmax(np.abs(self._offset)))
        if not abs(self._offset[worst]) <= FARTHEST_START:
            found = f"{abs(self._offset[worst]):.3f} rad from the set-point in {BODY[worst]}"
            raise MotionError(
                "first knot", found, f"within {FARTHEST_START} rad: start at the reported set-point"
            )
        self.duration = (len(knots) - 1) * KNOT_S
        self._time, self._since, self._rate, self._wanted, self._braked = 0.0, 0.0, 1.0, 1.0, False
        self.q, self.v = told.copy(), np.zeros_like(told)

    @property
    def ended(self) -> bool:
        """Whether it rests for good: at its last knot, or where it was braked."""
        at_end = self._time >= self.duration and not self._offset.any()
        return at_end or (self._braked and self._rate == 0.0)

    def brake(self) -> None:
        """Come to rest along the path, for good."""
        self._braked, self._wanted = True, 0.0

    def pause(self) -> None:
        """Come to rest along the path, until `resume`."""
        self._wanted = 0.0

    def resume(self) -> None:
        """Go on from where it was paused. No effect on a braked track."""
        self._wanted = 0.0 if self._braked else 1.0

    def advance(self, dt: float) -> None:
        """Advance by dt [s]; `q` and `v` (15,) are the new set-points."""
        if self._rate != self._wanted:
            change = dt / BRAKE_S
            self._rate = min(max(self._wanted, self._rate - change), self._rate + change)
        self._time = min(self.duration, self._time + self._rate * dt)
        self._since += self._rate * dt
        self._sample()
        if self._offset.any():
            self._blend()

    def _sample(self) -> None:
        knots, last = self._knots, len(self._knots) - 1
        k = min(int(self._time / KNOT_S), last)
        u = self._time / KNOT_S - k
        a, b = knots[k], knots[min(k + 1, last)]
        self.q = a + u * (b - a)
        if self._time >= self.duration:
            self.v = np.zeros_like(a)
            return
        before, after = knots[max(k - 1, 0)], knots[min(k + 2, last)]
        # One-sided at the ends, where the trajectory is at rest anyway.
        v = (1 - u) * (b - before) + u * (after - a)
        self.v = v * (self._rate / (2 * KNOT_S))

    def _blend(self) -> None:
        s = self._since / BLEND_S
        if s >= 1.0:
            self._offset = np.zeros_like(self._offset)
            return
        left = 1.0 - s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
        self.q = self.q + left * self._offset
        self.v = self.v - (30.0 * s * s * (1.0 - s) ** 2 / BLEND_S * self._rate) * self._offset


# --- A motion under way ---------------------------------------------------------------------------


Verdict = tuple[Phase, Facts]
"""How a motion ends, and why."""

# for a joint that follows late; estimate: a light robot (MockBackend) comes within 0.06 rad in 1.3
# s
LATE_S = 3.0
# since the begin; the slowest that may be asked for closes in 25 s, squeezes in 25, waits 60
HANDS_S = 120.0


class RunningMotion:
    """One motion from its start to its report. `track` is None as soon as the body has to stay
    where it is.
    """

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
        """Come to rest along the path; return how it ends, at rest. None before, or while that is
        unknown.
        """
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
            return Phase.FAILED, (
                fact(Kind.NOT_ARRIVED, "head" if hands_done else "hand", HANDS_S),
            )
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
        """Wait for what is not at the end of the motion; return how it ends if it does not come.
        `why`: what is off.
        """
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
                # the error of a load that is not fed forward exactly is not a contact
                self._below_at_start = below
            if below - self._below_at_start > asked.contact_m:
                self.track = None
                return Until.CONTACT
        if asked.until is Until.TOUCH:
            if hands_done and self.track is not None:
                self.track.brake()
            return Until.TOUCH if hands_done and self._at_rest else None
        return Until.END if self._at_rest else None

    def report(
        self, phase: Phase, why: Facts, now_s: float, right: HandReport, left: HandReport
    ) -> Report:
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
