"""The control loop without its process: one `cycle` is observe, check, control, command.

Total: whatever is thrown inside, the cycle ends in a command, and after a fault that command is viscous damping for
some cycles and then a held posture, which only an explicit release leaves (the rules of Velma's lower level). No
clock, no file, no log: the process around it (`__main__`) owns those. Runs as fast as it is called, so that a whole
motion can be had in one call: `LoopCore(backend).run(motion)`.
"""

import math

import numpy as np
from numpy.typing import NDArray

from services.executor.loop.fingers import Fingers
from services.executor.loop.payloads import Payloads
from services.executor.loop.program import HandReport, HeadGoal, Mode, Motion, Phase, Report, Result, Until, checked
from services.executor.loop.track import Track
from velma.control import cartesian, damping, head, joint, limits
from velma.control.cartesian import CartesianGains, CartesianImpedance
from velma.control.dynamics import Dynamics, Terms
from velma.control.joint import JointGains
from velma.errors import MotionError, VelmaError
from velma.model.build import ROBOT_XML
from velma.names import SIDES
from velma.sim.backend import Backend, State, no_command

Array = NDArray[np.float64]

DAMPING_CYCLES = 20  # of viscous damping after a fault, then the posture is held
HEAD_NEAR = 0.02  # rad: the head has arrived


class Fault(VelmaError):
    """The loop saw something it must not go on with."""


