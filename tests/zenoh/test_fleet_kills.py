"""kill -9 of each agent and of the control loop in the middle of a task, restarted by the
supervisor.

The task ends, no act begins twice.
"""

from collections.abc import Callable, Iterator

import pytest
from roco_fleet import Moment, RocoFleet

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


BEFORE = {"take the jar": "put down the jar", "put down the jar": "take the jar"}


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RocoFleet]:
    """One fleet for all of these."""
    made = RocoFleet(tmp_path_factory.mktemp("kills") / "run")
    yield made
    made.down()


@pytest.mark.parametrize(
    ("victim", "text", "point"),
    [
        ("pl", "take the jar", searching),
        ("km", "put down the jar", acting),
        ("co", "take the jar", acting),
        ("ta", "put down the jar", acting),
        ("ex", "take the jar", taking),
        ("loop", "put down the jar", acting),
        ("loop", "take the jar", taking),
    ],
)
def test_killed_in_the_middle(
    fleet: RocoFleet, victim: str, text: str, point: Callable[[Moment], bool]
) -> None:
    """The task is done, or fails in words; the fleet is whole again; no act was begun twice."""
    fleet.do(BEFORE[text])  # a task that was killed may have failed, and left the jar elsewhere
    task = fleet.say(text)
    fleet.reach(task, point)
    restarts = fleet.restarts(victim)
    fleet.kill(victim)
    line = fleet.ended(task)
    assert line.state == "done" or (line.state == "failed" and line.text), line
    fleet.wait(
        lambda: fleet.restarts(victim) > restarts and fleet.whole(), "the fleet is whole again"
    )
    begun = fleet.acts_begun()
    assert len(begun) == len(set(begun)), begun
    assert fleet.do("look around").state == "done"
