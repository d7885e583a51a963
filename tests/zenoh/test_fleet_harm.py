"""Processes of a fleet that are killed, hang, or get no processor for a while, in the middle of a
task: the supervisor replaces them, the task ends, no act begins twice.
"""

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from roco_fleet import Moment, RocoFleet

from companion.skills.loop_messages import Mode, Phase

pytestmark = [pytest.mark.zenoh, pytest.mark.long, pytest.mark.timeout(300)]


def searching(now: Moment) -> bool:
    """The planner searches."""
    return now.planned()


def acting(now: Moment) -> bool:
    """An arm moves."""
    return now.moving("move-joint")


def taking(now: Moment) -> bool:
    """The jar is being pulled out."""
    return now.moving("move-cartesian")


def carrying(now: Moment) -> bool:
    """The jar is in the hand and moves."""
    return taking(now) and now.held("jar_1", "left")


def running(now: Moment) -> bool:
    """The robot carries out an act."""
    return now.told.report.phase is Phase.RUNNING


TAKE, PUT = "take the jar", "put down the jar"
BEFORE = {TAKE: PUT, PUT: TAKE}


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


def test_a_short_freeze_costs_nothing_but_time(one_fleet: RocoFleet) -> None:
    """The motion goes on where it was: no act ends otherwise, and no second plan is made."""
    task = one_fleet.say(TAKE)
    one_fleet.reach(task, carrying)
    with frozen(one_fleet, "ex"):
        one_fleet.wait(standing_still(one_fleet), "the world stands still")
        assert one_fleet.link.told().report.phase is Phase.RUNNING
    assert one_fleet.ended(task).state == "done"
    assert "act not done" not in (one_fleet.run / "ta.log").read_text()


def test_a_long_freeze_is_planned_again(one_fleet: RocoFleet) -> None:
    """The act is interrupted, the jar stays in the hand, and a new plan ends the task."""
    task, link = one_fleet.say(PUT), one_fleet.link
    one_fleet.reach(task, lambda now: running(now) and now.held("jar_1", "left"))
    with frozen(one_fleet, "ex"):
        given_up = lambda: link.told().report.phase is Phase.INTERRUPTED  # noqa: E731
        one_fleet.wait(given_up, "the loop gives the act up")
        one_fleet.wait(lambda: one_fleet.state().mode is Mode.HOLD, "the robot is held")
        assert one_fleet.truth().fingers_on["jar_1"]["left"] >= 3
    line = one_fleet.ended(task)
    assert line.state == "done", line
    assert "kind=interrupted" in (one_fleet.run / "ta.log").read_text()


@pytest.mark.parametrize(
    ("victim", "by", "text", "point"),
    [
        ("co", signal.SIGSTOP, TAKE, running),
        ("loop", signal.SIGSTOP, PUT, running),
        ("router", signal.SIGSTOP, TAKE, running),
        ("pl", signal.SIGKILL, TAKE, searching),
        ("km", signal.SIGKILL, PUT, acting),
        ("co", signal.SIGKILL, TAKE, acting),
        ("ta", signal.SIGKILL, PUT, acting),
        ("ex", signal.SIGKILL, TAKE, taking),
        ("loop", signal.SIGKILL, PUT, acting),
        ("loop", signal.SIGKILL, TAKE, taking),
    ],
)
def test_harmed_in_the_middle(
    one_fleet: RocoFleet,
    victim: str,
    by: signal.Signals,
    text: str,
    point: Callable[[Moment], bool],
) -> None:
    """The task is done, or fails in words where somebody was killed; the fleet is whole again; no
    act was begun twice.
    """
    one_fleet.do(BEFORE[text])  # a task that was harmed may have failed, and left the jar elsewhere
    task = one_fleet.say(text)
    one_fleet.reach(task, point)
    restarts = one_fleet.restarts(victim)
    os.kill(one_fleet.pid(victim), by)
    line = one_fleet.ended(task)
    failed = by is signal.SIGKILL and line.state == "failed" and line.text
    assert line.state == "done" or failed, line
    one_fleet.wait(
        lambda: one_fleet.restarts(victim) > restarts and one_fleet.whole(), "it is whole again"
    )
    begun = one_fleet.acts_begun()
    assert len(begun) == len(set(begun)), begun
    assert one_fleet.do("look around").state == "done"
