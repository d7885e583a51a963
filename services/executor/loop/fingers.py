"""Both hands as the loop drives them: motor travels, closing by touch, squeeze, lock. The law is
velma.control.joint.
"""

from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from companion.skills.loop_messages import Close, HandCommand, HandReport, Move, Open
from velma.control import joint
from velma.control.safety import within
from velma.errors import MotionError
from velma.names import FINGER_UPPER, SIDES
from velma.sim.backend import PAIR_LIMIT, SINGLE_LIMIT, Command, State

Array = NDArray[np.float64]

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
