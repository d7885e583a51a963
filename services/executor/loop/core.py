"""The control loop without its process: one `cycle` is observe, check, control, command.

Whatever exception is raised inside, the cycle ends in a command. After a fault that command is
viscous damping for some cycles, then a held posture until an explicit release (the rules of Velma's
lower level). No clock, no file, no log: the process around it (`__main__`) owns those. It runs as
fast as it is called; one call runs a whole motion: `LoopCore(backend).run(motion)`.
"""

import math
from contextlib import suppress

import msgspec
import numpy as np

from companion.languages.facts import Facts, Kind, fact
from companion.skills.loop_messages import (
    FAULT,
    HandReport,
    HeadGoal,
    Mode,
    Motion,
    Move,
    Payload,
    Phase,
    Refusal,
    Report,
    checked,
    followed,
    refusal,
)
from services.executor.loop.act import RunningMotion, Verdict
from services.executor.loop.hands import Fingers, GripWatch
from velma import names, ranges
from velma.control import cartesian, joint, safety
from velma.control.cartesian import CartesianGains, CartesianImpedance
from velma.control.dynamics import Dynamics, Terms
from velma.control.joint import JointGains
from velma.errors import MotionError, VelmaError
from velma.model.tree import ROBOT_XML
from velma.names import BODY, LOWER, SPEED, UPPER, Array
from velma.ranges import MOST_KG, MOST_LEVER_M
from velma.sim.backend import Backend, Command, State, no_command

# --- The loads of the hands that the loop feeds forward; a new load is taken up gradually ---------


# kg/s. Velma takes a weight up within 1000 cycles; a bowl of 0.3 kg here in 0.2 s, so that it is
# lifted at once but not thrown. Estimate.
RATE = 1.5


class Payloads:
    """Masses (2,) kg and levers (2, 3) m in the grip frames; rows right, left."""

    def __init__(self) -> None:
        self.mass, self.lever = np.zeros(2), np.zeros((2, 3))
        self._goal = np.zeros(2)

    def take(self, row: int, payload: Payload | None) -> None:
        """Set the load of a hand; None: no change. An emptied hand keeps its lever until its mass
        is 0.
        """
        if payload is None:
            return
        self._goal[row] = payload.mass
        if payload.mass:
            self.lever[row] = payload.lever

    def advance(self, dt: float) -> None:
        """Advance by dt [s]."""
        if self.mass.tolist() != self._goal.tolist():
            step = RATE * dt
            if not (_sane(self._goal).all() and _sane(self.mass).all()):
                found = f"{self.mass} kg on the way to {self._goal}"
                self.mend()
                raise MotionError("payload", found, f"from 0 to {MOST_KG:g} kg")
            self.mass += np.clip(self._goal - self.mass, -step, step)

    def mend(self) -> None:
        """Have possible numbers: a mass that is none becomes its goal, a goal that is none what is
        carried now.
        """
        self._goal = np.where(
            _sane(self._goal), self._goal, np.where(_sane(self.mass), self.mass, 0.0)
        )
        self.mass = np.where(_sane(self.mass), self.mass, self._goal)
        self.lever = np.where(np.abs(self.lever) <= MOST_LEVER_M, self.lever, 0.0)


def _sane(mass: Array) -> Array:
    return np.asarray((mass >= 0.0) & (mass <= MOST_KG))


# --- The control of the robot, cycle by cycle -----------------------------------------------------

DAMPING_CYCLES = 20  # of viscous damping after a fault, then the posture is held
FAST_CYCLES = 5  # in a row in which a joint is too fast; estimate: noise of its sensor is not
HEAD_NEAR = 0.02  # rad: closer than this the head has arrived
# rad: no joint can be farther beyond its end; estimate: joints of a conforming robot yield by 0.1
# at most
BEYOND = 0.5
_LEAST, _MOST = LOWER - BEYOND, UPPER + BEYOND
_RANGES = tuple(zip(_LEAST.tolist(), _MOST.tolist(), strict=True))
# rad/s; estimate: with its limits in the plan, an arm that pulls a door was 1.04 times as fast
TOO_FAST = 1.5 * SPEED
_SPEEDS = tuple(TOO_FAST.tolist())
JOINT_OFF, HAND_OFF_M, HAND_OFF, FINGER_OFF = 0.06, 0.01, 0.03, 0.05
"""rad, m, rad, rad: at the end of a motion nothing is farther off than that. Twice and more the
most in 304 motions of ten good runs (canonical, env2, doors): 0.028 rad of a joint, 4.4 mm and
0.009 rad of a hand, 0.015 rad of a finger.
"""
# rad: on the way no joint is farther off; twice the most in 214 motions of six good runs (0.15)
JOINT_BESIDE = 0.4
# rad: a measured joint may be beyond its end by that, and become a set-point (estimate)
SERVO_SLACK = 0.1
_KINDS = (
    ("the head's pan", names.HEAD_LOWER[0], names.HEAD_UPPER[0], 1),
    ("the head's tilt", names.HEAD_LOWER[1], names.HEAD_UPPER[1], 1),
    ("a spread", 0.0, names.SPREAD_UPPER, 2),
    ("a finger", 0.0, names.FINGER_UPPER, 6),
    ("a finger's end", 0.0, names.DISTAL_UPPER, 6),
    ("a lock", 0.0, 1.0, 2),
)
_SERVOS = tuple(
    (float(least) - SERVO_SLACK, float(most) + SERVO_SLACK)
    for _, least, most, count in _KINDS
    for _ in range(count)
)
"""Least and most of each set-point of `_servos`."""


