"""What the head camera sees is drawn where and when it was seen, from the records as they go by and from a history."""

from pathlib import Path

import msgspec
import pytest
from noted import Noted, afterwards

from companion.telemetry import Found, Picture, RobotState, picture
from companion.tools.pictures.camera import CAMERA, MARKERS
from companion.tools.system import SYSTEM
from companion.tools.telemetry import pictures, robot
from operate.pictures.file import write
from operate.pictures.happenings import Reader
from operate.pictures.sheet import images, outlines
from operate.pictures.stage import Stage
from operate.recording import history, mcap_file
from operate.recording.records import House, Record

PIXELS = [bytes([k, 2 * k, 255 - k] * 12) for k in (1, 50)]
SQUARE = (0.5, 0.5, 2.5, 0.5, 2.5, 2.5, 0.5, 2.5)
FOUND = [(), (Found("jar_1", 8, SQUARE), Found("bowl_1", 16, SQUARE))]
PICTURES = [picture(10.0 + k, 4, 3, pixels, FOUND[k]) for k, pixels in enumerate(PIXELS)]


def house(at: float, data: object) -> House:
    """As it goes by."""
    return House("telemetry", "ex", "", at, msgspec.msgpack.encode(data))


@pytest.fixture
def seen() -> list[Record]:
    """Two pictures amid the robot's states, and what is none."""
    state = RobotState(sim_time_s=1.0, body=(0.0,) * 15)
    bad = Picture(12.0, 4, 3, b"no picture")
    return [house(100.0, state), *(house(101.0 + k, one) for k, one in enumerate(PICTURES)), house(103.0, bad)]


def test_pictures_are_drawn_live_and_afterwards(seen: list[Record]) -> None:
    """Each at its time; one that cannot be unpacked is left out."""
    sheet, reader = Noted(100.0), Reader(SYSTEM)
    stage = Stage(sheet, SYSTEM)
    for record in seen:
        for happening in reader.read(record):
            stage.take(happening)
    expected = [(1.0 + k, (4, 3, pixels)) for k, pixels in enumerate(PIXELS)]
    assert sheet.of(CAMERA) == expected
    assert afterwards(history.merged(seen, {}, SYSTEM)).of(CAMERA) == expected


def test_markers_are_drawn_with_their_picture(seen: list[Record]) -> None:
    """None with the first, two with the second, by the names of their things; closed; a time without any is kept."""
    rows = afterwards(history.merged(seen, {}, SYSTEM)).of(MARKERS)
    assert [(at, [label for label, _ in found]) for at, found in rows] == [(1.0, []), (2.0, ["jar_1", "bowl_1"])]
    corners = rows[1][1][0][1]
    assert corners.ravel().tolist() == list(SQUARE)
    columns = [column.as_arrow_array().to_pylist() for column in outlines([found for _, found in rows])]
    assert [len(row) for row in columns[0]] == [0, 2]
    assert ["jar_1", "bowl_1"] in (row[1] for row in columns)
    assert [list(point) for point in columns[0][1][0]] == [[0.5, 0.5], [2.5, 0.5], [2.5, 2.5], [0.5, 2.5], [0.5, 0.5]]


def test_states_beside_them_stay_what_they_are(seen: list[Record]) -> None:
    """A picture is no state of the robot."""
    past = history.merged(seen, {}, SYSTEM)
    assert [at for at, _ in robot(past)] == [100.0]
    assert [at for at, _ in pictures(past)] == [101.0, 102.0, 103.0]


def test_pictures_of_another_size_may_follow() -> None:
    """Rerun takes each with its own size and bytes."""
    first, second = (4, 3, PIXELS[0]), (2, 2, bytes(range(12)))
    buffers, formats = (column.as_arrow_array().to_pylist() for column in images([first, second]))
    assert [bytes(buffer) for (buffer,) in buffers] == [first[2], second[2]]
    assert [(one["width"], one["height"]) for (one,) in formats] == [first[:2], second[:2]]


def test_pictures_go_through_a_recording(seen: list[Record], tmp_path: Path) -> None:
    """Into traffic.mcap and out again, then into run.rrd: two more rows than without them."""
    file = mcap_file.Recording(tmp_path / mcap_file.FILE)
    for record in seen:
        file.add(record)
    file.finish()
    past = history.load(tmp_path, SYSTEM)
    assert [one for _, one in pictures(past)[:2]] == PICTURES
    assert write(tmp_path / "run.rrd", past, SYSTEM)[CAMERA] == 2


def test_a_recording_without_pictures_has_no_row_of_them(true_sheet: Noted) -> None:
    """One of an older version."""
    assert CAMERA not in true_sheet.rows
