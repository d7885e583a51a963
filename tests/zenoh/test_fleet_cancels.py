"""`roco cancel` at any time, over Zenoh with the simulated robot: what is held is put down, then it
goes on.
"""

from collections.abc import Callable

import numpy as np
import pytest
from roco_fleet import ENDED, Moment, RocoFleet, safely_down

from velma.kinematics.robot import Robot

pytestmark = [pytest.mark.zenoh, pytest.mark.long, pytest.mark.timeout(400)]

POUR = "pour the content of the jar into the bowl"
ROBOT = Robot()
JAR_AT = (0.85, 0.37, 1.28)  # on its shelf, but for the seed's variation


def searching(now: Moment) -> bool:
    """The planner searches."""
    return now.planned()


def hand_in_the_cabinet(now: Moment) -> bool:
    """The left hand is at the jar and has not closed on it."""
    grip = ROBOT.grip(now.state.q, "left").translation
    near = np.linalg.norm(grip - now.truth.at["jar_1"]) < 0.06
    return (
        now.moving("take jar_1/grasp") and bool(near) and now.truth.fingers_on["jar_1"]["left"] == 0
    )


def just_closed(now: Moment) -> bool:
    """The fingers are locked around the jar, which stands on its shelf."""
    return now.told.report.left.locked and now.at.endswith("take jar_1/grasp")


def half_out(now: Moment) -> bool:
    """The jar is in the air between its shelf and the open."""
    gone = np.linalg.norm(np.subtract(now.truth.at["jar_1"], JAR_AT)[:2])
    return now.moving("take jar_1/move-cartesian") and bool(0.15 < gone < 0.25)


def carrying(now: Moment) -> bool:
    """The jar is on its way to where it is out of the way."""
    return now.moving("carry jar_1/move-joint") and now.held("jar_1", "left")


def both_held(now: Moment) -> bool:
    """The bowl is in the right hand, too."""
    return (
        now.moving("take bowl_1/move-cartesian")
        and now.held("bowl_1", "right")
        and now.held("jar_1", "left")
    )


def above_the_table(now: Moment) -> bool:
    """The bowl is above the table and still in the hand."""
    return now.moving("place bowl_1/release") and now.held("bowl_1", "right")


def pouring(now: Moment) -> bool:
    """The jar is tilted and grains fall."""
    return now.truth.tilt_deg["jar_1"] > 90.0


@pytest.mark.parametrize(
    "points",
    [
        pytest.param((searching, hand_in_the_cabinet, just_closed, half_out), id="taking the jar"),
        pytest.param((carrying, both_held), id="carrying"),
        pytest.param((above_the_table, pouring), id="putting and pouring"),
    ],
)
def test_cancelled_there(fleet: RocoFleet, points: tuple[Callable[[Moment], bool], ...]) -> None:
    """One after the other: the task is cancelled there, everything stands upright and in no hand,
    and it goes on.
    """
    for point in points:
        task = fleet.say(POUR)
        fleet.reach(task, point)
        # as `roco cancel` does it, but without half a second for a process to start
        fleet.hi.cancel(task)
        line = fleet.ended(task)
        assert line.state == "cancelled", (point.__name__, line, fleet.logs())
        safely_down(fleet.truth())
    assert fleet.do("look around").state == "done"
    line = fleet.do("take the jar")  # wherever it was put
    assert line.state == "done", line


def test_cancelled_by_command(fleet: RocoFleet) -> None:
    """`roco cancel` ends the oldest task and leaves the one behind it, which is done."""
    first, second = fleet.say(POUR), fleet.say("look around")
    fleet.reach(first, searching)
    fleet.roco("cancel")
    assert fleet.ended(first).state == "cancelled"
    assert fleet.ended(second).state == "done"
    assert "nothing to cancel" in fleet.roco("cancel", code=1)


def test_a_more_urgent_task_interrupts(fleet: RocoFleet) -> None:
    """The held thing is put down first, the urgent task is done, then the first one from the world
    as it is then.
    """
    pour = fleet.say(POUR)
    fleet.reach(pour, lambda now: now.held("jar_1", "left"))
    fleet.roco("say", "look around", "--first")
    look = fleet.hi.tasks()[-1].task
    fleet.wait(
        lambda: fleet.task(pour).state == "suspended" or fleet.task(look).state in ENDED,
        "the pour is left",
    )
    assert fleet.task(look).state not in ENDED, fleet.hi.tasks()
    safely_down(fleet.truth())
    lines = [fleet.ended(task) for task in (look, pour)]
    assert [line.state for line in lines] == ["done"] * 2, lines
    assert lines[0].since < lines[1].since
    truth = fleet.truth()
    assert truth.grains_in["bowl_1"] >= 0.9 * truth.grains
