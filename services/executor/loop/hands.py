"""Both hands as the loop drives them (motor travels, closing by touch, squeeze, lock; the law is
velma.control.joint) and as the wrists feel them.
"""

from enum import StrEnum

import numpy as np

from companion.languages.facts import Kind, fact
from companion.skills.loop_messages import (
    Close,
    GripReport,
    HandCommand,
    HandReport,
    Motion,
    Move,
    Open,
    Payload,
    Phase,
    Until,
)
from services.executor.loop.act import Verdict
from velma.control import grip, joint
from velma.control.cartesian import GRAVITY
from velma.control.dynamics import Terms
from velma.control.grip import Grip, Health, Pull, Watch
from velma.control.safety import within
from velma.errors import MotionError
from velma.names import FINGER_UPPER, SIDES, Array
from velma.sim.backend import PAIR_LIMIT, SINGLE_LIMIT, Command, State

LOCK_S = 0.1  # until the gears take the load; estimate
SPREAD_SPEED = 0.7  # rad/s, barrett_hand's default
STALL_CYCLES = 25  # a motor that stood still this long has reached its limit; estimate


class Activity(StrEnum):
    """The activity of a hand."""

    REST = "rest"
    MOVING = "moving"
    CLOSING = "closing"
    SQUEEZING = "squeezing"
    LOCKING = "locking"


class Fingers:
    """The motors of both hands. Rows: right, left; fingers one, two, three."""

    def __init__(self) -> None:
        self.motor, self._goal, self._speed = np.zeros((2, 3)), np.zeros((2, 3)), np.ones((2, 3))
        self.spread, self._spread_goal = np.zeros(2), np.zeros(2)
        self.locked = np.zeros(2)
        self.touched = np.zeros((2, 3), dtype=bool)
        self._pushing = np.zeros((2, 3), dtype=np.intp)
        self._stalling = np.zeros((2, 3), dtype=np.intp)
        self._activity = [Activity.REST, Activity.REST]
        self._closing: list[Close | None] = [None, None]
        self._left_s = [0.0, 0.0]
        self._limit = np.array([[PAIR_LIMIT, PAIR_LIMIT, SINGLE_LIMIT]] * 2)
        # at rest, the motors at their goals, and all this in the last command
        self._settled = False

    def start_from(self, state: State) -> None:
        """Take the measured hands as set-points."""
        self.motor[:] = self._goal[:] = np.clip(state.proximal, 0.0, FINGER_UPPER)
        self.spread[:] = self._spread_goal[:] = state.spread

    def start_at(self, command: Command) -> None:
        """Take the set-points and locks of a command."""
        self.motor[:] = self._goal[:] = command.proximal
        self.spread[:] = self._spread_goal[:] = command.spread
        self.locked[:] = command.locked

    def check(self, row: int, command: HandCommand) -> None:
        """Raise MotionError if this hand cannot do that now."""
        if isinstance(command, Move | Close) and self.locked[row]:
            raise MotionError(
                f"{SIDES[row]} hand", f"locked, asked to {type(command).__name__}", "an Open before"
            )

    def begin(self, row: int, command: HandCommand) -> None:
        """Start what `check` allowed."""
        self._settled = False
        self._stalling[row] = self._pushing[row] = 0
        match command:
            case Move():
                self._goal[row] = command.fingers
                self._spread_goal[row] = command.spread
                self._speed[row], self._activity[row] = command.speed, Activity.MOVING
            case Close():
                self.touched[row] = False
                self._goal[row] = command.upto
                self._speed[row], self._activity[row] = command.speed, Activity.CLOSING
                self._closing[row] = command
            case Open():
                self.locked[row] = 0.0
                self.touched[row] = False
                self._goal[row] = np.clip(self.motor[row] - command.by, 0.0, None)
                self._speed[row], self._activity[row] = command.speed, Activity.MOVING

    def freeze(self) -> None:
        """Stop all motors; locks stay."""
        self._goal[:], self._spread_goal[:] = self.motor, self.spread
        self._activity = [Activity.REST, Activity.REST]

    @property
    def at_rest(self) -> bool:
        """Whether both hands have done what they were told."""
        return self._activity[0] is Activity.REST and self._activity[1] is Activity.REST

    def update(self, state: State, command: Command, dt: float) -> None:
        """Run one cycle: detect touch, move the motors, write servo targets and locks into
        `command`.

        `command` is that of the cycle before.
        """
        if not self._settled:
            self._drive(state, command, dt)
        command.distal[:] = joint.distal_target(self.motor, state.proximal)

    def _drive(self, state: State, command: Command, dt: float) -> None:
        stall = joint.stalled(self.motor, state.proximal, state.distal, self._limit)
        self._stalling = np.where(stall, self._stalling + 1, 0)
        for row in (0, 1):
            if self._activity[row] is not Activity.REST:
                self._go_on(row, state, dt)
        self.motor = joint.advance_fingers(self.motor, self._goal, self._speed, stall, dt)
        reach = SPREAD_SPEED * dt
        self.spread += within(self._spread_goal - self.spread, -reach, reach)
        command.spread[:] = self.spread
        command.proximal[:] = self.motor
        command.locked[:] = self.locked
        arrived = (self.motor == self._goal).all() and (self.spread == self._spread_goal).all()
        self._settled = self.at_rest and bool(arrived)

    def _go_on(self, row: int, state: State, dt: float) -> None:
        arrived = (self.motor[row] == self._goal[row]) | (self._stalling[row] > STALL_CYCLES)
        close = self._closing[row]
        if self._activity[row] is Activity.MOVING or close is None:
            if arrived.all() and self.spread[row] == self._spread_goal[row]:
                self._activity[row] = Activity.REST
        elif self._activity[row] is Activity.CLOSING:
            self._feel(row, state, close)
            if self.touched[row].all():
                self._goal[row] = np.clip(self.motor[row] + close.squeeze, 0.0, FINGER_UPPER)
                self._activity[row] = Activity.SQUEEZING
                self._left_s[row] = close.squeeze / close.speed + close.settle_s
            elif (self.touched[row] | arrived).all():
                self._activity[row] = Activity.REST  # a finger met nothing: no grip to squeeze
        else:
            self._left_s[row] -= dt
            if self._left_s[row] <= 0.0:
                self._hold_on(row, close)

    def _feel(self, row: int, state: State, close: Close) -> None:
        pushing = (
            joint.touching(
                self.motor[row], state.proximal[row], state.distal[row], close.speed, close.effort
            )
            & ~self.touched[row]
        )
        self._pushing[row] = np.where(pushing, self._pushing[row] + 1, 0)
        new = self._pushing[row] > joint.TOUCH_CYCLES
        self._goal[row] = np.where(new, self.motor[row], self._goal[row])
        self.touched[row] |= new

    def _hold_on(self, row: int, close: Close) -> None:
        if self._activity[row] is Activity.SQUEEZING and close.lock:
            self.locked[row] = 1.0
            self._activity[row], self._left_s[row] = Activity.LOCKING, LOCK_S
        else:
            self._activity[row] = Activity.REST

    def report(self, row: int, state: State) -> HandReport:
        """Return the report of this hand."""
        one, two, three = (bool(x) for x in self.touched[row])
        p, d = [float(x) for x in state.proximal[row]], [float(x) for x in state.distal[row]]
        return HandReport(
            (one, two, three), (p[0], p[1], p[2]), (d[0], d[1], d[2]), bool(self.locked[row])
        )


