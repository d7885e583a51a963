"""The laws on the simulated robot, alone in an empty room: what a person pushing it would feel."""

import mujoco
import numpy as np
import pytest

from velma.control import cartesian, joint, safety
from velma.control.cartesian import CartesianGains, CartesianImpedance
from velma.control.dynamics import Dynamics
from velma.control.joint import JointGains
from velma.kinematics.robot import Robot
from velma.kinematics.timing import timed
from velma.model.build import ROBOT_XML
from velma.model.scene import Scene
from velma.names import COLUMNS, GRIP_BODY, START
from velma.sim.backend import no_command
from velma.sim.mujoco_backend import MujocoBackend

# Arms in front of the body, away from every singular posture (robot.yaml: front).
FRONT = np.array([0, -0.3, -1.57, 1.57, 1.57, 0, -1.57, 0, 0.3, 1.57, -1.57, -1.57, 0, 1.57, 0])


class Bench:
    """A robot under one law. `wrench` pushes the right grip, (6,) force and torque; `speed`: of the
    set-point.
    """

    def __init__(self, gains=None, *, q=FRONT, law="cartesian"):
        self.robot = MujocoBackend(Scene("empty"))
        self.dynamics, self.gains = Dynamics(ROBOT_XML), gains or CartesianGains()
        self.impedance, self.hold, self.law = CartesianImpedance(self.gains), JointGains(), law
        self.goal, self.speed, self.command = q.copy(), np.zeros(15), no_command()
        self.place(q)
        self.body = self.robot.model.body(GRIP_BODY["right"]).id
        self.wrench, self.largest = np.zeros(6), np.zeros(15)

    def place(self, q):
        self.robot.data.qpos[self.robot._q] = q
        self.robot.data.qvel[:] = 0
        mujoco.mj_step1(self.robot.model, self.robot.data)

    def step(self):
        state = self.robot.observe()
        terms = self.dynamics.terms(state.q)
        stray = self.goal - state.q
        if self.law == "joint":
            tau = joint.torque(self.hold, terms, stray, state.v, np.zeros(12))
        else:
            self.error = cartesian.task_error(terms, *self.dynamics.grips(self.goal))
            tau = self.impedance.torque(
                terms, self.error, state.v - self.speed, stray, np.zeros(12)
            )
        self.command.tau[:] = safety.accepted(tau)
        self.largest = np.maximum(self.largest, np.abs(self.command.tau))
        self.robot.data.xfrc_applied[self.body] = self.wrench
        self.robot.step(self.command)

    def run(self, seconds):
        for _ in range(int(seconds / self.robot.period_s)):
            self.step()

    def kinetic(self):
        state = self.robot.observe()
        return 0.5 * state.v @ self.dynamics.terms(state.q).mass @ state.v

    def spring(self):
        state = self.robot.observe()
        error = cartesian.task_error(self.dynamics.terms(state.q), *self.dynamics.grips(self.goal))
        return 0.5 * error @ (np.tile(self.gains.task(), 2) * error)


@pytest.mark.parametrize("axis", range(6))
def test_a_push_moves_the_hand_as_its_stiffness_says(axis):
    """15 N by 10 mm, 3 Nm by 20 mrad in every direction: 1500 N/m, and 150 Nm/rad against the true
    rotation vector, not its half. The other hand moves by less than a tenth of it.
    """
    push, way, near = (15.0, 0.010, 3e-4) if axis < 3 else (3.0, 0.020, 6e-4)
    bench, part = Bench(), slice(0, 3) if axis < 3 else slice(3, 6)
    bench.wrench[axis] = push
    bench.run(2.0)
    np.testing.assert_allclose(-bench.error[part], way * np.eye(6)[axis][part], atol=near)
    assert np.abs(bench.error[6:9]).max() < 0.001


