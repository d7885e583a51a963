"""The dispatcher in front of two companions: every order is done, by the soonest robot or by the
next best one, whatever is lost or dies. The robots are pretended here; tests/zenoh/test_dispatch.py
has real ones.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from dispatch.bidder.behaviours import bidder
from dispatch.bidder.planning import NotPlanned, Plan, Planned
from dispatch.design import DESIGN, LANGUAGES
from dispatch.di import behaviours as di
from dispatch.di.people import people
from dispatch.orders import FILE, Order, read
from msgspec.structs import replace

from agent_runtime.core.binding import wiring
from agent_runtime.core.events import Deed, Effects
from agent_runtime.core.outside import GuestHears, GuestLeaves, GuestLost, GuestSays
from agent_runtime.core.step import OUTSIDE
from agent_runtime.testing.memory_bus import Faults, MemoryBus
from companion.languages.facts import Kind, fact
from companion.languages.hfsm import ScheduleParameters
from companion.tasks.look_around.command import LookAround
from companion.tasks.pour.command import PourInto
from fipa_codec.languages import Kind as Guard
from fipa_codec.performatives import Performative as P
from topdown.check import agreement, check
from topdown.model.design import Design
from topdown.prove.engine import explore
from topdown.prove.fleet import Faults as FleetFaults
from topdown.prove.fleet import Fleet
from topdown.prove.paths import Follower
from topdown.prove.verify import tasks

POUR, LOOK = PourInto(source="jar", destination="bowl"), LookAround()
NEVER_S = 1e6


class Robot:
    """What a bidder knows of its robot: `rest` [s] of every task; `ends`: how tasks end, the last
    for ever; `hopeless`: tasks without a plan.
    """

    def __init__(self, rest: float, *ends: str, hopeless: tuple[Any, ...] = ()) -> None:
        self.hopeless = hopeless
        self.rest, self.ends = rest, [*(ends or ("done",))]
        self.begun: list[str] = []
        self.left: list[str] = []
        self.wires: MemoryBus | None = None

    def device(self, post: Callable[..., None]) -> "Device":
        return Device(self, post)


class Device:
    """Of one life of the bidder, after which nothing of it is heard."""

    busy = False

    def __init__(self, robot: Robot, post: Callable[..., None]) -> None:
        self._robot, self._now, self._lives = robot, post, True

    def _post(self, content: Any, delay_s: float) -> None:
        assert self._robot.wires is not None
        self._robot.wires.call(delay_s, lambda: self._now(content) if self._lives else None)

    def tell(self, content: Any) -> None:
        """A plan at once, the task when its time has come."""
        match content:
            case Plan(call=call, task=task) if task in self._robot.hopeless:
                self._post(NotPlanned(call, (fact(Kind.NOT_ANSWERING, "km"),)), 10.0)
            case Plan(call=call) if self._robot.rest < NEVER_S:
                self._post(Planned(call, ScheduleParameters("", self._robot.rest)), 1.0)
            case Plan(call=call):
                self._post(NotPlanned(call, (fact(Kind.NOT_ANSWERING, "km"),)), 1.0)
            case GuestSays(use=use, conversation=name):
                self._robot.begun.append(name)
                ends = self._robot.ends
                how = ends.pop(0) if len(ends) > 1 else ends[0]
                said = {
                    "done": GuestHears(use, name, P.INFORM),
                    "failed": GuestHears(use, name, P.FAILURE),
                    "refused": GuestHears(use, name, P.REFUSE),
                    "lost": GuestLost(use, name, "hi is not there"),
                }
                if how != "refused":
                    self._post(GuestHears(use, name, P.AGREE), 0.1)
                    self._post(GuestHears(use, name, P.INFORM, Guard.PROGRESS), 0.2)
                self._post(said[how], self._robot.rest)
            case GuestLeaves(conversation=name):
                self._robot.left.append(name)

    def close(self) -> None:
        """It dies with the bidder."""
        self._lives = False


class Dispatch:
    """All agents on pretend wires; every step must be a row of the design."""

    def __init__(
        self, *orders: Order, one: Robot, two: Robot, seed: int = 0, faults: Faults | None = None
    ) -> None:
        self.robots = {"b1": one, "b2": two}
        self.wires = MemoryBus(seed=seed, faults=faults)
        self.wires.on_step = self._watch
        one.wires = two.wires = self.wires
        self.outside: list[str] = []
        self.done: list[int] = []
        self.deeds: list[tuple[str, Deed]] = []
        self._add("di", di.agent(), people(orders))
        self._add("b1", bidder("b1", "velma1"), one.device)
        self._add("b2", bidder("b2", "velma2"), two.device)

    def _add(self, name: str, agent: Any, device: Any) -> None:
        wired = wiring(name, "test", design=DESIGN, languages=LANGUAGES)
        self.wires.add(agent, wired, device)

    def run(self, ended: int, limit_s: float = 3600.0) -> tuple[int, int]:
        """Until that many orders have ended; how many were done, and how many given up."""
        self.until(lambda: self.memory.done + self.memory.failed >= ended, limit_s)
        return self.memory.done, self.memory.failed

    def until(self, condition: Callable[[], object], limit_s: float = 3600.0) -> None:
        """Until this holds; every step on the way is a move of the proven model."""
        self.wires.run(lambda: bool(condition()), limit_s=limit_s)
        assert self.outside == []
        assert Follower(DESIGN).follow(self.deeds) is None

    @property
    def memory(self) -> Any:
        """That of di."""
        return self.wires.memory("di")

    @property
    def begun(self) -> dict[str, int]:
        """How many tasks each robot began."""
        return {name: len(robot.begun) for name, robot in self.robots.items()}

    def _watch(self, agent: str, effects: Effects) -> None:
        self.outside += [str(line.fields["why"]) for line in effects.logs if line.event == OUTSIDE]
        self.deeds += [(agent, effects.deed)] if effects.deed is not None else []
        self.done += [line.fields["order"] for line in effects.logs if line.event == "done"]


def orders(count: int) -> tuple[Order, ...]:
    """As many, all at once."""
    return tuple(Order(POUR if n % 2 else LOOK) for n in range(count))


def test_the_design_is_consistent() -> None:
    """In itself, and with the language."""
    names = [entry.name for entry in DESIGN.file.language]
    classes = {name: [kind.__name__ for kind in LANGUAGES.named(name).classes] for name in names}
    assert check(DESIGN) == ()
    assert agreement.check_languages(DESIGN, classes) == ()


def without_row(agent: str, *words: str) -> Design:
    """The design without the rows of an agent that have these words."""
    made = []
    for one in DESIGN.file.agent:
        rows = tuple(row for row in one.row if one.name != agent or row.on not in words)
        made.append(replace(one, row=rows))
    file = replace(DESIGN.file, agent=tuple(made))
    return Design(file, DESIGN.path, "", DESIGN.folder)


def test_the_design_holds() -> None:
    """In all layers, whatever the two companions do, and whoever dies once."""
    verdicts = [task.run(None) for task in tasks(DESIGN)]
    assert {one.layer for one in verdicts} == {1, 2, 3}
    assert [one.what for one in verdicts if not one.holds] == []


@pytest.mark.parametrize(
    ("agent", "words"),
    [
        ("b1", "late velma1.job"),
        ("b2", "velma2.job refuse"),
        ("b1", "restart"),
        ("di", "tender_1 failure"),
    ],
)
def test_a_row_less_and_it_does_not(agent: str, words: str) -> None:
    """Each of them answers something that may happen."""
    assert explore(Fleet(without_row(agent, words), FleetFaults(1))).findings


def test_the_soonest_robot_gets_the_order_and_robots_work_side_by_side() -> None:
    """The second order goes to the slower robot, since the other is at work."""
    both = Dispatch(*orders(2), one=Robot(30.0), two=Robot(20.0))
    began = both.wires.now
    assert both.run(2) == (2, 0)
    assert both.begun == {"b1": 1, "b2": 1}
    assert both.wires.now - began < 40.0
    assert Dispatch(*orders(1), one=Robot(30.0), two=Robot(20.0)).run(1) == (1, 0)


def test_twenty_orders_are_each_done_once() -> None:
    """And the quicker robot does more of them."""
    both = Dispatch(*orders(20), one=Robot(30.0), two=Robot(20.0))
    assert both.run(20) == (20, 0)
    assert sum(both.begun.values()) == 20
    assert both.begun["b2"] > both.begun["b1"]


@pytest.mark.parametrize("how", ["failed", "refused", "lost"])
def test_the_next_best_robot_does_what_the_winner_did_not(how: str) -> None:
    """Once each, and the one that failed in it is not asked for it again."""
    both = Dispatch(*orders(1), one=Robot(30.0), two=Robot(20.0, how, "done"))
    assert both.run(1) == (1, 0)
    assert both.begun == {"b1": 1, "b2": 1}


def test_an_order_that_every_robot_failed_in_is_given_up() -> None:
    """After one try of each; the next order is done all the same."""
    both = Dispatch(*orders(2), one=Robot(30.0, "failed", "done"), two=Robot(20.0, "lost", "done"))
    both.until(lambda: both.memory.done == 1)
    both.until(lambda: both.memory.failed + both.memory.done == 2)
    assert sum(both.begun.values()) <= 4


def test_a_robot_without_a_plan_gets_nothing() -> None:
    """No number is made up for it: its bidder refuses."""
    both = Dispatch(*orders(3), one=Robot(NEVER_S), two=Robot(20.0))
    assert both.run(3) == (3, 0)
    assert both.begun == {"b1": 0, "b2": 3}


def test_orders_keep_their_order_though_a_robot_is_away() -> None:
    """Its refusals while the other one works do not count against an order."""
    both = Dispatch(*orders(6), one=Robot(120.0), two=Robot(NEVER_S))
    assert both.run(6) == (6, 0)
    assert both.done == [1, 2, 3, 4, 5, 6]


def test_an_order_that_nobody_can_do_now_holds_no_other_up() -> None:
    """It is called for again once the others are done."""
    pours = Robot(20.0, hopeless=(POUR,)), Robot(30.0, hopeless=(POUR,))
    both = Dispatch(Order(POUR), *(Order(LOOK) for _ in range(4)), one=pours[0], two=pours[1])
    both.until(lambda: both.memory.done == 4, limit_s=120.0)
    assert both.run(5) == (4, 1)


def test_an_order_that_nobody_can_do_is_given_up_in_the_end() -> None:
    """After as many calls as the design has."""
    both = Dispatch(*orders(1), one=Robot(NEVER_S), two=Robot(NEVER_S))
    assert both.run(1) == (0, 1)
    assert both.begun == {"b1": 0, "b2": 0}


def test_a_bidder_that_dies_calls_its_task_off_and_the_other_robot_does_it() -> None:
    """It cannot know what its robot said meanwhile."""
    both = Dispatch(*orders(1), one=Robot(30.0), two=Robot(20.0))
    both.until(lambda: both.begun["b2"])
    both.wires.crash("b2")
    assert both.run(1) == (1, 0)
    assert both.robots["b2"].left == both.robots["b2"].begun
    assert both.begun == {"b1": 1, "b2": 1}


def test_a_dispatcher_that_dies_goes_on_with_what_it_knew() -> None:
    """Nothing is awarded twice, and what people say once more is known."""
    both = Dispatch(*orders(4), one=Robot(30.0), two=Robot(20.0))
    both.until(lambda: all(both.begun.values()))
    both.wires.crash("di")
    assert both.run(4) == (4, 0)
    both.wires.run_for(300.0)
    assert sum(both.begun.values()) == 4


def test_whatever_is_lost_doubled_delayed_or_dies_every_order_ends(some: Any) -> None:
    """Faults of every kind; at least once each."""
    faults = Faults(loss=0.1, duplication=0.1, delay=0.2, crash=0.005)
    for seed in some(range(12), 4):
        both = Dispatch(*orders(6), one=Robot(30.0), two=Robot(20.0), seed=seed, faults=faults)
        done, failed = both.run(6, limit_s=36000.0)
        assert done + failed >= 6, seed
        assert done >= 4, seed


def test_the_example_file_is_read(tmp_path: Path) -> None:
    """Robots are found from the file's folder; what does not fit is named with the file."""
    found = read(None)
    assert found.robots.keys() == set(DESIGN.included)
    assert all(Path(run).is_absolute() for run in found.robots.values())
    assert [order.task for order in found.order] == [POUR, LOOK]
    bad = tmp_path / "bad.toml"
    bad.write_text('[robots]\n[[order]]\ntask = { type = "Fly" }\n')
    with pytest.raises(ValueError, match=r"bad\.toml: .*Fly"):
        read(bad)
    with pytest.raises(ValueError, match=r"none\.toml"):
        read(tmp_path / "none.toml")
    assert FILE.is_file()
