"""Pictures beside the robot's state on one key: told apart, whole, and never larger than they say."""

import tracemalloc
import zlib

import msgspec
import pytest

from companion.telemetry import MOST_PIXELS, Picture, RobotState, picture, told

STATE = RobotState(sim_time_s=1.5, body=(0.1,) * 15)
PIXELS = bytes(range(24))
PICTURE = picture(2.0, 4, 2, PIXELS)
encode = msgspec.msgpack.encode


def test_both_are_read_back() -> None:
    """Each as what it was; the pixels as they were."""
    assert told(encode(STATE)) == STATE
    found = told(encode(PICTURE))
    assert found == PICTURE
    assert isinstance(found, Picture)
    assert found.pixels() == PIXELS


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


@pytest.mark.parametrize(
    "wrong",
    [
        Picture(0.0, 4, 2, b"no zlib"),
        Picture(0.0, 4, 3, PICTURE.rgb),
        Picture(0.0, 4, 1, PICTURE.rgb),
        Picture(0.0, 0, 2, zlib.compress(b"")),
        Picture(0.0, -4, -2, PICTURE.rgb),
        Picture(0.0, MOST_PIXELS, 2, PICTURE.rgb),
        picture(0.0, 4, 2, bytes(100_000_000)),
        Picture(0.0, 4, 2, zlib.compress(bytes(range(24)), 0)[:-8]),
    ],
    ids=["no zlib", "less", "more", "none", "negative", "too large", "a bomb", "cut off"],
)
def test_a_picture_of_another_size_than_it_says_is_not_unpacked(wrong: Picture) -> None:
    """A process that reached the key cannot fill the monitor's memory."""
    with pytest.raises(ValueError, match="a picture"):
        wrong.pixels()


def test_a_bomb_takes_no_memory() -> None:
    """No more than the picture it says it is."""
    bomb = picture(0.0, 4, 2, bytes(100_000_000))
    tracemalloc.start()
    with pytest.raises(ValueError, match="or more"):
        bomb.pixels()
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 1_000_000
