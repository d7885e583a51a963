"""Pictures beside the robot's state on one key: told apart, and whole."""

import msgspec
import pytest

from companion.telemetry import Found, Picture, RobotState, told

STATE = RobotState(sim_time_s=1.5, body=(0.1,) * 15)
PICTURE = Picture(2.0, bytes(range(24)), b"room", (Found("jar_1", 8, (0.5, 0.5, 2.5, 0.5, 2.5, 2.5, 0.5, 2.5)),))
encode = msgspec.msgpack.encode


def test_both_are_read_back() -> None:
    """Each as what it was."""
    assert told(encode(STATE)) == STATE
    assert told(encode(PICTURE)) == PICTURE


def test_neither_is_taken_for_the_other() -> None:
    """By whoever knows one of them only: every reader of before, and the history."""
    for one, other in ((STATE, Picture), (PICTURE, RobotState)):
        with pytest.raises(msgspec.MsgspecError):
            msgspec.msgpack.decode(encode(one), type=other)


@pytest.mark.parametrize("data", [b"", b"\xc1", encode({"type": "Film"}), encode({"type": 3}), encode([1]), encode({})])
def test_anything_else_is_an_error(data: bytes) -> None:
    """Of the one kind that readers catch."""
    with pytest.raises(msgspec.MsgspecError):
        told(data)