class Fault(VelmaError):
    """A reading or result with which the loop must not go on."""


def impossible(state: State) -> str:
    """Return why no robot can be in this state, with joint and reading; "" for a possible state."""
    # In every cycle: plain numbers take a third of the time of small arrays. NaN fails each
    # comparison.
    slow = all(-safety.FASTEST <= v <= safety.FASTEST for v in state.v.tolist())
    if slow and all(
        least <= q <= most for q, (least, most) in zip(state.q.tolist(), _RANGES, strict=True)
    ):
        return ""
    if not (np.isfinite(state.q).all() and np.isfinite(state.v).all()):
        return "a joint measurement is not a finite number"
    fastest = int(np.argmax(np.abs(state.v)))
    if abs(state.v[fastest]) > safety.FASTEST:
        return (
            f"{BODY[fastest]} is measured at {state.v[fastest]:.3g} rad/s, at most"
            f" {safety.FASTEST:g} is possible"
        )
    farthest = int(np.argmax(np.maximum(LOWER - state.q, state.q - UPPER)))
    possible = f"{_LEAST[farthest]:.2f} to {_MOST[farthest]:.2f}"
    return f"{BODY[farthest]} is measured at {state.q[farthest]:.3g} rad, possible are {possible}"


def _servos(command: Command) -> list[float]:
    """Return the set-points of head and hands in a command, as `_SERVOS` has their ranges."""
    hands: list[float] = command.proximal.ravel().tolist() + command.distal.ravel().tolist()
    return [*command.head.tolist(), *command.spread.tolist(), *hands, *command.locked.tolist()]


def _impossible_servo(servos: list[float]) -> str:
    kinds = [name for name, _, _, count in _KINDS for _ in range(count)]
    for name, x, (least, most) in zip(kinds, servos, _SERVOS, strict=True):
        if not least <= x <= most:
            return f"the set-point of {name} is {x:.3g} rad, possible are {least:.2f} to {most:.2f}"
    return ""


def _not_followed(joints: Array, most: float) -> Facts:
    """Return which part is farther than `most` [rad] from its set-point, () if none is. `joints`
    (15,): distances.
    """
    worst = int(joints.argmax())
    # The impedance moves the other joints of an arm for one that sticks: which one sticks is not
    # known.
    part = BODY[worst].rsplit("_", 2)[0]
    return (fact(Kind.NOT_FOLLOWED, part, joints[worst]),) if joints[worst] > most else ()


