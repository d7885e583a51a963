"""A stop in words and its release with router and agents dead: the loop holds, nothing falls, and
then it goes on.
"""

import pytest
from roco_fleet import Moment, RocoFleet, safely_down

from companion.languages.facts import Kind, fact, with_reasons
from companion.skills.loop_messages import Mode

pytestmark = [pytest.mark.zenoh, pytest.mark.long, pytest.mark.timeout(400)]


def carrying(now: Moment) -> bool:
    """The jar is on its way to where it is out of the way."""
    return now.moving("carry jar_1/move-joint") and now.held("jar_1", "left")


def test_stopped_with_everybody_dead(fleet: RocoFleet) -> None:
    """The robot stands with the jar in its hand until it is released; then the next command is
    done.
    """
    task = fleet.say("pour the content of the jar into the bowl")
    fleet.reach(task, carrying)
    fleet.kill("ex", "router", "hi")
    fleet.roco("say", "STOP!!!")
    fleet.wait(lambda: fleet.state().mode is Mode.STOPPED, "the loop holds the robot")
    stood = fleet.state().q.copy()
    fleet.wait(lambda: fleet.restarted("ex", "router", "hi"), "the supervisor has restarted them")
    line = fleet.ended(task)
    assert line.state == "failed", line
    assert any(one.kind is Kind.HELD_STILL for one in with_reasons(line.why)), line
    assert fleet.state().mode is Mode.STOPPED
    assert abs(fleet.state().q - stood).max() < 0.02
    assert fleet.truth().fingers_on["jar_1"]["left"] >= 3
    fleet.roco("release")
    fleet.wait(lambda: fleet.state().mode is Mode.MOTION, "the loop can be commanded again")
    line = fleet.do("pour the content of the jar into the bowl")
    assert line.state == "done", line
    truth = fleet.truth()
    assert truth.grains_in["bowl_1"] >= 0.9 * truth.grains


def test_stopped_in_the_middle(fleet: RocoFleet) -> None:
    """With all agents alive the task fails at once and says that a person did it; after the release
    it goes on.
    """
    task = fleet.say("take the jar")
    fleet.reach(task, lambda now: now.moving("move-cartesian") and now.held("jar_1", "left"))
    assert fleet.hi.say("careful!").state == "stopped"
    line = fleet.ended(task)
    assert (line.state, line.why) == ("failed", (fact(Kind.HELD_STILL, Mode.STOPPED),)), line
    assert fleet.truth().fingers_on["jar_1"]["left"] >= 3
    fleet.roco("release")
    fleet.wait(lambda: fleet.state().mode is Mode.MOTION, "the loop can be commanded again")
    line = fleet.do("put down the jar")
    assert line.state == "done", line
    safely_down(fleet.truth())
