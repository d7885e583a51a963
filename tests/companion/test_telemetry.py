"""Pictures beside the robot's state on one key: told apart, and whole."""

import msgspec
import pytest

from companion.telemetry import Found, Picture, RobotState, decoded

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
