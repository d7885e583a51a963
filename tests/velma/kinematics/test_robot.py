"""Forward kinematics: grips, their Jacobians and the camera agree with finite differences and with
MuJoCo.
"""

from itertools import pairwise

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from velma import names
from velma.kinematics.frames import standing
from velma.kinematics.robot import ROBOT_XML, FrameMissing, Robot, between, body_frame


@pytest.mark.parametrize("side", names.SIDES)
def test_grips_are_where_mujoco_has_them(robot: Robot, side: str, rng: np.random.Generator) -> None:
    """The grip of 50 random postures lies within a micrometre of MuJoCo's body of that name."""
    model = mujoco.MjModel.from_xml_path(str(ROBOT_XML))
    data = mujoco.MjData(model)
    columns = [model.joint(name).qposadr[0] for name in names.BODY]
    for _ in range(50):
        q = rng.uniform(robot.lower, robot.upper)
        data.qpos[columns] = q
        mujoco.mj_kinematics(model, data)
        body = data.body(names.GRIP_BODY[side])
        grip = robot.grip(q, side)
        np.testing.assert_allclose(grip.translation, body.xpos, atol=1e-6)
        np.testing.assert_allclose(grip.rotation, body.xmat.reshape(3, 3), atol=1e-6)


def test_the_camera_is_where_mujoco_has_it(robot: Robot, rng: np.random.Generator) -> None:
    """Torso and head joints move the Kinect's optical frame as they do in MuJoCo."""
    model = mujoco.MjModel.from_xml_path(str(ROBOT_XML))
    data = mujoco.MjData(model)
    columns = [model.joint(name).qposadr[0] for name in (names.BODY[0], *names.HEAD)]
    for _ in range(20):
        angles = rng.uniform(-1.0, 1.0, 3)
        data.qpos[columns] = angles
        mujoco.mj_kinematics(model, data)
        camera = robot.camera(*angles)
        np.testing.assert_allclose(camera.translation, data.body(names.CAMERA_BODY).xpos, atol=1e-6)
        np.testing.assert_allclose(
            camera.rotation, data.body(names.CAMERA_BODY).xmat.reshape(3, 3), atol=1e-6
        )


def test_a_grip_is_a_copy(robot: Robot) -> None:
    """A pose handed out does not change when the robot is asked about another posture."""
    first = robot.grip(names.START, "left")
    kept = first.translation.copy()
    robot.grip(names.START + 0.3, "left")
    np.testing.assert_array_equal(first.translation, kept)


def test_a_missing_body_is_named_with_those_that_exist(robot: Robot) -> None:
    """The error of an unknown body lists the bodies of the model."""
    with pytest.raises(FrameMissing, match="right_HandGripLink") as caught:
        body_frame(robot.model, "third_hand")
    assert caught.value.frame == "third_hand"


def test_poses_between_end_at_the_end() -> None:
    """A straight way ends exactly at its end, leaves its start out, and turns evenly."""
    start, end = standing((0.0, 0.0, 1.0)), standing((0.3, 0.0, 1.0), yaw=1.0)
    way = between(start, end, 4)
    assert len(way) == 4
    assert way[-1].isApprox(end, 1e-12)
    turns = [float(np.linalg.norm(pin.log3(a.rotation.T @ b.rotation))) for a, b in pairwise(way)]
    np.testing.assert_allclose(turns, 0.25, atol=1e-12)
