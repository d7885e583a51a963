"""Velma as URDF: the robot of robot.xml for those who read no MJCF."""

import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from rerun.urdf import UrdfTree

from velma.model import tree, urdf
from velma.names import BODY, SPEED

LINKS = tree.links()
JOINTS = [link.joint for link in LINKS if link.joint]
CLOSE = 1e-9
"""Metres, entries of a rotation, kg m2."""


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    place = tmp_path_factory.mktemp("model") / "velma.urdf"
    place.write_text(urdf.written(), encoding="utf-8")
    return place


class InMujoco:
    """A file as MuJoCo has it."""

    def __init__(self, path: Path) -> None:
        self.model = mujoco.MjModel.from_xml_path(str(path))
        self.data = mujoco.MjData(self.model)

    def frames(self, q):
        for joint, angle in q.items():
            self.data.joint(joint).qpos = angle
        mujoco.mj_forward(self.model, self.data)
        bodies = ((link.name, self.data.body(link.name)) for link in LINKS)
        return {name: (body.xpos.copy(), body.xmat.reshape(3, 3).copy()) for name, body in bodies}

    def inertia(self):
        """The mass matrix in the order of JOINTS, without armature."""
        full = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, full)
        rows = [self.model.joint(joint).dofadr[0] for joint in JOINTS]
        return (full - np.diag(self.model.dof_armature))[np.ix_(rows, rows)]


class InPinocchio:
    """A URDF file as Pinocchio has it."""

    def __init__(self, path: Path) -> None:
        self.model = pin.buildModelFromUrdf(str(path))
        self.data = self.model.createData()

    def frames(self, q):
        self.q = pin.neutral(self.model)
        for joint, angle in q.items():
            self.q[self.model.joints[self.model.getJointId(joint)].idx_q] = angle
        pin.framesForwardKinematics(self.model, self.data, self.q)
        ids = {link.name: self.model.getFrameId(link.name, pin.FrameType.BODY) for link in LINKS}
        placed = {name: self.data.oMf[one] for name, one in ids.items()}
        return {name: (pose.translation, pose.rotation) for name, pose in placed.items()}

    def inertia(self):
        half = np.triu(pin.crba(self.model, self.data, self.q))
        rows = [self.model.joints[self.model.getJointId(joint)].idx_v for joint in JOINTS]
        return (half + np.triu(half, 1).T)[np.ix_(rows, rows)]


@pytest.mark.parametrize("library", [InMujoco, InPinocchio])
def test_kinematics_and_mass_matrix_are_those_of_robot_xml(file, library):
    """In random postures; of each link, those fixed to others too."""
    truth, other = InMujoco(tree.ROBOT_XML), library(file)
    random = np.random.default_rng(7)
    for _ in range(50):
        q = {link.joint: random.uniform(*link.limits) for link in LINKS if link.joint}
        wanted, found = truth.frames(q), other.frames(q)
        for name, (at, turn) in wanted.items():
            np.testing.assert_allclose(found[name][0], at, atol=CLOSE)
            np.testing.assert_allclose(found[name][1], turn, atol=CLOSE)
        np.testing.assert_allclose(other.inertia(), truth.inertia(), atol=CLOSE)


def test_limits_damping_and_coupling_are_those_of_robot_xml(file):
    """Torque and speed of a drive, too."""
    model = pin.buildModelFromUrdf(str(file))
    source = mujoco.MjModel.from_xml_path(str(tree.ROBOT_XML))
    root = ET.parse(file).getroot()
    for joint in root.iter("joint"):
        if joint.get("type") != "revolute":
            continue
        name = joint.attrib["name"]
        row = model.joints[model.getJointId(name)].idx_v
        wanted = source.joint(name)
        assert (model.lowerPositionLimit[row], model.upperPositionLimit[row]) == pytest.approx(
            tuple(wanted.range)
        )
        assert model.damping[row] == pytest.approx(wanted.damping[0])
    for name, speed in zip(BODY, SPEED, strict=True):
        row = model.joints[model.getJointId(name)].idx_v
        assert model.velocityLimit[row] == pytest.approx(speed)
        assert model.effortLimit[row] == source.actuator(name).ctrlrange[1]
    followers = {one.get("name"): one.find("mimic") for one in root.iter("joint")}
    assert {name: mimic.get("joint") for name, mimic in followers.items() if mimic is not None} == {
        f"{side}_HandFingerTwoKnuckleOneJoint": f"{side}_HandFingerOneKnuckleOneJoint"
        for side in ("right", "left")
    }


