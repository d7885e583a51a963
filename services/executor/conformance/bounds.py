"""Checks of limits: the loop limits its commands, the back-end its joints."""

import numpy as np
from numpy.typing import NDArray

from companion.skills.loop_messages import motion
from services.executor.conformance.judging import Measured
from services.executor.conformance.readings import outside
from services.executor.conformance.subject import Subject, bench, dynamics
from velma.names import BODY, HEAD_SPEED, TORQUE
from velma.sim.backend import Backend, Command, State

Array = NDArray[np.float64]

SERVOS = ("head", "spread", "proximal", "distal")


class Listening:
    """A back-end that records the commands of the loop, and the speeds at which they were sent."""

    def __init__(self, backend: Backend) -> None:
        self._backend, self.period_s = backend, backend.period_s
        self.taus: list[Array] = []
        self.speeds: list[Array] = []

    def observe(self) -> State:
        """Return the state."""
        return self._backend.observe()

    def step(self, command: Command) -> None:
        """Record the command and pass it on."""
        self.speeds.append(self._backend.observe().v.copy())
        self.taus.append(command.tau.copy())
        self._backend.step(command)

    def configuration(self) -> Array:
        """Return the coordinates of the world model."""
        return self._backend.configuration()

    @property
    def work_J(self) -> float:
        """Work so far [J]."""
        return self._backend.work_J


def accepted(subject: Subject) -> Measured:
    """Return the largest command of a motion that is much too fast, as a share of what the lower level accepts."""
    with bench(subject) as robot:
        heard = Listening(robot.backend)
        core = subject.core(heard, dynamics=dynamics())
        jerk = core.setpoint + np.linspace(0.0, 0.5, 6)[:, None] * np.where(core.setpoint > 0.0, -1.0, 1.0)
        core.begin(motion("too fast", jerk, tolerance_m=10.0))
        for _ in range(150):
            core.cycle()
    share = np.abs(np.array(heard.taus)) / TORQUE
    if not np.isfinite(share).all():
        return float("nan"), "a command was not a number"
    k, joint = np.unravel_index(int(share.argmax()), share.shape)
    return float(share[k, joint]), f"{BODY[joint]} in cycle {k}"


def ends(subject: Subject) -> Measured:
    """Return how far joints leave their ranges when all are pushed one way, then the other [rad]."""
    worst: Measured = 0.0, "all inside"
    with bench(subject) as robot:
        for sign in (1.0, -1.0):
            robot.command.tau[:] = sign * subject.push * TORQUE
            worst = max(worst, max(outside(state, ("q",)) for state in robot.steps(3.0)))
    return worst


def servo_ends(subject: Subject) -> Measured:
    """Return how far head and fingers leave their ranges when their targets do [rad]."""
    worst: Measured = 0.0, "all inside"
    with bench(subject) as robot:
        reach = HEAD_SPEED * robot.backend.period_s
        for goal in (4.0, -4.0):
            for _ in robot.steps(8.0):
                for name in SERVOS:
                    target = getattr(robot.command, name)
                    target += np.clip(goal - target, -reach, reach)
                worst = max(worst, outside(robot.backend.observe(), SERVOS))
    return worst
