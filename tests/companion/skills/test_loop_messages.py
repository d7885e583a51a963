"""The words between agent and loop."""

import msgspec
import numpy as np
import pytest

from companion.skills.loop_messages import (
    Cancel,
    Close,
    HeadGoal,
    Motion,
    Move,
    Payload,
    Release,
    motion,
)
from services.executor.loop.link import LoopCommand
from velma.errors import MotionError
from velma.names import START

KNOTS = np.stack([START, START + 0.01])


@pytest.mark.parametrize(
    "command",
    [
        motion(
            "a",
            KNOTS,
            head=HeadGoal(0.1, 0.2),
            left=Close(squeeze=0.7),
            payload_right=Payload(0.3, (0, 0, 0.04)),
        ),
        motion("b", START, until="touch", right=Close(squeeze=0.014)),
        motion("c", START, until="contact", contact_side="left", left=Move((0.5, 0.5, 0.5))),
        Cancel("a"),
        Release(),
    ],
)
def test_every_command_survives_its_way(command):
    """msgpack there and back is the same command."""
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(command), type=LoopCommand) == command


def test_knots_come_out_as_they_went_in():
    """(n, 15) float64, bit by bit; a single posture is one knot."""
    np.testing.assert_array_equal(motion("a", KNOTS).path(), KNOTS)
    assert motion("a", START).path().shape == (1, 15)


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"until": "touch"}, "until"),
        ({"contact_side": "middle"}, "contact_side"),
        ({"tolerance_m": -1.0}, "tolerance_m"),
        ({"settle_s": float("nan")}, "settle_s"),
    ],
)
def test_a_motion_that_cannot_be_is_refused_by_field(options, field):
    """The error says which field, what it is, and what it should be."""
    with pytest.raises(MotionError) as caught:
        motion("a", START, **options)
    assert caught.value.field == field


@pytest.mark.parametrize("knots", [np.full((2, 15), np.nan), np.zeros((2, 14)), np.zeros((0, 15))])
def test_knots_that_are_none_are_refused(knots):
    """Not finite, of the wrong width, or none at all."""
    with pytest.raises(MotionError, match="knots"):
        motion("a", knots)


def test_unknown_until_is_refused_by_the_decoder():
    """Words outside the vocabulary do not get in."""
    raw = msgspec.msgpack.encode({"type": "Motion", "key": "a", "knots": b"", "until": "sunset"})
    with pytest.raises(msgspec.ValidationError, match="until"):
        msgspec.msgpack.decode(raw, type=Motion)