def test_contact_shapes_stand_where_those_of_robot_xml_do(file):
    """As many, of the same sizes, at the same places of the zero posture."""

    def touching(path):
        model = mujoco.MjModel.from_xml_path(str(path))
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        rows = [row for row in range(model.ngeom) if model.geom_contype[row]]
        return np.array(
            sorted([*model.geom_size[row], *data.geom_xpos[row].round(7)] for row in rows)
        )

    np.testing.assert_allclose(touching(file), touching(tree.ROBOT_XML), atol=1e-6)


def test_check_urdf_accepts_it(file):
    """The checker of ROS: one tree from torso_base."""
    checker = Path(sys.executable).with_name("check_urdf")
    done = subprocess.run([checker, file], capture_output=True, text=True, timeout=50, check=True)
    assert "Successfully Parsed XML" in done.stdout
    assert "root Link: torso_base" in done.stdout
    assert {link.name for link in LINKS} <= set(re.findall(r"\w+", done.stdout))


def test_rerun_reads_it(file):
    """Each joint stands as the tree says, and there is something to see of the arms."""
    read = UrdfTree.from_file_path(file)
    assert len(read.joints()) == len(LINKS) - 1
    for link in LINKS:
        if link.joint:
            joint = read.get_joint_by_name(link.joint)
            assert (joint.child_link, joint.parent_link) == (link.name, link.path[-2])
            assert joint.origin_xyz == pytest.approx(link.at)
    assert read.get_visual_geometry_paths("right_arm_4_link")


def test_looks_cover_those_of_robot_xml():
    """A capsule's parts and an ellipsoid's discs reach as far as it does along its axes, and no
    farther than a disc is thick.
    """
    turn = (0.5, 0.5, 0.5, 0.5)  # x becomes y, y becomes z, z becomes x
    capsule = tree.Shape("capsule", (0.1, 0.4), (1.0, 0.0, 0.0), turn, tree.GREY)
    rod, *balls = urdf.parts(capsule)
    assert (rod.kind, rod.size) == ("cylinder", (0.1, 0.4))
    assert [ball.at for ball in balls] == [pytest.approx((x, 0, 0)) for x in (0.8, 1.2)]
    ball = tree.Shape("ellipsoid", (0.3, 0.3, 0.09), (0.0, 0.0, 0.0), turn, tree.GREY)
    discs = list(urdf.parts(ball))
    reach = [disc.at[0] + disc.size[1] / 2 for disc in discs]
    assert max(reach) == pytest.approx(0.09)
    assert 0.29 < max(disc.size[0] for disc in discs) <= 0.3


@pytest.mark.parametrize("off", [0.0, 1e-12, 1e-9, 1e-6, 0.3])
def test_angles_are_exact_near_a_right_angle_too(off):
    """There roll and yaw turn about one axis, and each alone is lost in rounding."""
    random = np.random.default_rng(7)
    for sign in (-1, 1):
        for roll, yaw in random.uniform(-np.pi, np.pi, (20, 2)):
            wanted = pin.rpy.rpyToMatrix(roll, sign * (np.pi / 2 - off), yaw)
            x, y, z, w = pin.Quaternion(wanted).coeffs()
            found = pin.rpy.rpyToMatrix(*urdf.rpy((w, x, y, z)))
            np.testing.assert_allclose(found, wanted, atol=1e-12)
