"""Processes that get no processor: for a while, and the arms rest; for good, and another takes
over.
"""

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from roco_fleet import Moment, RocoFleet

from companion.skills.loop_messages import Mode, Phase

pytestmark = [pytest.mark.zenoh, pytest.mark.long, pytest.mark.timeout(300)]


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RocoFleet]:
    """One fleet for both."""
    made = RocoFleet(tmp_path_factory.mktemp("frozen") / "run")
    yield made
    made.down()


def carrying(now: Moment) -> bool:
    """The jar is in the hand and moves."""
    return now.moving("move-cartesian") and now.held("jar_1", "left")


@contextmanager
def frozen(fleet: RocoFleet, name: str) -> Iterator[None]:
    """A process stopped by a signal until the end of the block."""
    os.kill(fleet.pid(name), signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(fleet.pid(name), signal.SIGCONT)


def standing_still(fleet: RocoFleet) -> Callable[[], bool]:
    """Whether simulated time has stood still since the last look."""
    seen = [-1.0]

    def still() -> bool:
        before, seen[0] = seen[0], fleet.state().time_s
        return before == seen[0]

    return still


def test_a_short_freeze_costs_nothing_but_time(fleet: RocoFleet) -> None:
    """The motion goes on where it was: no act ends otherwise, and no second plan is made."""
    task = fleet.say("take the jar")
    fleet.reach(task, carrying)
    with frozen(fleet, "ex"):
        fleet.wait(standing_still(fleet), "the world stands still")
        assert fleet.link.told().report.phase is Phase.RUNNING
    assert fleet.ended(task).state == "done"
    assert "act not done" not in (fleet.run / "ta.log").read_text()


def test_a_long_freeze_is_planned_again(fleet: RocoFleet) -> None:
    """The act is interrupted, the jar stays in the hand, and a new plan ends the task."""
    task = fleet.say("put down the jar")
    fleet.reach(
        task, lambda now: now.told.report.phase is Phase.RUNNING and now.held("jar_1", "left")
    )
    with frozen(fleet, "ex"):
        fleet.wait(
            lambda: fleet.link.told().report.phase is Phase.INTERRUPTED, "the loop gives the act up"
        )
        fleet.wait(lambda: fleet.state().mode is Mode.HOLD, "the robot is held")
        assert fleet.truth().fingers_on["jar_1"]["left"] >= 3
    line = fleet.ended(task)
    assert line.state == "done", line
    assert "kind=interrupted" in (fleet.run / "ta.log").read_text()


HUNG = [("co", "take the jar"), ("loop", "put down the jar"), ("router", "take the jar")]


@pytest.mark.parametrize(("victim", "text"), HUNG)
def test_one_that_hangs_for_good_is_replaced(fleet: RocoFleet, victim: str, text: str) -> None:
    """The supervisor ends it and starts another; the task is done all the same."""
    task = fleet.say(text)
    fleet.reach(task, lambda now: now.told.report.phase is Phase.RUNNING)
    restarts = fleet.restarts(victim)
    os.kill(fleet.pid(victim), signal.SIGSTOP)
    assert fleet.ended(task).state == "done"
    fleet.wait(
        lambda: fleet.restarts(victim) > restarts and fleet.whole(), "the fleet is whole again"
    )
