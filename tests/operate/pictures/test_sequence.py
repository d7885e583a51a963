"""The newest communicates as arrows between lanes of agents; colours of channels beside those of
levels.
"""

import math

import pytest
from noted import Noted

from companion.design import DESIGN
from operate.pictures.sheet import CHANNELS, GREY, ORANGE, RED, channel, flat_arrows
from operate.pictures.stage import APART, ARROWS, MOST_LETTERS, ROW_HIGH, ROWS, ring
from operate.recording.history import History

TOLD_APART = 60.0
"""Of two colours by their red, green and blue, 0 to 255; estimate: a hue apart."""


def test_the_last_drawing_has_the_last_communicates(true_past: History, true_sheet: Noted) -> None:
    """In their order, each from its sender's lane to its receiver's, in its channel's colour."""
    said = sorted((*true_past.said, *true_past.copies), key=lambda one: one.received)[-ROWS:]
    at, rows = true_sheet.of(ARROWS)[-1]
    assert at == pytest.approx(said[-1].received - true_past.begin)
    assert len(rows) == ROWS
    lanes = ring(DESIGN)
    for row, (one, ((x, y), (along, down), text, colour)) in enumerate(
        zip(said, rows, strict=True), 1
    ):
        ends = lanes[round(x / APART)], lanes[round((x + along) / APART)]
        assert ends == (one.sender, one.receiver)
        assert (y, down) == (ROW_HIGH * row, 0.0)
        assert text.startswith(f"{one.conversation}: {one.performative}")
        assert len(text) <= MOST_LETTERS
        assert colour == channel(one.channel)


def test_it_is_not_drawn_for_each_communicate(true_past: History, true_sheet: Noted) -> None:
    """A search for a plan says hundreds within a second."""
    assert 10 < len(true_sheet.of(ARROWS)) < len(true_past.said) / 3


def test_rerun_gets_as_many_arrows_as_there_are_each_time() -> None:
    """One, then two."""
    one = ((0.0, 1.0), (2.0, 0.0), "said", RED)
    for column in flat_arrows([[one], [one, one]]):
        assert [*map(len, column.as_arrow_array().to_pylist())] == [1, 2]


def test_no_channel_looks_like_a_level_or_another_channel() -> None:
    """WARN is orange, ERROR red, DEBUG grey."""
    for number, one in enumerate(CHANNELS):
        for other in (*CHANNELS[:number], RED, ORANGE, GREY):
            assert math.dist(one, other) > TOLD_APART
