"""The simulated and the pretended robot: the same face, and what only the simulated one can
show.
"""

import msgspec
import mujoco
import numpy as np
import pytest
from msgspec.structs import replace

from velma.model import scene
from velma.model.scene import Scene
from velma.names import FT_BODY, SPEED, START
from velma.sim.backend import PERIOD_S, no_command
from velma.sim.mock_backend import MockBackend
from velma.sim.mujoco_backend import LOCK_DISTAL, LOCK_PROXIMAL, MujocoBackend
from velma.sim.truth import TruthReader

EMPTY = Scene("empty")
EXACT = {"force": 0.0, "force_bias": 0.0, "torque": 0.0, "torque_bias": 0.0}


def noisy(whole=EMPTY, **noise):
    """A robot whose noise differs in this from that of its scene."""
    return MujocoBackend(replace(whole, noise=replace(whole.noise, **noise)))


def run(backend, command, seconds):
    for _ in range(round(seconds / backend.period_s)):
        backend.step(command)
    return backend.observe()


@pytest.fixture(params=["mujoco", "mock"])
def backend(request):
    """Each back-end in turn."""
    return MujocoBackend(EMPTY) if request.param == "mujoco" else MockBackend()


def test_a_robot_begins_in_the_start_posture_and_stays_without_a_command(backend):
    """Torques are beyond gravity: none at all is a robot at rest. (What else a back-end has to do
    is in services.executor.conformance.)
    """
    state = run(backend, no_command(), 1.0)
    np.testing.assert_allclose(state.q, START, atol=1e-3)
    assert np.abs(state.v).max() < 1e-2
    assert state.time == pytest.approx(1.0)


def test_only_the_locked_hand_is_stiff():
    """Locks are written into the model row by row, and taken back."""
    robot = MujocoBackend(EMPTY)
    command = no_command()
    command.locked[:] = 0.0, 1.0
    robot.step(command)
    friction = robot.model.dof_frictionloss
    assert not friction[robot._stiff_dofs[0]].any()
    assert (friction[robot._stiff_dofs[1]] == LOCK_PROXIMAL).all()
    assert (friction[robot._distal_dofs[1]] == LOCK_DISTAL).all()
    command.locked[:] = 0.0
    robot.step(command)
    assert not friction.any()


def test_a_simulation_can_be_had_again():
    """Same scene, same commands, same numbers, to the last bit; reading the state changes
    nothing.
    """
    whole, command = scene.vary(scene.load(), 4), no_command()
    command.tau[:] = np.linspace(-3, 3, 15)
    ends = []
    for looks in (0, 3):
        robot = MujocoBackend(whole)
        for _ in range(150):
            for _ in range(looks):
                robot.observe()
                robot.configuration()
            robot.step(command)
        ends.append(robot.configuration().tobytes())
    assert ends[0] == ends[1]


def test_sparse_and_dense_solutions_of_the_pile_agree():
    """MuJoCo 4.0.0 is said to factor wrongly in some sparse cases; not in this pile."""
    robot = MujocoBackend(scene.load())
    run(robot, no_command(), 0.4)
    accelerations = []
    for jacobian in (mujoco.mjtJacobian.mjJAC_SPARSE, mujoco.mjtJacobian.mjJAC_DENSE):
        data = mujoco.MjData(robot.model)
        data.qpos[:], data.qvel[:] = robot.data.qpos, robot.data.qvel
        robot.model.opt.jacobian = jacobian
        mujoco.mj_forward(robot.model, data)
        accelerations.append(data.qacc.copy())
    np.testing.assert_allclose(*accelerations, atol=1e-6)


def test_a_burst_simulation_stays_burst():
    """Bad numbers are not answered by a reset to the start: the loop must see them."""
    robot = MujocoBackend(EMPTY)
    run(robot, no_command(), 0.1)
    robot.data.qvel[0] = np.nan
    state = run(robot, no_command(), 0.004)
    assert not np.isfinite(state.v).all()
    assert state.time > 0.1


def test_truth_tells_where_everything_is():
    """Each thing's pose is that of its body in the simulation; each grain that is counted has a
    place.
    """
    robot = MujocoBackend(scene.load())
    run(robot, no_command(), 0.4)
    told = TruthReader(robot).read()
    assert told.models == {thing.id: thing.model for thing in scene.load().things}
    for name, (xyz, quat_wxyz) in told.poses.items():
        np.testing.assert_array_equal(xyz, robot.data.body(name).xpos)
        np.testing.assert_array_equal(quat_wxyz, robot.data.body(name).xquat)
    jar = np.array(told.at["jar_1"])
    assert len(told.grains_at) == told.grains == 30
    assert np.linalg.norm(np.array(told.grains_at) - jar, axis=1).max() < 0.12


def test_truth_survives_a_scene_without_vessels():
    """Nothing to count is a count of nothing, and travels."""
    truth = TruthReader(MujocoBackend(EMPTY)).read()
    assert truth.grains == 0
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(truth), type=type(truth)) == truth


