"""Two whole companions bid for tasks. The winner is killed in the middle of a pour: the other one
pours.
"""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from dispatch_fleet import Robots, dispatching

pytestmark = [pytest.mark.zenoh, pytest.mark.long, pytest.mark.timeout(900)]

POUR = '{ type = "PourInto", source = "jar", destination = "bowl" }'
LOOK = '{ type = "LookAround" }'
CALL_S, POUR_S, LOST_S = 120.0, 300.0, 15.0
"""Wall: until an order is awarded on a busy machine, until a pour is done, and until a bidder knows
that its robot is dead (agent_runtime.io.visiting: 3 looks of 1 s each with a wait of 1 s).
"""


@pytest.fixture
def robots(tmp_path: Path) -> Iterator[Robots]:
    """Both up."""
    made = Robots(tmp_path)
    yield made
    made.end()


def pours(robots: Robots, bidder: str) -> bool:
    """Whether content has left the robot's jar."""
    truth = robots.fleets[bidder].truth()
    return truth.tilt_deg["jar_1"] > 45.0


def poured(robots: Robots, bidder: str) -> float:
    """The share of the content that is in the robot's bowl."""
    truth = robots.fleets[bidder].truth()
    return truth.grains_in["bowl_1"] / truth.grains


def test_each_order_goes_to_the_soonest_robot_that_is_free(robots: Robots, tmp_path: Path) -> None:
    """The second one while the first is poured; what both systems recorded is as designed."""
    with dispatching(tmp_path, POUR, LOOK) as one:
        first, second = one.wait("awarded", 2, CALL_S)
        assert first["offers"] == 2
        assert {first["robot"], second["robot"]} == {"b1", "b2"}
        one.wait("done", 2, POUR_S)
        assert poured(robots, first["robot"]) > 0.9
        one.end()


def test_the_other_robot_pours_where_the_winner_is_killed(robots: Robots, tmp_path: Path) -> None:
    """kill -9 of all its processes in the middle of the pour: the bidder knows it in time, and the
    award goes to the next best.
    """
    with dispatching(tmp_path, POUR) as one:
        (award,) = one.wait("awarded", 1, CALL_S)
        winner = award["robot"]
        other = "b2" if winner == "b1" else "b1"
        robots.fleets[winner].wait(lambda: pours(robots, winner), "it pours", POUR_S)
        robots.kill(winner)
        killed = time.monotonic()
        one.wait("not done", 1, LOST_S)
        print(f"the bidder knew after {time.monotonic() - killed:.1f} s")
        _, again = one.wait("awarded", 2, CALL_S)
        assert again["robot"] == other
        one.wait("done", 1, POUR_S)
        assert poured(robots, other) > 0.9
        one.end()


def test_bidder_and_dispatcher_may_die(robots: Robots, tmp_path: Path) -> None:
    """kill -9 of di while both robots work, then of a bidder: its robot leaves the task safely, and
    the other robot does it.
    """
    with dispatching(tmp_path, POUR, LOOK) as one:
        first, _ = one.wait("awarded", 2, CALL_S)
        winner = first["robot"]
        one.kill("di")
        one.wait("done", 1, POUR_S)
        robots.fleets[winner].wait(
            lambda: robots.fleets[winner].hi.tasks()[-1].at is not None, "it moves", POUR_S
        )
        one.kill(winner)
        one.wait("done", 2, POUR_S)
        awards = [(line["order"], line["robot"]) for line in one.said("awarded")]
        assert [order for order, _ in awards] == [1, 2, 1]
        assert awards[2] != awards[0]
        states = [line.state for line in robots.fleets[winner].hi.tasks()]
        assert "cancelled" in states
        one.end()
