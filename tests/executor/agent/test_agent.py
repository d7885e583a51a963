"""ex's agent: one act at a time, refusals in words, what a death leaves of an act, cancels before
and in an act.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from pretended_robot import Robot, World
from scripted_partner import Open, Say, partner

from agent_runtime.testing.memory_bus import MemoryBus, Point
from companion.design import wiring
from companion.languages import rc
from companion.languages.facts import Kind, fact
from companion.languages.values import Pose, Side
from fipa_codec.performatives import Performative as P
from services.executor import behaviours
from services.executor.outgoing_messages import wrong

MOVE = rc.MoveJoint("m1", Side.LEFT, ((0.0,) * 8,), 0.3)
GRASP = rc.Grasp(
    "g1", Side.LEFT, "jar_1", "g", (rc.ApproachPoint(Pose((0.0, 0.0, 0.0)), 0.5),), 0.1, 0.3, 0.2
)


class Scene:
    """ex and a scripted ta."""

    def __init__(self, looks: bool = False) -> None:
        self.wires, self.world = MemoryBus(), World()
        self.heard: list[tuple[int, str, Any]] = []
        self.wires.add(partner("ta", self.heard), wiring("ta", "test"))

        def later(delay: float, call: Callable[[], None]) -> None:
            self.wires._at(self.wires.now + delay, call)

        ex = behaviours.agent(), wiring("ex", "test")
        self.wires.add(*ex, lambda post: Robot(post, self.world, later, looks))

    def ask(self, command: rc.Command) -> None:
        self.wires.post("ta", Open("ex", "request", P.REQUEST, command))

    def until(self, *performatives: str) -> None:
        """Go on until these were heard, in this order and no others."""
        self.wires.run(lambda: len(self.heard) >= len(performatives))
        assert tuple(word for _, word, _ in self.heard) == performatives, self.heard

    @property
    def last(self) -> Any:
        return self.heard[-1][2]


@pytest.fixture
def scene() -> Scene:
    return Scene()


@pytest.mark.parametrize("looks", [False, True])
def test_an_act(looks: bool) -> None:
    """agree tells the expected duration, inform how the robot stands and what it holds. Looks
    change nothing.
    """
    scene = Scene(looks)
    scene.ask(GRASP)
    scene.until("agree", "inform")
    assert scene.heard[0][2].duration > 0.0
    assert scene.last.held[Side.LEFT][0] == "jar_1"
    assert scene.wires.nodes["ex"].state.state == "idle"
    assert (scene.world.looks, scene.world.begun) == (2 * looks, ["g1", "g1"])


SENSELESS = (
    (rc.MoveJoint("a", Side.LEFT, (), 0.3), "path", "empty"),
    (rc.MoveJoint("a", Side.LEFT, ((0.0,) * 7,), 0.3), "path", "8 joints"),
    (rc.MoveJoint("a", Side.LEFT, ((float("nan"),) * 8,), 0.3), "path[0][0]", "finite"),
    (rc.MoveJoint("a", Side.LEFT, ((0.0,) * 8,), 0.0), "speed", "finite"),
    (rc.MoveJoint("", Side.LEFT, ((0.0,) * 8,), 0.3), "key", "empty"),
    (rc.MoveCartesian("a", Side.LEFT, ()), "segments", "empty"),
    (rc.Grasp("a", Side.LEFT, "jar_1", "g", (), 0.1, 0.3, 0.2), "approach", "empty"),
    (rc.Look("a", ()), "at", "point"),
)


def test_what_makes_no_sense_is_refused(scene: Scene) -> None:
    """Nothing moves, the reason names what is wrong, and the next act is served."""
    for command, field, words in SENSELESS:
        found = wrong(command)
        assert found is not None, command
        assert words in found.text, command
        scene.ask(command)
        scene.wires.run(lambda: bool(scene.heard))
        ((_, word, content),) = scene.heard
        assert (word, content.why) == ("refuse", (fact(Kind.BAD_COMMAND, field),)), command
        assert not scene.world.begun
        scene.heard.clear()
    scene.ask(MOVE)
    scene.until("agree", "inform")


def test_a_key_is_begun_once(scene: Scene) -> None:
    """The same key again is refused, whatever became of it."""
    scene.ask(MOVE)
    scene.until("agree", "inform")
    scene.ask(MOVE)
    scene.until("agree", "inform", "refuse")
    assert scene.last.why == (fact(Kind.BEGUN_BEFORE),)


FIRST = ((False, 1), (True, 5))
STEPS = [(looks, step) for looks, first in FIRST for step in range(first, first + 11)]
DEATHS = [(point, *row) for point in Point for row in STEPS]


def test_a_death_in_an_act(some: Callable[[Sequence[Any], int], list[Any]]) -> None:
    """The act is done once or unknown, it is never begun again, and what ex holds it still
    knows.
    """
    for point, looks, step in some(DEATHS, 44):
        print(point, looks, step)
        dies(Scene(looks), point, step)


def dies(scene: Scene, point: Point, step: int) -> None:
    """A step of ex ends there."""
    ex = scene.wires.nodes["ex"]
    scene.wires.run(lambda: ex.state is not None and ex.state.state == "idle")
    scene.wires.crash("ex", point, in_steps=step)
    scene.ask(GRASP)
    scene.wires.run(lambda: bool(scene.heard) and scene.heard[-1][1] != "agree")
    assert scene.world.begun in ([], ["g1"], ["g1", "g1"])
    kinds = {"inform": rc.Done, "failure": rc.NotDone}
    assert isinstance(scene.last, kinds[scene.heard[-1][1]])
    if isinstance(scene.last, rc.NotDone):
        assert scene.last.kind == "unknown"
    scene.ask(rc.Look("l1", ((1.0, 0.0, 1.0),)))
    scene.wires.run(lambda: isinstance(scene.last, rc.Done) and scene.last.key == "l1")
    done = [content.key for _, _, content in scene.heard if isinstance(content, rc.Done)]
    assert bool(scene.wires.memory("ex").remembered.held) == ("g1" in done)


def test_a_cancel_in_an_act(scene: Scene) -> None:
    """The motion is braked; the outcome comes in reply to the cancel."""
    scene.ask(MOVE)
    scene.until("agree")
    scene.wires.run_for(0.3)
    scene.wires.post("ta", Say(0, P.CANCEL))
    scene.until("agree", "inform")
    assert (scene.last.kind, scene.last.key) == ("cancelled", "m1")
    assert scene.world.sim_time < 1.0
    assert not scene.wires.nodes["ta"].state.conversations


def test_a_cancel_before_anything_moved(scene: Scene) -> None:
    """It is answered at once, nothing moves."""
    scene.wires.run_for(1.0)
    scene.ask(MOVE)
    scene.wires.post("ta", Say(0, P.CANCEL))
    scene.until("inform")
    assert scene.last.kind == "cancelled"
    assert not scene.world.begun


def test_the_memory_is_small() -> None:
    """A record of ex stays below 8 kB: a motion's path is not in it."""
    scene = Scene()
    scene.ask(GRASP)
    scene.until("agree")
    record = scene.wires.nodes["ex"].journal
    assert record is not None
    assert len(record) < 8192
    assert np.zeros((101, 15)).nbytes > 8192