# --- What the wrists feel: is what a hand has taken still in it? ----------------------------------
# The law is velma.control.grip. A hand is tared as a motion says, while it is empty and free, and
# watched from the payload that it is told to carry until it opens. On its way down to put something
# down it is not watched: the support takes the load. Nor is it while it holds something out to a
# person, who takes the load: then it feels for a pull. With a sensor that is not well a hand feels
# nothing, and says why.


_ENDS = {Grip.LOST: (Phase.LOST, Kind.FEELS_LITTLE), Grip.SLIPPED: (Phase.SLIPPED, Kind.SLIPS)}
_ALARMS = frozenset((Grip.WARNED, *_ENDS))


class GripWatch:
    """Rows right, left. Without sensors nothing is felt and nothing is lost."""

    def __init__(self, period_s: float) -> None:
        self.wrists = grip.Wrists(period_s)
        self._period_s = period_s
        self._share = 1.0 - np.exp(-period_s / grip.LOAD_S)
        # whether there are sensors; force, gravity of each hand
        self._sensed, self._felt = False, np.zeros((2, 2, 3))
        self._error = np.zeros((2, 3))  # N, of each sensor at its empty hand
        self._low, self._high = np.zeros(2), np.zeros(2)  # kg; high 0: the hand is empty
        self._load = np.zeros(2)
        self._down = [False, False]
        self._watch = [Watch(), Watch()]
        self._wanted_n, self._wanted_s = [0.0, 0.0], [0.0, 0.0]  # of a pull; 0: nothing is held out
        self._pull, self._pull_n = [Pull(), Pull()], [0.0, 0.0]
        self._beside = np.zeros((2, 3))  # m, of each hand from its set-point, world axes
        self._health, self._good = (Health(), Health()), np.zeros((2, 6))

    def begin(self, asked: Motion) -> None:
        """Note what a motion does with the hands."""
        for row, (command, payload) in enumerate(zip(asked.hands(), asked.payloads(), strict=True)):
            if asked.tare == SIDES[row] and not self._high[row] and self._sensed:
                self._error[row] = grip.tare(*self._felt[row])
            if isinstance(command, Open):
                payload = Payload()
            if payload is not None:
                self._expect(row, payload)
            out = asked.until is Until.PULL and asked.pull_side == SIDES[row]
            self._wanted_n[row], self._wanted_s[row] = (
                (asked.pull_n, asked.pull_s) if out else (0.0, 0.0)
            )
            self._pull[row] = Pull()
            self._down[row] = out or (
                asked.until is Until.CONTACT and asked.contact_side == SIDES[row]
            )
            if self._down[row] or self._watch[row].grip is Grip.SLIPPED:
                self._watch[row] = Watch()

    def _expect(self, row: int, payload: Payload) -> None:
        # it is there after all
        if not payload.mass or not self._high[row] or self._watch[row].grip is Grip.LOST:
            self._watch[row] = Watch()
        self._low[row] = payload.mass
        self._high[row] = payload.mass + payload.content if payload.mass else 0.0

    def update(self, state: State, terms: Terms) -> None:
        """Take the readings of a cycle."""
        if state.wrist is None:
            return
        readings = self._well(state.wrist, terms)
        self._sensed, self._felt = True, self.wrists.feel(readings, terms.rotation, terms.position)
        forces, gravities = (self._felt[:, 0] - self._error).tolist(), self._felt[:, 1].tolist()
        masses = [
            grip.mass(force, gravity) for force, gravity in zip(forces, gravities, strict=True)
        ]
        self._load += self._share * (masses - self._load)
        if not self.wrists.settled:
            return
        for row, (low, high) in enumerate(
            zip(self._low.tolist(), self._high.tolist(), strict=True)
        ):
            if self._wanted_n[row]:
                self._feel_pull(row, state.wrist[row], terms, min(max(masses[row], low), high))
            if self._health[row].wrong:
                self._watch[row] = Watch()
            elif high and not self._down[row]:
                rest = grip.residual(forces[row], gravities[row], masses[row], low, high)
                self._watch[row] = grip.watched(self._watch[row], rest, masses[row], low)

    def _feel_pull(self, row: int, reading: Array, terms: Terms, kg: float) -> None:
        rotation, (x, y, _) = terms.rotation[row], terms.position[row]
        away = np.array([x, y, 0.0]) / max(1e-9, float(np.hypot(x, y)))
        out, (force, gravity) = rotation.T @ away, self._felt[row]
        raw = reading[:3] * grip.SENSOR_TO_GRIP[row] - self._error[row]
        self._pull_n[row] = smooth = grip.size(force - self._error[row], gravity, kg, out)
        self._pull[row] = grip.pulled(
            self._pull[row], reading.tolist(), smooth,
            grip.size(raw, rotation[2] * GRAVITY, kg, out),
            float(self._beside[row] @ away), self._wanted_n[row],
        )  # fmt: skip
        if self._health[row].wrong:
            self._pull[row] = Pull()

    def yielded(self, error: Array) -> None:
        """Take how far (12,) the set-points of both hands are from them."""
        if any(self._wanted_n):
            self._beside[:] = -error.reshape(2, 6)[:, :3]

    @property
    def pulled(self) -> bool:
        """Whether somebody pulls at what a hand holds out, as the motion waits for."""
        return self._pulled(0) or self._pulled(1)

    def _pulled(self, row: int) -> bool:
        return (
            bool(self._wanted_n[row])
            and self._pull[row].steady * self._period_s >= self._wanted_s[row] - 1e-9
        )

    def _well(self, wrist: Array, terms: Terms) -> Array:
        """Return the readings (2, 6); of a sensor that reads what cannot be, the last that
        could.
        """
        well = [
            health.judge(reading.tolist(), rotation.ravel().tolist())
            for health, reading, rotation in zip(self._health, wrist, terms.rotation, strict=True)
        ]
        self._good = wrist if all(well) else np.where(np.array(well)[:, None], wrist, self._good)
        return self._good

    def skip(self) -> None:
        """A cycle without readings."""
        self.wrists.restart()
        self._pull[:] = Pull(), Pull()

    @property
    def alarmed(self) -> bool:
        """Whether a hand may be losing what it holds, or has lost it."""
        return self._watch[0].grip in _ALARMS or self._watch[1].grip in _ALARMS

    @property
    def verdict(self) -> Verdict | None:
        """Return the end of the motion and its reason as soon as it is known; None before."""
        grips = [watch.grip for watch in self._watch]
        if Grip.WARNED in grips:
            return None
        for felt, (phase, kind) in _ENDS.items():
            if felt in grips:
                row = grips.index(felt)
                return phase, (fact(kind, SIDES[row], max(self._load[row], 0.0)),)
        return None

    def report(self, row: int) -> GripReport:
        """Return what is felt in a hand."""
        wrong = self._health[row].wrong
        felt = "" if wrong or not (self._sensed and self._high[row]) else str(self._watch[row].grip)
        return GripReport(
            felt, float(self._load[row]), wrong, self._pull_n[row] if self._pulled(row) else 0.0
        )
