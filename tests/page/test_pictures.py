"""Pictures of the robot's telemetry as the page's browsers get them."""

import base64

import msgspec
import pytest

from companion.telemetry import Picture, RobotState
from services.page.app import Streams
from services.page.robot_eye import RobotEye
from services.page.view import PICTURES

STATE = RobotState(sim_time_s=1.5, body=(0.1,) * 15, mode="hold")


@pytest.fixture
def heard():
    """An eye that notes what it gives."""
    pictures, modes = [], []
    eye = RobotEye(None, lambda *picture: pictures.append(picture), modes.append)
    return eye, pictures, modes


def test_both_pictures_are_given_as_they_are(heard):
    """By name; an image of the page's own origin needs no request of the browser."""
    eye, pictures, modes = heard
    for told in (STATE, Picture(2.0, b"by the head", b"from the room"), STATE):
        eye._heard(msgspec.msgpack.encode(told))
    assert [name for name, _ in pictures] == list(PICTURES)
    files = [base64.b64decode(url.removeprefix("data:image/jpeg;base64,")) for _, url in pictures]
    assert files == [b"by the head", b"from the room"]
    assert modes == ["hold"]


@pytest.mark.parametrize("data", [b"", b"\xc1", msgspec.msgpack.encode({"type": "Picture", "rgb": b""})])
def test_what_is_no_telemetry_is_left_out(heard, data):
    """Anybody with the key may write there."""
    eye, pictures, modes = heard
    eye._heard(data)
    assert not pictures
    assert not modes


def test_a_slow_browser_gets_the_newest_picture_of_each_kind():
    """Older ones take no memory."""
    streams = Streams()
    for number in range(100):
        for name in PICTURES:
            streams.tell(name, name, b"%d" % number)
    assert [streams._newest[name][1] for name in PICTURES] == [
        b"event: %s\ndata: 99\n\n" % n.encode() for n in PICTURES
    ]
