"""Whether limits are kept: by the loop for what it commands, by the back-end for where its joints can be."""

import numpy as np
from numpy.typing import NDArray

from services.executor.conformance.judging import Measured
from services.executor.conformance.readings import outside
from services.executor.conformance.subject import Subject, bench, dynamics
from services.executor.loop.program import motion
from velma.names import BODY, HEAD_SPEED, TORQUE
from velma.sim.backend import Backend, Command, State

Array = NDArray[np.float64]

SERVOS = ("head", "spread", "proximal", "distal")


class Listening:
    """A back-end whose commands are kept: what the loop really sent, and the speeds it was sent for."""

    def __init__(self, backend: Backend) -> None:
        self._backend, self.period_s = backend, backend.period_s
        self.taus: list[Array] = []
        self.speeds: list[Array] = []

    def observe(self) -> State:
        """The state now."""
        return self._backend.observe()

    def step(self, command: Command) -> None:
        """Keep, and pass on."""
        self.speeds.append(self._backend.observe().v.copy())
        self.taus.append(command.tau.copy())
        self._backend.step(command)

    def configuration(self) -> Array:
        """The world model's coordinates."""
        return self._backend.configuration()

    @property
    def work_J(self) -> float:
        """Work so far, J."""
        return self._backend.work_J


def accepted(subject: Subject) -> Measured:
    """The largest command as a share of what the lower level accepts, in a motion that is much too fast."""
    with bench(subject) as robot:
        heard = Listening(robot.backend)
        core = subject.core(heard, dynamics=dynamics())
        jerk = core.setpoint + np.linspace(0.0, 0.5, 6)[:, None]
        core.begin(motion("too fast", jerk, tolerance_m=10.0))
        for _ in range(150):
            core.cycle()
    share = np.abs(np.array(heard.taus)) / TORQUE
    if not np.isfinite(share).all():
        return float("nan"), "a command was no number"
    k, joint = np.unravel_index(int(share.argmax()), share.shape)
    return float(share[k, joint]), f"{BODY[joint]} in cycle {k}"


def ends(subject: Subject) -> Measured:
    """How far joints leave their ranges when all are pushed one way, and then the other, rad."""
    worst: Measured = 0.0, "all inside"
    with bench(subject) as robot:
        for sign in (1.0, -1.0):
            robot.command.tau[:] = sign * subject.push * TORQUE
            worst = max(worst, max(outside(state, ("q",)) for state in robot.steps(3.0)))
    return worst


def servo_ends(subject: Subject) -> Measured:
    """How far head and fingers leave their ranges when led beyond them, rad."""
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
