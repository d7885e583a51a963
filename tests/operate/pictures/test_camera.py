"""Pictures of the head camera, drawn at the place and time they were taken, from live records and
from a history.
"""

import math
from pathlib import Path

import msgspec
import pytest
from noted import Noted, afterwards

from companion.telemetry import Found, Picture, RobotState
from companion.tools.pictures.drawers import CAMERA, MARKERS
from companion.tools.system import SYSTEM
from companion.tools.telemetry import every
from operate.file_names import TRAFFIC_FILE
from operate.pictures.file import write
from operate.pictures.sheet import images, outlines
from operate.pictures.stage import Stage
from operate.recording import history, mcap_file
from operate.recording.happenings import Reader
from operate.recording.records import House, Record
from operate.recording.run import Run

FILES = [bytes([k, 2 * k, 255 - k] * 12) for k in (1, 50)]
SQUARE = (0.5, 0.5, 2.5, 0.5, 2.5, 2.5, 0.5, 2.5)
FOUND = [(), (Found("jar_1", 8, SQUARE), Found("bowl_1", 16, SQUARE))]
PICTURES = [Picture(10.0 + k, jpeg, b"room", FOUND[k]) for k, jpeg in enumerate(FILES)]


def house(at: float, data: object) -> House:
    """As it goes by."""
    return House("telemetry", "ex", "", at, msgspec.msgpack.encode(data))


@pytest.fixture
def seen() -> list[Record]:
    """Two pictures amid the robot's states, and what is none: one of an older recording."""
    state = RobotState(sim_time_s=1.0, body=(0.0,) * 15)
    old = {"type": "Picture", "sim_time_s": 12.0, "width": 4, "height": 3, "rgb": b""}
    return [
        house(100.0, state),
        *(house(101.0 + k, one) for k, one in enumerate(PICTURES)),
        house(103.0, old),
    ]


def test_pictures_are_drawn_live_and_afterwards(seen: list[Record]) -> None:
    """Each at its time; one of another form is left out."""
    sheet, reader = Noted(100.0), Reader(SYSTEM)
    stage = Stage(sheet, SYSTEM)
    for record in seen:
        for happening in reader.read(record):
            stage.take(happening)
    expected = [(1.0 + k, jpeg) for k, jpeg in enumerate(FILES)]
    assert sheet.of(CAMERA) == expected
    assert afterwards(history.of_records(seen, SYSTEM)).of(CAMERA) == expected


def test_markers_are_drawn_with_their_picture(seen: list[Record]) -> None:
    """None with the first, two with the second, by the names of their things; closed; a time
    without any is kept.
    """
    rows = afterwards(history.of_records(seen, SYSTEM)).of(MARKERS)
    named = [(at, [label for label, _ in found]) for at, found in rows]
    assert named == [(1.0, []), (2.0, ["jar_1", "bowl_1"])]
    corners = rows[1][1][0][1]
    assert corners.ravel().tolist() == list(SQUARE)
    drawn = outlines([found for _, found in rows])
    columns = [column.as_arrow_array().to_pylist() for column in drawn]
    assert [len(row) for row in columns[0]] == [0, 2]
    assert ["jar_1", "bowl_1"] in (row[1] for row in columns)
    closed = [[0.5, 0.5], [2.5, 0.5], [2.5, 2.5], [0.5, 2.5], [0.5, 0.5]]
    assert [list(point) for point in columns[0][1][0]] == closed


def test_the_picture_is_a_part_of_the_robot(seen: list[Record]) -> None:
    """It moves with the camera's link, and its lens has the field of view of 1.047 rad."""
    lens = afterwards(history.of_records(seen, SYSTEM)).looks[CAMERA]
    assert CAMERA.startswith("world/velma/")
    assert "head_tilt_link" in CAMERA
    (matrix,) = lens.image_from_camera.as_arrow_array().to_pylist()
    assert 2 * math.atan(200 / matrix[0]) == pytest.approx(1.047)


def test_states_beside_them_stay_what_they_are(seen: list[Record]) -> None:
    """A picture is not a state of the robot."""
    past = history.of_records(seen, SYSTEM)
    assert [at for at, _ in every(past, RobotState)] == [100.0]
    assert [at for at, _ in every(past, Picture)] == [101.0, 102.0]


def test_rerun_gets_each_picture_as_it_is() -> None:
    """As a JPEG file of its own."""
    drawn = images([FILES[0], b"longer" * 9])
    blobs, forms = (column.as_arrow_array().to_pylist() for column in drawn)
    assert [bytes(blob) for (blob,) in blobs] == [FILES[0], b"longer" * 9]
    assert forms == [["image/jpeg"]] * 2


def test_pictures_go_through_a_recording(seen: list[Record], tmp_path: Path) -> None:
    """Into traffic.mcap and out again, then into run.rrd: two more rows than without them."""
    file = mcap_file.Recording(tmp_path / TRAFFIC_FILE)
    for record in seen:
        file.add(record)
    file.finish()
    past = Run(tmp_path, SYSTEM).history
    assert [one for _, one in every(past, Picture)] == PICTURES
    assert write(tmp_path / "run.rrd", past, SYSTEM)[CAMERA] == 2


def test_a_recording_without_pictures_has_no_row_of_them(true_sheet: Noted) -> None:
    """One of an older version."""
    assert CAMERA not in true_sheet.rows