def test_the_mock_obeys_its_speed_limits_and_its_fingers_stop_at_what_they_meet():
    """However hard it is pushed; closing by touch can be tried without physics."""
    robot, command = MockBackend(), no_command()
    robot.grasped[1] = 1.2
    command.tau[:] = 100.0
    command.proximal[:], command.distal[:] = 2.0, 0.6
    assert (run(robot, command, 1.0).v <= SPEED).all()
    state = run(robot, command, 1.0)
    np.testing.assert_allclose(state.proximal, [[2.0] * 3, [1.2] * 3])
    assert robot.period_s == PERIOD_S


def test_a_wrist_carries_its_hand_upwards():
    """At rest it reads the weight of all that hangs below the sensor, against gravity, in the
    sensor's axes.
    """
    robot = noisy(**EXACT)
    state = run(robot, no_command(), 1.0)
    for row, name in enumerate(FT_BODY.values()):
        weight = 9.81 * robot.model.body_subtreemass[robot.model.body(name).id]
        up = robot.data.body(name).xmat.reshape(3, 3).T @ (0.0, 0.0, 1.0)
        np.testing.assert_allclose(state.wrist[row, :3], weight * up, atol=0.01)


def test_wrist_sensors_err_as_the_scene_says():
    """A constant error within its range and white noise of its size; the same ones for the same
    seed.
    """
    errors = {"force": 0.2, "force_bias": 1.0, "torque": 0.01, "torque_bias": 0.05}
    true = run(noisy(**EXACT), no_command(), 1.0).wrist
    robots = [noisy(seed=3, **errors) for _ in range(2)]
    read = []
    for _ in range(1000):
        for robot in robots:
            robot.step(no_command())
        one, other = (robot.observe().wrist for robot in robots)
        np.testing.assert_array_equal(one, other)
        read.append(one - true)
    settled = np.array(read[500:])
    np.testing.assert_allclose(settled[:, :, :3].std(axis=0), 0.2, rtol=0.25)
    assert 0.1 < np.abs(settled[:, :, :3].mean(axis=0)).max() < 1.05


MEASURED = {"seed": 3, "joint": 1e-4, "delay": 1, "weight": 0.05, "mass": 0.1}


def test_joints_are_measured_as_the_scene_says():
    """With white noise, a cycle late; speeds are of two such positions."""
    exact, robot = MujocoBackend(EMPTY), noisy(joint=1e-4, delay=1)
    push = no_command()
    push.tau[0] = 5.0
    errors, late, before = [], [], exact.observe().q.copy()
    for _ in range(500):
        for one in (exact, robot):
            one.step(push)
        now, read = exact.observe(), robot.observe()
        errors.append(read.q - before)
        late.append(abs(read.q[0] - before[0]) < abs(read.q[0] - now.q[0]))
        before = now.q.copy()
    assert np.std(errors, axis=0) == pytest.approx(1e-4, rel=0.2)
    assert np.abs(np.mean(errors, axis=0)).max() < 2e-5
    assert np.mean(late[200:]) > 0.9, "the robot moves by more than the noise then"


def test_a_drive_that_errs_about_the_weight_lets_the_arm_move():
    """Each by its own share; without the error it holds still."""
    for share, moves in ((0.0, False), (0.1, True)):
        robot = noisy(weight=share)
        start = robot.observe().q.copy()
        assert bool(np.abs(run(robot, no_command(), 0.2).q - start).max() > 1e-3) is moves


def test_things_are_heavier_than_their_models_say():
    """Within the share, each by its own; what a robot knows of them does not change."""
    light, heavy = (noisy(scene.load(), mass=share) for share in (0.0, 0.1))
    vessels = ("jar_1", "bowl_1")
    factors = [heavy.model.body(v).mass[0] / light.model.body(v).mass[0] for v in vessels]
    assert all(0.9 <= factor <= 1.1 for factor in factors)
    assert abs(factors[0] - factors[1]) > 1e-3
    jar = heavy.model.body("jar_1").id
    inertia = factors[0] * light.model.body_inertia[jar]
    assert heavy.model.body_inertia[jar] == pytest.approx(inertia)


def test_a_restored_robot_measures_on_as_it_would_have():
    """With all its errors: the same states to the same commands. The wrists tell of the last step,
    which the restored world has not made.
    """
    one, other = (noisy(scene.load(), **MEASURED) for _ in range(2))
    run(one, no_command(), 0.1)
    other.restore(one.save())
    assert np.abs(other.observe().wrist).max() > 5.0
    for _ in range(20):
        seen, again = one.observe(), other.observe()
        for name in ("q", "v", "wrist"):
            np.testing.assert_array_equal(getattr(seen, name), getattr(again, name))
        one.step(no_command())
        other.step(no_command())
