"""Each mistake is found, by the check that is meant for it; what is right passes every one."""

import time

import msgspec
import point_mass
import pytest
import turned
import wrong_loops
from wrong_robots import MISTAKES

from services.executor.conformance import CHECKS, Subject, judged
from velma.model.scene import Scene
from velma.sim.mock_backend import MockBackend
from velma.sim.mujoco_backend import MujocoBackend

GOOD = {
    "mujoco": lambda: MujocoBackend(Scene("empty")),
    "mock": MockBackend,
    "point_mass": point_mass.make,
}
BY_NAME = {check.name: check for check in CHECKS}

# Wrong loop -> the part of the subject that it is, the check that must find it.
LOOPS = {
    "BlindPacer": ("pacer", "late-cycles"),
    "TornSlot": ("slot", "whole-records"),
    "Unlimited": ("core", "accepted-torques"),
    "Deaf": ("core", "stop-waits"),
    "Hasty": ("core", "stop-dwell"),
    "Pushing": ("core", "safe-throw"),
    "Fragile": ("core", "safe-lie"),
    "Orphan": ("process", "silent-agent"),
    "StopLess": ("process", "stop-file"),
    "Abrupt": ("process", "last-commands"),
    "Behind": ("process", "shown"),
}


@pytest.mark.timeout(180)
@pytest.mark.parametrize("name", GOOD)
def test_a_right_back_end_conforms(name: str) -> None:
    """The simulated robot, the pretended one, and the one that was written from
    docs/back-ends.md.
    """
    assert [
        str(result) for check in CHECKS if not (result := judged(check, Subject(GOOD[name]))).passed
    ] == []


@pytest.mark.timeout(180)
def test_a_wrong_back_end_is_found_by_the_check_for_it() -> None:
    """With a value, or a reason where nothing could be measured; never passed in silence."""
    for mistake, (name, make) in MISTAKES.items():
        most_s = 1.0 if name == "step-returns" else BY_NAME[name].most_s
        check = msgspec.structs.replace(BY_NAME[name], most_s=most_s)
        result = judged(check, Subject(make))
        assert not result.passed, mistake
        assert result.why, mistake
        assert result.value is None or result.value > check.limit, mistake


RACE = "TornSlot"


def found(mistake: str) -> bool:
    """Whether the check for it finds a wrong loop on a back-end that is right."""
    part, check = LOOPS[mistake]
    subject = msgspec.structs.replace(Subject(MockBackend), **{part: getattr(wrong_loops, mistake)})
    return not judged(BY_NAME[check], subject).passed


def test_a_wrong_loop_is_found_by_the_check_for_it() -> None:
    """On a back-end that is right."""
    assert [mistake for mistake in LOOPS if mistake != RACE and not found(mistake)] == []


@pytest.mark.process
def test_a_slot_that_is_torn_is_found() -> None:
    """Two processes read and write at the same time."""
    assert found(RACE)


def test_the_turned_drive_of_the_example_is_named() -> None:
    """As docs/back-ends.md shows."""
    result = judged(BY_NAME["own-joint"], Subject(turned.make))
    assert "right_arm_1_joint" in result.why


def test_every_check_has_a_mistake_that_it_finds() -> None:
    """But for those whose own fault is another check's mistake with other means."""
    found = {check for check, _ in MISTAKES.values()} | {check for _, check in LOOPS.values()}
    assert {check.name for check in CHECKS} - found <= {"safe-step"}


def test_a_robot_that_cannot_be_made_fails_with_its_own_words() -> None:
    """Any exception is reported with its words."""
    for raised in (RuntimeError("no robot at this address"), SystemExit(3)):
        result = judged(CHECKS[1], Subject(lambda raised=raised: (_ for _ in ()).throw(raised)))
        assert not result.passed
        assert str(raised) in result.why


def test_no_number_is_no_pass() -> None:
    """A measure that is NaN or infinite fails."""
    for value in (float("nan"), float("inf"), float("-inf")):
        check = msgspec.structs.replace(
            CHECKS[0], measure=lambda _, value=value: (value, "nowhere")
        )
        assert not judged(check, Subject(MockBackend)).passed


def test_a_paced_robot_is_stepped_at_its_period() -> None:
    """A second of cycles takes a second."""
    subject = Subject(MockBackend, paced=True)
    began = time.monotonic()
    assert judged(BY_NAME["time-keeps-pace"], subject).passed
    assert time.monotonic() - began >= 0.99
