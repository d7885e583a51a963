"""Each mistake is found, by the check that is meant for it; what is right passes every one."""

import msgspec
import point_mass
import pytest
import turned
import wrong_loops
import wrong_robots

from services.executor.conformance import CHECKS, Subject, Verdict, judged, run
from services.executor.conformance.judging import Check
from velma.model.scene import Scene
from velma.sim.mock_backend import MockBackend
from velma.sim.mujoco_backend import MujocoBackend

GOOD = {
    "mujoco": lambda: MujocoBackend(Scene("empty")),
    "mock": MockBackend,
    "point_mass": point_mass.make,
}
BY_NAME = {check.name: check for check in CHECKS}

# Mistake -> the check that must find it.
ROBOTS = {
    "Stale": "fresh",
    "Frozen": "own-joint",
    "InDegrees": "ranges",
    "SpeedInDegrees": "agreement",
    "SpeedTurned": "agreement",
    "TorqueTurned": "own-joint",
    "ArmsSwapped": "own-joint",
    "NoNumber": "numbers",
    "Endless": "joint-ends",
    "EndlessFingers": "servo-ends",
    "Latched": "stop-rest",
    "Coasting": "stop-way",
    "Sinking": "rest",
    "TimeGoesBack": "time-passes",
    "TimeInMilliseconds": "time-keeps-pace",
    "HalfAPeriod": "period",
    "LookingTakesTime": "looking",
    "Hanging": "step-returns",
    "Slow": "step-cost",
    "Growing": "memory",
    "SinglePrecision": "form",
    "HandsSwapped": "hands",
    "HeadSwapped": "head",
    "LooseLocks": "locks",
    "WorkGivenBack": "work",
    "WideWorld": "room",
    "ChangingWorld": "numbers",
    "Unforgiving": "safe-rest",
}
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


@pytest.mark.parametrize("check", CHECKS, ids=str)
@pytest.mark.parametrize("name", GOOD)
def test_a_right_back_end_conforms(name: str, check: Check) -> None:
    """The simulated robot, the pretended one, and the one that was written from docs/back-ends.md."""
    result = judged(check, Subject(GOOD[name]))
    assert result.passed, result


@pytest.mark.parametrize("mistake", ROBOTS)
def test_a_wrong_back_end_is_found_by_the_check_for_it(mistake: str) -> None:
    """With a value, or a reason where nothing could be measured; never passed in silence."""
    result = judged(BY_NAME[ROBOTS[mistake]], Subject(getattr(wrong_robots, mistake)))
    assert result.verdict is Verdict.FAILED, result
    assert result.why
    assert result.value is None or result.value > result.limit


RACE = "TornSlot"
"""Its reader and writer are two processes, which have to run at the same time."""


@pytest.mark.parametrize(
    "mistake", [pytest.param(one, marks=pytest.mark.process if one == RACE else ()) for one in LOOPS]
)
def test_a_wrong_loop_is_found_by_the_check_for_it(mistake: str) -> None:
    """On a back-end that is right."""
    part, check = LOOPS[mistake]
    subject = msgspec.structs.replace(Subject(MockBackend), **{part: getattr(wrong_loops, mistake)})
    assert judged(BY_NAME[check], subject).verdict is Verdict.FAILED


def test_the_turned_drive_of_the_example_is_named() -> None:
    """As docs/back-ends.md shows."""
    result = judged(BY_NAME["own-joint"], Subject(turned.make))
    assert "right_arm_1_joint" in result.why


def test_every_check_has_a_mistake_that_it_finds() -> None:
    """But for those whose own fault is another check's mistake with other means."""
    found = {*ROBOTS.values(), *(check for _, check in LOOPS.values())}
    assert {check.name for check in CHECKS} - found <= {"safe-step"}


def test_what_hangs_is_told_and_the_rest_is_not_tried() -> None:
    """A call that does not come back is its check's failure; the robot may still be in it."""

    def stands(_: Subject) -> tuple[float, str]:
        wrong_robots.time.sleep(0.5)
        return 0.0, ""

    hung = msgspec.structs.replace(CHECKS[1], measure=stands, most_s=0.05)
    first, second = run(Subject(MockBackend), (hung, CHECKS[2]))
    assert "does not return" in first.why
    assert (second.verdict, second.value) == (Verdict.FAILED, None)
    assert "not tried" in second.why


@pytest.mark.parametrize("raised", [RuntimeError("no robot at this address"), SystemExit(3)])
def test_a_robot_that_cannot_be_made_fails_with_its_own_words(raised: BaseException) -> None:
    """Any exception is reported with its words."""

    def make() -> MockBackend:
        raise raised

    results = list(run(Subject(make), CHECKS[:3]))
    assert all(result.verdict is Verdict.FAILED and str(raised) in result.why for result in results)


def test_no_number_is_no_pass() -> None:
    """A measure that is NaN or infinite fails."""
    for value in (float("nan"), float("inf"), float("-inf")):
        check = msgspec.structs.replace(CHECKS[0], measure=lambda _, value=value: (value, "nowhere"))
        assert judged(check, Subject(MockBackend)).verdict is Verdict.FAILED


def test_gentle_leaves_out_and_says_so() -> None:
    """Left out is not passed."""
    rough = [check for check in CHECKS if check.rough]
    results = list(run(Subject(MockBackend, gentle=True), rough))
    assert {result.verdict for result in results} == {Verdict.LEFT_OUT}
    assert not any(result.passed for result in results)


def test_a_paced_robot_is_stepped_at_its_period() -> None:
    """A second of cycles takes a second."""
    subject = Subject(MockBackend, paced=True)
    began = wrong_robots.time.monotonic()
    assert judged(BY_NAME["time-keeps-pace"], subject).passed
    assert wrong_robots.time.monotonic() - began >= 0.99
