"""The lane of faults: the same live and afterwards, those that go on at the same time side by
side.
"""

import msgspec
import pytest
from noted import Noted, live

from companion.tools.system import SYSTEM
from operate.fault_lines import Fault
from operate.pictures.stage import FAULTS, REST, Stage, of_history
from operate.recording import history
from operate.recording.records import FAULT, OPERATOR, House, Record


def lines(fault: Fault) -> list[House]:
    """A fault as it was noted: waiting, begun, ended."""
    waits = msgspec.structs.replace(fault, began=0.0, ended=None, t=fault.began - 1.0)
    begun = msgspec.structs.replace(fault, ended=None, t=fault.began)
    told = [waits, begun, *([fault] if fault.ended is not None else [])]
    return [House(FAULT, OPERATOR, one.target, one.t, msgspec.json.encode(one)) for one in told]


@pytest.fixture
def some(records: list[Record], past: history.History) -> list[Record]:
    """The synthetic run with three faults, two of which overlap and one of which is not healed."""
    at = past.begin
    faults = [
        ("a", "kill", "pl", at + 2.0, at + 4.0, ""),
        ("b", "hang", "ta", at + 3.0, at + 5.0, "ta:running"),
        ("c", "pause", "km", at + 6.0, None, ""),
    ]
    names = ("id", "kind", "target", "began", "ended", "at")
    made = [Fault(t=row[4] or row[3], **dict(zip(names, row, strict=True))) for row in faults]  # type: ignore[arg-type]
    more = [line for fault in made for line in lines(fault)]
    return sorted([*records, *more], key=lambda one: one.received)


def test_overlapping_faults_stand_side_by_side(some: list[Record], past: history.History) -> None:
    """Live as afterwards; what waits for its moment is not there."""
    hang = "hang ta at ta:running"
    states = (
        (2.0, "kill pl"),
        (3.0, f"kill pl, {hang}"),
        (4.0, hang),
        (5.0, REST),
        (6.0, "pause km"),
    )
    expected = list(states)
    sheet = Noted(past.begin)
    stage = Stage(sheet, SYSTEM)
    for happening in of_history(history.of_records(some, SYSTEM)):
        stage.take(happening)
    for drawn in (sheet, live(some, past.begin, past.begin + 9.0)):
        assert [(pytest.approx(at, abs=1e-6), state) for at, state in drawn.of(FAULTS)] == expected


def test_a_run_without_faults_has_no_lane(sheet: Noted) -> None:
    """Nor a static look of one."""
    assert sheet.of(FAULTS) == []
    assert FAULTS not in sheet.looks


def test_the_history_has_each_fault_once(some: list[Record]) -> None:
    """As its last line has it; the lines are not traffic."""
    past = history.of_records(some, SYSTEM)
    goes_on = {one.id: one.ended is None for one in past.faults}
    assert goes_on == {"a": False, "b": False, "c": True}
    assert FAULT not in past.houses