@pytest.mark.parametrize("start", [START, FRONT])
def test_free_motion_loses_energy(start):
    """Set-point fixed, displaced and let go: kinetic plus spring energy never grows (beyond 1 % of
    its start).
    """
    bench = Bench(CartesianGains(posture_stiffness=(0.0, 0.0)), q=start)
    rng = np.random.default_rng(2)
    bench.place(start + rng.uniform(-0.03, 0.03, 15))
    energy = first = bench.kinetic() + bench.spring()
    for _ in range(150):
        bench.run(0.01)
        now = bench.kinetic() + bench.spring()
        assert now <= energy + 0.01 * first
        energy = now
    assert energy < 0.02 * first


def test_posture_spring_brings_the_elbow_back_and_leaves_the_hands():
    """A body pushed in its null space returns to its posture; meanwhile the hands stay within a
    millimetre.
    """
    bench = Bench()
    terms = bench.dynamics.terms(FRONT)
    null = np.linalg.svd(terms.jacobian)[2][12:]  # joint directions that move no hand
    bench.place(FRONT + 0.15 * null[0])
    bench.run(0.01)
    # A finite step along a curved null space moves the hands a little: that is the error they may
    # keep.
    allowed = max(1e-3, 1.2 * np.abs(bench.error).max())
    for _ in range(300):
        bench.run(0.01)
        assert np.abs(bench.error).max() <= allowed
    assert np.abs(bench.robot.observe().q - FRONT).max() < 0.03


@pytest.mark.parametrize("speed", [0.15, 0.25])
def test_an_arm_goes_through_a_straight_elbow_as_it_is_told(speed):
    """Where the elbow is straight, no error of the hand tells to which side it bends: the posture
    spring does.
    """
    # Torso and left arm, of a way to a pour.
    ways = [
        (-0.12, -0.23, 1.36, -0.89, -0.37, -0.5, -0.17, -0.83),
        (-0.3, -0.17, 1.06, -1.75, 0.19, -0.64, -0.59, -0.44),
        (-0.38, -0.53, 0.82, -2.01, 0.66, -0.78, -0.67, -0.12),
        (-0.36, -0.92, 0.97, -2.1, 0.93, -1.03, -0.62, 0.05),
    ]
    path = np.tile(START, (len(ways), 1))
    path[:, COLUMNS["left"]] = ways
    trajectory, bench = timed(Robot(), path, tool_speed=speed), Bench(q=path[0])
    farthest = 0.0
    while bench.robot.data.time < trajectory.duration:
        bench.goal, bench.speed = trajectory.at(bench.robot.data.time)
        bench.step()
        farthest = max(farthest, np.abs(bench.robot.observe().q - bench.goal).max())
    assert farthest < 0.15


def test_a_step_overshoots_as_a_damped_mass_does():
    """Ratio 0.7: a step of 20 mm overshoots by 5 % in theory; joint friction takes some of it."""
    bench = Bench()
    jacobian = bench.dynamics.terms(FRONT).jacobian
    wanted = np.zeros(12)
    wanted[2] = 0.02
    bench.goal = FRONT + np.linalg.pinv(jacobian) @ wanted
    heights = []
    start = bench.dynamics.grips(FRONT)[1][0, 2]
    for _ in range(500):
        bench.step()
        heights.append(bench.dynamics.grips(bench.robot.observe().q)[1][0, 2] - start)
    goal = bench.dynamics.grips(bench.goal)[1][0, 2] - start
    overshoot = max(heights) / goal - 1
    assert 0.0 < overshoot < 0.15
    assert heights[-1] == pytest.approx(goal, rel=0.02)


def test_joint_hold_feels_its_stiffness():
    """The held posture gives way as K says: 15 N at the hand bend the joints by J^T f / K."""
    bench = Bench(law="joint")
    bench.wrench[1] = 15.0
    bench.run(3.0)
    state = bench.robot.observe()
    jacobian = bench.dynamics.terms(state.q).jacobian
    expected = jacobian[1] * 15.0 / bench.hold.diagonal()
    np.testing.assert_allclose(state.q - FRONT, expected, atol=2e-3)
