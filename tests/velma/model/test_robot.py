"""The robot's file: written by the script, the same for both libraries, and what names.py says."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest
import yaml

from velma import names
from velma.model import build, tree
from velma.model.build import Kind


@pytest.fixture(scope="module")
def numbers():
    return yaml.safe_load((build.HERE / "robot.yaml").read_text())


@pytest.fixture(scope="module")
def both():
    """The same file in MuJoCo and in Pinocchio."""
    model = mujoco.MjModel.from_xml_path(str(tree.ROBOT_XML))
    return model, mujoco.MjData(model), pin.buildModelFromMJCF(str(tree.ROBOT_XML))


def random_states(model, count=50):
    """Positions within the limits and speeds of up to 1 rad/s."""
    rng = np.random.default_rng(7)
    for _ in range(count):
        yield rng.uniform(*model.jnt_range.T), rng.uniform(-1, 1, model.nv)


def test_committed_file_is_what_the_script_writes():
    """robot.xml is never edited by hand, and never forgotten."""
    assert tree.ROBOT_XML.read_text() == build.written()


def test_both_libraries_have_the_same_joints_masses_and_frames(both):
    """An array of one is an array of the other, every kilogram of the moving robot is in both, and
    every body stands where the other library has it.
    """
    model, data, other = both
    assert [model.joint(j).name for j in range(model.njnt)] == list(other.names)[1:]
    assert model.nv == other.nv == 33
    base = model.body("torso_base").mass[0]
    assert model.body_mass.sum() - base == pytest.approx(pin.computeTotalMass(other), abs=1e-9)
    scratch = other.createData()
    for q, _ in random_states(model, 20):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        pin.framesForwardKinematics(other, scratch, q)
        for body in range(1, model.nbody):
            frame = other.getFrameId(model.body(body).name, pin.FrameType.BODY)
            pose = scratch.oMf[frame]
            np.testing.assert_allclose(pose.translation, data.xpos[body], atol=1e-9)
            np.testing.assert_allclose(pose.rotation, data.xmat[body].reshape(3, 3), atol=1e-9)


def test_both_libraries_agree_on_bias_torque_and_mass_matrix(both):
    """Gravity, Coriolis and inertia with armature: the controller's model is the simulated
    robot.
    """
    model, data, other = both
    scratch = other.createData()
    dense = np.zeros((model.nv, model.nv))
    for q, v in random_states(model):
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, dense)
        mass = np.triu(pin.crba(other, scratch, q))
        np.testing.assert_allclose(mass + np.triu(mass, 1).T, dense, atol=1e-9)
        bias = pin.nonLinearEffects(other, scratch, q, v)
        np.testing.assert_allclose(bias, data.qfrc_bias, atol=1e-8)


def test_grips_stand_where_the_recorded_robot_has_them_and_nothing_touches(both):
    """Positions of the grip frames in the start posture, from the public model. The exclusions
    cover what touches by construction.
    """
    model, data, _ = both
    data.qpos[:] = 0.0
    for name, angle in zip(names.BODY, names.START, strict=True):
        data.joint(name).qpos[0] = angle
    mujoco.mj_forward(model, data)
    for side, at in (("right", (-0.0341, -0.4704, 0.4578)), ("left", (-0.0348, 0.4682, 0.4578))):
        np.testing.assert_allclose(data.body(f"{side}_HandGripLink").xpos, at, atol=1e-4)
    assert data.ncon == 0


def test_the_wrist_can_turn_the_hand_into_the_forearm(both):
    """The exclusions do not hide a hand that touches its own forearm: the wrist polygon is there
    for a reason.
    """
    model, data, _ = both
    rng = np.random.default_rng(3)
    touching = 0
    for _ in range(300):
        data.joint("right_arm_5_joint").qpos[0] = rng.uniform(-2, 2)
        data.joint("right_arm_6_joint").qpos[0] = rng.uniform(-2.9, 2.9)
        mujoco.mj_forward(model, data)
        geoms = data.contact.geom[: data.ncon].ravel()
        links = {model.body(model.geom_bodyid[geom]).name for geom in geoms}
        touching += any("arm_5" in link or "arm_4" in link for link in links)
    assert touching > 0


def test_looks_have_neither_mass_nor_contact(both):
    """Visual shapes cannot touch the physics."""
    model, _, _ = both
    looks = [g for g in range(model.ngeom) if "_look_" in model.geom(g).name]
    assert looks
    assert not model.geom_contype[looks].any()
    assert not model.geom_conaffinity[looks].any()


def test_grains_never_meet_the_robot():
    """A grain on the robot would cost a contact island of its own."""
    model = mujoco.MjModel.from_xml_path(str(tree.ROBOT_XML))
    assert not (model.geom_contype & Kind.GRAIN).any()
    assert not (model.geom_conaffinity & Kind.GRAIN).any()


def test_names_repeat_the_numbers(numbers, both):
    """names.py holds no number of its own."""
    model, _, _ = both
    ranges = np.array([model.joint(name).range for name in names.BODY])
    np.testing.assert_array_equal(ranges[:, 0], names.LOWER)
    np.testing.assert_array_equal(ranges[:, 1], names.UPPER)
    np.testing.assert_array_equal(
        [model.joint(name).range for name in names.HEAD],
        np.stack([names.HEAD_LOWER, names.HEAD_UPPER], 1),
    )
    joints = [body["joint"] for body in build.bodies(numbers) if "joint" in body]
    speeds = {joint["name"]: joint["speed"] for joint in joints}
    np.testing.assert_array_equal([speeds[name] for name in names.BODY], names.SPEED)
    torque = numbers["limits"]["accepted_torque"]
    np.testing.assert_array_equal([torque["torso"], *torque["arm"], *torque["arm"]], names.TORQUE)
    np.testing.assert_array_equal(numbers["postures"]["start"], names.START)
    np.testing.assert_array_equal(
        numbers["limits"]["wrist_polygon_right"], names.WRIST_POLYGON["right"]
    )
    assert numbers["limits"]["head_speed"] == names.HEAD_SPEED
    for side in names.SIDES:
        for joints, upper in (
            (names.PROXIMAL, names.FINGER_UPPER),
            (names.DISTAL, names.DISTAL_UPPER),
            (names.SPREAD, names.SPREAD_UPPER),
        ):
            assert {model.joint(name).range[1] for name in joints[side]} == {upper}


def test_other_joints_are_refused_with_the_first_difference():
    """An error that says where the order breaks."""
    swapped = [names.BODY[1], names.BODY[0], *names.BODY[2:]]
    with pytest.raises(names.JointsDiffer, match="index 0") as caught:
        names.check_joints("a model", swapped)
    assert caught.value.expected == names.BODY


def test_arms_mirror_each_other():
    """The left start posture is the right one with every sign changed."""
    np.testing.assert_array_equal(names.START[names.ARM["left"]], -names.START[names.ARM["right"]])