class LoopCore:
    """Velma under control. `mode`, `report` and `setpoint` tell what it does."""

    def __init__(
        self,
        backend: Backend,
        *,
        dynamics: Dynamics | None = None,
        gains: CartesianGains | None = None,
        hold: JointGains | None = None,
    ) -> None:
        self.backend = backend
        self._dynamics = dynamics or Dynamics(ROBOT_XML)
        self._impedance = CartesianImpedance(gains)
        self._hold = hold or JointGains()
        self._command = no_command()
        self._fingers, self._payloads = Fingers(), Payloads()
        self.state: State = backend.observe()
        self.setpoint: Array = self.state.q.copy()
        self._rest = np.zeros_like(self.setpoint)
        self._fingers.start_from(self.state)
        self._head_target, self._head_goal = self.state.head.copy(), HeadGoal(*(float(x) for x in self.state.head))
        self.mode, self._dwell, self._release = Mode.MOTION, 0, False
        self.faults, self.saturated, self.last_fault = 0, 0, ""
        self.cycles = 0
        self._forget()
        self.report = Report()

    # -- what the outside may ask ------------------------------------------------------------------------------------

    def begin(self, asked: Motion) -> str:
        """Start a motion now, or say in words why not; nothing moves then. "" is yes.

        A refused motion is reported as failed, unless another one runs, whose report stays.
        """
        refused = self._refused(asked)
        if refused:
            if self._motion is None:
                self.report = Report(asked.key, Phase.FAILED, refused, right=self._hand(0), left=self._hand(1))
            return refused
        self._forget()
        self._motion, self._track = asked, Track(asked.path(), self.setpoint)
        self._began = self.state.time
        for row in (0, 1):
            self._fingers.begin(row, asked.hands()[row])
            self._payloads.take(row, asked.payloads()[row])
        if asked.head is not None:
            self._head_goal = asked.head
        self._tell(Phase.RUNNING)
        return ""

    def _refused(self, asked: Motion) -> str:
        if self._motion is not None:
            return f"motion {self._motion.key} is still running; cancel it or wait for its end"
        if self.mode is not Mode.MOTION:
            return f"the robot is in mode {self.mode}; release it first"
        try:
            checked(asked)
            Track(asked.path(), self.setpoint)
            for row in (0, 1):
                self._fingers.check(row, asked.hands()[row])
        except MotionError as error:
            return str(error)
        return ""

    def cancel(self, key: str | None = None) -> None:
        """Bring the running motion (or the one of this key) smoothly to rest."""
        if self._motion is not None and key in (None, self._motion.key) and not self._cancelled:
            self._cancelled = True
            self._fingers.freeze()
            if self._track is not None:
                self._track.brake()

    def stop(self) -> None:
        """A person's stop: hold the joints, whatever runs."""
        if self.mode is not Mode.STOPPED:
            self._enter(Mode.STOPPED, "stopped by a person")

    def release(self) -> None:
        """Leave damping, hold or stop, as soon as the dwell is over. Without effect in motion."""
        self._release = self.mode is not Mode.MOTION

    def abandon(self, reason: str) -> None:
        """Whoever commands is gone: damping, then hold."""
        if self.mode is Mode.MOTION:
            self._enter(Mode.DAMPING, reason)

    def run(self, asked: Motion) -> Result:
        """Start a motion and cycle until it has ended. Result.phase says how. Raises MotionError while another runs."""
        if self._motion is not None:
            raise MotionError("running", self._motion.key, "no motion running; cancel it or wait for its end")
        self.begin(asked)
        while self.report.phase is Phase.RUNNING:
            self.cycle()
        return self.report

    def hold(self, seconds: float) -> None:
        """Cycle for a while where the body is."""
        for _ in range(math.ceil(seconds / self.backend.period_s)):
            self.cycle()

    @property
    def busy(self) -> bool:
        """Whether simulated time has to go on: a motion runs, or a fault is being lived through."""
        return self._motion is not None or self._release or self.mode is Mode.DAMPING

    # -- one cycle ---------------------------------------------------------------------------------------------------

    def cycle(self) -> None:
        """Observe, check, control, command: one period."""
        try:
            self.state = self.backend.observe()
            self._check(self.state)
            tau = self._control(self.state)
        except Exception as error:  # whatever it is: the joints get a command in this very cycle
            self._fault(error)
            tau = damping.torque(self.state.v)
        self._send(tau)
        self.cycles += 1

    def _send(self, tau: Array) -> None:
        self._command.tau[:] = limits.accepted(tau)
        self.saturated += not limits.is_accepted(tau)
        try:
            self.backend.step(self._command)
        except Exception as error:
            self._fault(error)
            self._command.tau[:] = 0.0

    def _check(self, state: State) -> None:
        if not (np.isfinite(state.q).all() and np.isfinite(state.v).all()):
            raise Fault("a joint measurement is no number")
        self._dwell += 1
        if self.mode is Mode.DAMPING and self._dwell >= DAMPING_CYCLES:
            self.mode = Mode.HOLD
            self.setpoint = state.q.copy()
        elif self.mode is not Mode.MOTION and self._release and self._dwell >= damping.DWELL_CYCLES:
            self.mode, self._release = Mode.MOTION, False

    def _control(self, state: State) -> Array:
        dt = self.backend.period_s
        self._head_target = head.advance(self._head_target, self._head_pair(), self._head_goal.speed, dt)
        self._command.head[:] = self._head_target
        self._payloads.advance(dt)
        self._fingers.update(state, self._command, dt)
        if self.mode is Mode.DAMPING:
            return damping.torque(state.v)
        terms = self._dynamics.terms(state.q)
        weight = cartesian.payload_wrench(terms.rotation, self._payloads.mass, self._payloads.lever)
        if self.mode is not Mode.MOTION:
            return joint.torque(self._hold, terms, self.setpoint - state.q, state.v, weight)
        return self._follow(state, terms, weight, dt)

    def _follow(self, state: State, terms: Terms, weight: Array, dt: float) -> Array:
        slip = state.v
        if self._track is not None:
            self._track.advance(dt)
            self.setpoint, slip = self._track.q, state.v - self._track.v
        error = cartesian.task_error(terms, *self._dynamics.grips(self.setpoint))
        if self._motion is not None:
            self._judge(self._motion, state, error)
        return self._impedance.torque(terms, error, slip, self.setpoint - state.q, weight)

    # -- how a motion ends -------------------------------------------------------------------------------------------

    def _judge(self, motion: Motion, state: State, error: Array) -> None:
        for row in (0, 1):
            e = error[6 * row : 6 * row + 3]
            distance = math.sqrt(e @ e)
            self._largest[row] = max(self._largest[row], distance)
            if distance > motion.tolerance_m:
                self._hold_here(state)
                self._end(Phase.FAILED, f"the {SIDES[row]} hand was {distance:.3f} m beside its path")
                return
        if self._cancelled:
            if self._track is None or self._track.ended:
                self._end(Phase.CANCELLED, "cancelled")
            return
        if self._ended_by is None:
            self._ended_by = self._reached(motion, state, error)
        elif self._settled(motion, state):
            self._end(Phase.DONE, "")

    def _reached(self, motion: Motion, state: State, error: Array) -> Until | None:
        """Which rule ends the motion's path now, if any."""
        assert self._track is not None
        if motion.until is Until.CONTACT and error[6 * SIDES.index(motion.contact_side) + 2] < -motion.contact_m:
            self._hold_here(state)
            return Until.CONTACT
        if motion.until is Until.TOUCH and self._fingers.at_rest:
            self._track.brake()
            return Until.TOUCH if self._track.ended else None
        return Until.END if self._track.ended and motion.until is not Until.TOUCH else None

    def _settled(self, motion: Motion, state: State) -> bool:
        if not self._fingers.at_rest:
            self._settle_from = state.time
            return False
        if motion.head is not None and np.abs(self._head_target - self._head_pair()).max() > HEAD_NEAR:
            return False
        if self._settle_from is None:
            self._settle_from = state.time
        return state.time - self._settle_from >= motion.settle_s - 1e-9

    def _head_pair(self) -> Array:
        return np.array((self._head_goal.pan, self._head_goal.tilt))

    def _hold_here(self, state: State) -> None:
        """No force remains: the set-point is where the body is."""
        self.setpoint, self._track = state.q.copy(), None

    def _end(self, phase: Phase, reason: str) -> None:
        if phase is not Phase.DONE:
            self._fingers.freeze()
        self._tell(phase, reason)
        ended = self.report
        self._forget()
        self.report = ended

    def _tell(self, phase: Phase, reason: str = "") -> None:
        assert self._motion is not None
        self.report = Report(
            key=self._motion.key,
            phase=phase,
            reason=reason,
            ended_by=self._ended_by,
            time_s=self.state.time - self._began,
            right=self._hand(0),
            left=self._hand(1),
            largest_error_m=(self._largest[0], self._largest[1]),
        )

    def _hand(self, row: int) -> HandReport:
        return self._fingers.report(row, self.state)

    def _forget(self) -> None:
        self._motion: Motion | None = None
        self._track: Track | None = None
        self._cancelled, self._began = False, 0.0
        self._largest, self._ended_by = [0.0, 0.0], None
        self._settle_from: float | None = None

    # -- faults ------------------------------------------------------------------------------------------------------

    def _fault(self, error: Exception) -> None:
        self.faults += 1
        self.last_fault = f"{type(error).__name__}: {error}"
        self._enter(Mode.DAMPING, self.last_fault)

    def _enter(self, mode: Mode, reason: str) -> None:
        """Leave the present motion, if any, for a safe mode."""
        self.mode, self._dwell, self._release = mode, 0, False
        self._fingers.freeze()
        if np.isfinite(self.state.q).all():
            self.setpoint = self.state.q.copy()
        if self._motion is not None:
            self._end(Phase.FAILED, reason)
