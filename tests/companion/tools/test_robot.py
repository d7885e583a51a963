"""The picture's kinematics is the robot's."""

import json

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from companion.telemetry import Found, Picture, RobotState, decoded
from companion.tools.pictures import robot
from console.__main__ import app
from velma.kinematics.frames import transform
from velma.kinematics.robot import Robot
from velma.model import tree, urdf
from velma.names import BODY, DISTAL, GRIP_BODY, HEAD, LOWER, PROXIMAL, SIDES, SPREAD, UPPER

LINKS = tree.links()
VELMA = Robot()


@settings(max_examples=20, deadline=None)
@given(st.lists(st.floats(0.0, 1.0), min_size=15, max_size=15))
def test_hands_are_where_pinocchio_says(shares):
    """Grip frames agree with those of velma.kinematics in every posture."""
    q = LOWER + np.array(shares) * (UPPER - LOWER)
    frames = robot.world_frames(LINKS, dict(zip(BODY, q, strict=True)))
    for side in SIDES:
        found = transform(frames[GRIP_BODY[side]])
        assert np.allclose(found.homogeneous, VELMA.grip(q, side).homogeneous, atol=1e-9)


def test_telemetry_names_every_joint_of_the_model():
    """All joints get a position, and only they."""
    named = robot.joints(RobotState(sim_time_s=0.0, body=(0.0,) * 15))
    hands = {joint for of in (SPREAD, PROXIMAL, DISTAL) for side in SIDES for joint in of[side]}
    assert set(named) == {*BODY, *HEAD} | hands
    assert set(named) == {link.joint for link in LINKS if link.joint}


def test_links_have_looks():
    """There is something to see of torso, arms, hands and head."""
    seen = {link.name for link in LINKS if link.shapes}
    assert {"torso_link0", "right_arm_4_link", "left_HandPalmLink"} <= seen


# --- Pictures beside the robot's state on one key: told apart, and whole


STATE = RobotState(sim_time_s=1.5, body=(0.1,) * 15)
PICTURE = Picture(
    2.0, bytes(range(24)), b"room", (Found("jar_1", 8, (0.5, 0.5, 2.5, 0.5, 2.5, 2.5, 0.5, 2.5)),)
)
encode = msgspec.msgpack.encode


def test_a_picture_and_a_state_are_told_apart():
    """Each is read back as what it was; neither is taken for the other by whoever knows one of them
    only: every reader of before, and the history.
    """
    for one, other in ((STATE, Picture), (PICTURE, RobotState)):
        assert decoded(encode(one)) == one
        with pytest.raises(msgspec.MsgspecError):
            msgspec.msgpack.decode(encode(one), type=other)


def test_anything_else_is_an_error():
    """Of the one kind that readers catch."""
    for data in (
        b"",
        b"\xc1",
        encode({"type": "Film"}),
        encode({"type": 3}),
        encode([1]),
        encode({}),
    ):
        with pytest.raises(msgspec.MsgspecError):
            decoded(data)


# --- `roco urdf`


def test_the_model_is_written_where_it_is_wanted(tmp_path):
    """As it is made, with what is in it; a folder that is not there is named."""
    done = CliRunner().invoke(app, ["urdf", str(tmp_path / "velma.urdf"), "--format", "json"])
    told = {"file": str(tmp_path / "velma.urdf"), "links": len(LINKS), "joints": 33}
    assert (done.exit_code, json.loads(done.stdout)) == (0, told)
    assert (tmp_path / "velma.urdf").read_text() == urdf.written()
    done = CliRunner().invoke(app, ["urdf", str(tmp_path / "nowhere" / "velma.urdf")])
    assert done.exit_code == 2
    assert "nowhere" in done.stderr