class LoopCore:
    """Velma under control; see `mode`, `report` and `setpoint`."""

    def __init__(
        self,
        backend: Backend,
        *,
        dynamics: Dynamics | None = None,
        gains: CartesianGains | None = None,
        hold: JointGains | None = None,
    ) -> None:
        self.backend = backend
        self.dynamics = dynamics or Dynamics(ROBOT_XML)
        self.impedance = CartesianImpedance(gains)
        self._hold_gains = ranges.checked(hold or JointGains())
        self._error = cartesian.error()
        self._terms: Terms | None = None
        self.command = no_command()
        self.state: State = backend.observe()
        # of the last cycle; whoever observes again changes the time of the state
        self._cycle_s = self.state.time
        self.setpoint: Array = self.state.q.copy()
        self.fingers, self.payloads = Fingers(), Payloads()
        self.grips = GripWatch(backend.period_s)
        self.fingers.start_from(self.state)
        self._sent = _servos(self.command)  # of head and hands, as they were sent last
        self._head_target = self.state.head.copy()
        self._head_goal = self.state.head.copy()
        self._head_speed = 0.0
        self.mode, self._dwell, self._release, self._fast = Mode.MOTION, 0, False, 0
        # by a person, who has not released the robot: it holds also after a fault
        self.stopped = False
        self.cycles, self.saturated, self.faults, self.last_fault = 0, 0, 0, ""
        self.act: RunningMotion | None = None
        self.report = Report()

    # --- what the outside may ask -----------------------------------------------------------------

    def begin(self, asked: Motion) -> Refusal | None:
        """Start a motion now; or return why it is refused.

        A refused motion is reported as failed, unless another one runs, whose report stays.
        """
        refused = self._started(asked)
        if refused is None:
            self._tell(Phase.RUNNING)
        elif self.act is None:
            self.report = Report(
                asked.key, Phase.FAILED, refused.why, right=self._hand(0), left=self._hand(1)
            )
        return refused

    def _started(self, asked: Motion) -> Refusal | None:
        if self.act is not None:
            running = (
                f"motion {self.act.motion.key} is still running; cancel it or wait for its end"
            )
            return Refusal((fact(Kind.BUSY, "loop"),), running)
        if self.mode is not Mode.MOTION:
            held = f"the robot is in mode {self.mode}; release it first"
            return Refusal((fact(Kind.HELD_STILL, self.mode),), held)
        try:
            asked = checked(asked)
            act = RunningMotion(asked, self.setpoint, self.state.time)
            followed(asked, self.setpoint)
            for row in (0, 1):
                self.fingers.check(row, asked.hands()[row])
        except MotionError as error:
            return refusal(error)
        self.act = act
        for row in (0, 1):
            self.fingers.begin(row, asked.hands()[row])
            self.payloads.take(row, asked.payloads()[row])
        self.grips.begin(asked)
        if asked.head is not None:
            self._look(asked.head)
        return None

    def _look(self, goal: HeadGoal) -> None:
        self._head_goal = joint.reachable(np.array((goal.pan, goal.tilt)))
        self._head_speed = goal.speed

    def cancel(self, key: str | None = None) -> None:
        """Bring the running motion (only if it has this key) smoothly to rest."""
        if self.act is not None and key in (None, self.act.motion.key) and not self.act.cancelled:
            self.act.cancel()
            self.fingers.freeze()

    @property
    def look_due(self) -> bool:
        """Whether somebody has to look at the running motion now."""
        return self.act is not None and self.act.look_due(self._cycle_s)

    def look_again(self, key: str, in_s: float) -> None:
        """Let the next look at the running motion (only if it has this key) be due `in_s` [s] after
        this one.
        """
        if self.look_due and self.act is not None and key == self.act.motion.key:
            self.act.look_again(in_s)

    def pause(self, paused: bool = True) -> None:
        """Bring the running motion to rest along its path, or let it go on from there."""
        if self.act is not None:
            self.act.pause(paused)

    def stop(self) -> None:
        """Hold the joints, whatever runs: the stop of a person."""
        self.stopped = True
        if self.mode is not Mode.STOPPED:
            self._enter(Mode.STOPPED, (fact(Kind.HELD_STILL, Mode.STOPPED),))

    def release(self) -> None:
        """Leave damping, hold or stop as soon as the dwell is over. No effect in mode motion."""
        self.stopped, self._release = False, self.mode is not Mode.MOTION

    def abandon(self, why: Facts) -> None:
        """Enter damping, then hold, because nobody commands any more."""
        if self.mode is Mode.MOTION:
            self._enter(Mode.DAMPING, why, Phase.INTERRUPTED)

    def run(self, asked: Motion) -> Report:
        """Run a motion to its end and return its report. Raises MotionError while another one
        runs.
        """
        if self.act is not None:
            raise MotionError(
                "running", self.act.motion.key, "no motion running; cancel it or wait for its end"
            )
        self.begin(asked)
        while self.report.phase is Phase.RUNNING:
            self.cycle()
        return self.report

    def hold(self, seconds: float) -> None:
        """Cycle for this time [s] without a motion."""
        for _ in range(math.ceil(seconds / self.backend.period_s)):
            self.cycle()

    @property
    def busy(self) -> bool:
        """Whether simulated time has to go on: for a motion, a release or a fault."""
        return self.act is not None or self._release or self.mode is Mode.DAMPING

    @property
    def braking(self) -> bool:
        """Whether a cancelled motion comes to rest: it ends without anybody."""
        return self.act is not None and self.act.cancelled

    # --- one cycle --------------------------------------------------------------------------------

    def cycle(self) -> None:
        """Run one period: observe, check, control, command."""
        try:
            self.state = self.backend.observe()
            self._cycle_s = self.state.time
            self._check(self.state)
            tau = self._control(self.state)
        except Exception as error:  # of any kind: the joints get a command in this very cycle
            self._fault(error)
            tau = self._safe()
        self._send(tau)
        self.cycles += 1

    def _send(self, tau: Array) -> None:
        servos = _servos(self.command)
        if all(least <= x <= most for x, (least, most) in zip(servos, _SERVOS, strict=True)):
            self._sent = servos
        else:
            self._mend()
            tau = self._blamed(_impossible_servo(servos), tau)
        if not safety.is_accepted(tau):
            tau = self._cut(tau)
        self.command.tau[:] = tau
        try:
            self.backend.step(self.command)
        except Exception as error:
            self._fault(error)

    def _cut(self, tau: Array) -> Array:
        """Return a torque that the lower level takes, in place of one that it does not."""
        if not np.isfinite(tau).all():
            self._mend()
            self._fault(Fault("the torque of the control law is not a finite number"))
            tau = self._safe()
        self.saturated += not safety.is_accepted(tau)
        return safety.accepted(tau)

    def _blamed(self, why: str, tau: Array) -> Array:
        """Return the safe torque after a fault of head or hands; in a safe mode, the joints stay in
        it.
        """
        if self.mode is Mode.MOTION:
            self._fault(Fault(why))
            return self._safe()
        self.faults, self.last_fault = self.faults + 1, f"Fault: {why}"
        return tau

    def _mend(self) -> None:
        """Go back to the set-points of head and hands that were sent last."""
        joint, spread, proximal, distal, locked = np.split(np.array(self._sent), (2, 4, 10, 16))
        command = self.command
        command.head[:], command.spread[:], command.locked[:] = joint, spread, locked
        command.proximal[:], command.distal[:] = proximal.reshape(2, 3), distal.reshape(2, 3)
        self.fingers = Fingers()
        self.fingers.start_at(command)
        self._head_target, self._head_goal = joint, joint.copy()

    def _safe(self) -> Array:
        """Return damping with the weight of what the hands hold, if that can be known: nothing else
        moves a joint.
        """
        tau = safety.damping_torque(self.state.v)
        with suppress(Exception):  # the model may be what has failed
            if self.payloads.mass.any():
                if not impossible(self.state):
                    self._terms = self.dynamics.terms(self.state.q)
                if (terms := self._terms) is not None:  # of the last posture that was known
                    wrench = cartesian.payload_wrench(
                        terms.rotation, self.payloads.mass, self.payloads.lever
                    )
                    held = tau + terms.jacobian.T @ wrench
                    return safety.accepted(held) if np.isfinite(held).all() else tau
        return tau

    def _check(self, state: State) -> None:
        # In every cycle: plain numbers take a third of the time of small arrays. NaN fails each
        # comparison.
        slow = all(-most <= v <= most for v, most in zip(state.v.tolist(), _SPEEDS, strict=True))
        if slow and all(
            least <= q <= most for q, (least, most) in zip(state.q.tolist(), _RANGES, strict=True)
        ):
            self._fast = 0
        else:
            self._judge_state(state)
        self._dwell += 1
        if self.mode is Mode.DAMPING and self._dwell >= DAMPING_CYCLES:
            self.mode = Mode.STOPPED if self.stopped else Mode.HOLD
            self.setpoint = state.q.copy()
        elif self.mode is not Mode.MOTION and self._release and self._dwell >= safety.DWELL_CYCLES:
            self.mode, self._release = Mode.MOTION, False
            self.impedance.renew()

    def _judge_state(self, state: State) -> None:
        """Raise Fault for a state in which no robot can be, or in which a joint has been too fast
        for some cycles.
        """
        wrong = impossible(state)
        if wrong:
            raise Fault(wrong)
        fastest = int(np.argmax(np.abs(state.v) / TOO_FAST))
        self._fast = self._fast + 1 if abs(state.v[fastest]) > TOO_FAST[fastest] else 0
        if self._fast >= FAST_CYCLES:
            raise Fault(
                f"{BODY[fastest]} turns at {state.v[fastest]:.3g} rad/s, at most"
                f" {TOO_FAST[fastest]:.3g} is allowed"
            )

    def _control(self, state: State) -> Array:
        dt = self.backend.period_s
        if self._head_target.tolist() != self._head_goal.tolist():
            self._head_target = joint.advance_head(
                self._head_target, self._head_goal, self._head_speed, dt
            )
        self.command.head[:] = self._head_target
        self.payloads.advance(dt)
        self.fingers.update(state, self.command, dt)
        if self.mode is Mode.DAMPING:
            self.grips.skip()
            return self._safe()
        self._terms = terms = self.dynamics.terms(state.q)
        self.grips.update(state, terms)
        weight = cartesian.payload_wrench(terms.rotation, self.payloads.mass, self.payloads.lever)
        if self.mode is not Mode.MOTION:
            return joint.torque(self._hold_gains, terms, self.setpoint - state.q, state.v, weight)
        return self._follow(state, terms, weight, dt)

    def _follow(self, state: State, terms: Terms, weight: Array, dt: float) -> Array:
        act, slip = self.act, state.v
        if act is not None and act.track is not None:
            act.track.advance(dt)
            self.setpoint, slip = act.track.q, state.v - act.track.v
        error = self._error(terms, *self.dynamics.grips(self.setpoint))
        self.grips.yielded(error)
        if act is not None:
            self._judge(act, state, error)
        return self.impedance.torque(terms, error, slip, self.setpoint - state.q, weight)

    def _judge(self, act: RunningMotion, state: State, error: Array) -> None:
        followed = act.track
        ends = zip(self._head_target.tolist(), self._head_goal.tolist(), strict=True)
        head_done = all(abs(target - goal) <= HEAD_NEAR for target, goal in ends)
        joints = np.abs(state.q - self.setpoint)
        if act.track is not None and (off := _not_followed(joints, JOINT_BESIDE)):
            verdict: Verdict | None = (Phase.BLOCKED, off)
            act.track = None
        elif self.grips.alarmed:
            verdict = act.beside(error) or act.interrupt(self.grips.verdict)
        else:
            hands_done, pulled = self.fingers.at_rest, self.grips.pulled
            verdict = act.judge(
                state.time, error, hands_done=hands_done, head_done=head_done, pulled=pulled
            )
            done = verdict is not None and verdict[0] is Phase.DONE and not act.given_way
            if done and (off := self._off(act.motion, joints, error)):
                verdict = act.wait(state.time, off)
        # so that no force remains: the set-point is where the body is
        if act.track is not followed:
            self.setpoint = state.q.copy()
        if verdict is not None:
            self._end(*verdict)

    def _off(self, asked: Motion, joints: Array, error: Array) -> Facts:
        """Return what is not where the motion should have brought it, () where all is.

        `joints` (15,), `error` (12,): how far joints and hands are from their set-points.
        """
        if off := _not_followed(joints, JOINT_OFF):
            return off
        hands = zip(
            names.SIDES, asked.hands(), error.reshape(2, 2, 3), self.state.proximal, strict=True
        )
        for side, command, parts, fingers in hands:
            away, turned = (float(np.linalg.norm(part)) for part in parts)
            if away > HAND_OFF_M or turned > HAND_OFF:
                return (fact(Kind.HAND_OFF, side, away, turned),)
            if isinstance(command, Move):
                bent = np.abs(fingers - command.fingers)
                if bent.max() > FINGER_OFF:
                    number = int(np.argmax(bent)) + 1
                    return (fact(Kind.FINGER_NOT_FOLLOWED, side, number, bent.max()),)
        return ()

    # --- ends and faults --------------------------------------------------------------------------

    def _end(self, phase: Phase, why: Facts) -> None:
        if phase is not Phase.DONE:
            self.fingers.freeze()
        self._tell(phase, why)
        self.act = None

    def _tell(self, phase: Phase, why: Facts = ()) -> None:
        assert self.act is not None
        self.report = self.act.report(phase, why, self.state.time, self._hand(0), self._hand(1))

    def _hand(self, row: int) -> HandReport:
        return msgspec.structs.replace(
            self.fingers.report(row, self.state), grip=self.grips.report(row)
        )

    def _fault(self, error: Exception) -> None:
        self.faults += 1
        self.last_fault = f"{type(error).__name__}: {error}"
        self.payloads.mend()
        self._enter(Mode.DAMPING, FAULT)

    def _enter(self, mode: Mode, why: Facts, phase: Phase = Phase.FAILED) -> None:
        """Leave the present motion, if any, for a safe mode."""
        self.mode, self._dwell, self._release = mode, 0, False
        self._head_goal = self._head_target.copy()
        self.fingers.freeze()
        if not impossible(self.state):
            self.setpoint = self.state.q.copy()
        if self.act is not None:
            self._end(phase, why)
