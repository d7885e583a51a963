"""A command given before the world was looked at: it waits for the end of the look around, however
long that takes.
"""

from collections.abc import Callable
from itertools import product

import msgspec
import pytest
from msgspec.structs import replace
from pretended_fleet import Fleet
from pretended_robot import Robot

from agent_runtime.core.events import PeerChanged
from agent_runtime.testing.memory_bus import Faults, Point
from companion.design import CMD, WM
from companion.languages import rc, wm
from companion.languages.cmd import TaskReport
from companion.languages.facts import Kind, fact, with_reasons
from companion.languages.values import Pose
from companion.world.observe import observed
from companion.world.scene import Scene
from services.coordinator import outgoing_messages
from services.executor.device_messages import Ended, Move, Perform
from services.knowledge import behaviours as knowledge

NO_LIGHT = (fact(Kind.NOTHING_IS_SEEN),)
SLOW_S = 25.0
# by then every command has ended that waits for a robot which never looks: estimate, some tries
# long
TIRED_S = 300.0

Later = Callable[[float, Callable[[], None]], None]


class Slow(Robot):
    """Its look around takes minutes: 50 s until the first motion, 25 s and more for each; it says
    so beforehand.
    """

    def __init__(self, post, world, later):
        def frank(word, delay_s=0.0):
            post(replace(word, expected=60.0) if isinstance(word, Move) else word, delay_s)

        super().__init__(frank, world, later)

    @property
    def _surveys(self):
        return self._perform is not None and self._perform.command.key.startswith("survey")

    def _go_on(self, number, felt):
        right = super()._go_on
        self._later(2 * SLOW_S if self._surveys else 0.0, lambda: right(number, felt))

    def _begin(self, number, asked):
        right = super()._begin
        self._later(SLOW_S if self._surveys else 0.0, lambda: right(number, asked))


class Blind(Robot):
    """Cannot look, and says so."""

    def tell(self, content):
        """Have no look done."""
        if isinstance(content, Perform) and isinstance(content.command, rc.Look):
            kept = content.remembered
            ended = kept.not_done(content.command.key, "failed", NO_LIGHT)
            self._post(Ended(content.number, ended, kept), 0.01)
        else:
            super().tell(content)


class Silent(Robot):
    """Never says how an act ended."""

    def tell(self, content):
        """Say nothing of it."""
        if not isinstance(content, Perform):
            super().tell(content)


def fleet_of(kind):
    """The fleet with a robot of this kind."""
    made = Fleet(robot=lambda post: kind(post, made.world, made.wires.call))
    return made


@pytest.fixture
def fleet(request):
    """The fleet with a robot of the kind that the test is marked with."""
    with fleet_of(getattr(request, "param", Robot)) as made:
        yield made


slow, blind, silent = (
    pytest.mark.parametrize("fleet", [kind], indirect=True) for kind in (Slow, Blind, Silent)
)


def reports(fleet):
    """co's reports to hi, in order."""
    to_hi = (one for one in fleet.wires.traffic if (one.sender, one.receiver) == ("co", "hi"))
    said = [one for one in to_hi if one.content]
    return [report for one in said if isinstance(report := CMD.decode(one.content), TaskReport)]


def refused(fleet, within_s):
    """Why the first command fails, in this time."""
    fleet.until(fleet.ended, within_s)
    assert [str(task.state) for task in fleet.tasks] == ["failed"]
    return fleet.tasks[0].why


@slow
def test_a_look_around_of_minutes(fleet):
    """The command was given before it began, and is carried out; the person is told once what is
    waited for.
    """
    fleet.say()
    fleet.until(lambda: fleet.state("ex") == "preparing")
    assert fleet.wires.memory("co").jobs, "the command came first"
    began = fleet.wires.now
    fleet.until(lambda: fleet.state("ta") != "surveying", 600.0)
    assert fleet.wires.now - began > 120.0
    assert fleet.finish() == ["done"]
    told = [one.why for one in reports(fleet)]
    assert told.count((fact(Kind.PLAN, 1, outgoing_messages.LOOKS),)) == 1
    assert told.count((fact(Kind.PLAN, 1),)) == 1, (
        "what waited for the look around is no further plan"
    )


@slow
def test_a_cancel_meanwhile(fleet):
    """It ends the command at once; the next one waits again, and is carried out."""
    fleet.say()
    fleet.wires.run_for(40.0)
    fleet.cancel()
    fleet.until(fleet.ended, 1.0)
    fleet.say()
    assert fleet.finish(2) == ["cancelled", "done"]


@pytest.mark.parametrize("victim", ["km", "ta", "ex", "pl", "co"])
def test_a_death_amid_a_long_look_around(victim, some):
    """The command is carried out whichever agent dies while the robot looks around, and comes
    back.
    """
    for at_s, point in some([*product((5.0, 80.0), Point)], 3):
        with fleet_of(Slow) as fleet:
            fleet.say()
            fleet.wires.run_for(at_s)
            fleet.wires.crash(victim, point, restart_s=3.0)
            assert fleet.finish() == ["done"], (at_s, point)


def test_km_away_at_the_end_of_it(fleet):
    """ta keeps what the look around told, and that it is over, until km has it."""
    fleet.until(lambda: fleet.state("ta") == "surveying")
    fleet.wires.crash("km", Point.BEFORE, restart_s=15.0)
    fleet.until(lambda: not fleet.up("km"), 20.0)
    fleet.say()
    fleet.until(lambda: fleet.state("ta") == "idle")
    assert not fleet.up("km")
    assert fleet.finish() == ["done"]


@blind
def test_the_robot_cannot_look(fleet):
    """After some tries the reason is told; once it can, the next command is carried out."""
    fleet.say()
    assert refused(fleet, 30.0) == (fact(Kind.NOT_LOOKED_AROUND, fact(Kind.NOTHING_IS_SEEN)),)


def test_ex_dead_for_good(fleet):
    """The wait for a look around that nobody makes ends in words; once ex is back, commands are
    served.
    """
    fleet.wires.crash("ex", Point.BEFORE, restart_s=900.0)
    fleet.say()
    assert refused(fleet, 120.0) == (fact(Kind.NOT_LOOKED_AROUND, fact(Kind.NOT_ANSWERING, "ex")),)
    fleet.until(fleet.at_rest, 1200.0)
    fleet.say()
    assert fleet.finish(2) == ["failed", "done"]


def test_ta_dead_for_good(fleet):
    """km waits a while for an observer, and says that there is none; once ta is there, commands are
    served.
    """
    fleet.wires.crash("ta", Point.BEFORE, restart_s=900.0)
    fleet.say()
    assert refused(fleet, 60.0) == (fact(Kind.NOT_LOOKED_AROUND, fact(Kind.OBSERVER_AWAY)),)
    fleet.until(fleet.at_rest, 1200.0)
    fleet.say()
    assert fleet.finish(2) == ["failed", "done"]


def test_a_command_right_after_ta_came_late(fleet):
    """km had said already that nobody has the robot look; from here on questions wait again."""
    fleet.wires.crash("ta", Point.BEFORE, restart_s=100.0)
    fleet.until(lambda: bool(fleet.up("km") and fleet.wires.memory("km").blind))
    fleet.until(lambda: fleet.up("ta"), 200.0)
    fleet.say()
    assert fleet.finish() == ["done"]


@slow
def test_ta_seems_to_be_gone_for_a_moment(fleet):
    """The same life of it is seen again: its look around goes on, and is waited for."""
    fleet.say()
    fleet.wires.run_for(30.0)
    life = fleet.wires.nodes["ta"].state.incarnation
    fleet.wires._later("km", PeerChanged("ta", None))
    fleet.wires._later("km", PeerChanged("ta", life), 5.0)
    assert fleet.finish() == ["done"]


@slow
def test_ta_dies_for_good_amid_it(fleet):
    """Likewise where it had agreed to tell."""
    fleet.say()
    fleet.wires.run_for(30.0)
    fleet.wires.crash("ta", Point.BEFORE, restart_s=9000.0)
    fleet.until(lambda: not fleet.up("ta"))
    assert refused(fleet, 60.0) == (fact(Kind.NOT_LOOKED_AROUND, fact(Kind.OBSERVER_AWAY)),)


@silent
def test_a_silent_robot(fleet):
    """ex gives its skill up each time, ta after some tries."""
    fleet.say()
    kinds = [one.kind for one in with_reasons(refused(fleet, TIRED_S))]
    assert kinds == [Kind.NOT_LOOKED_AROUND, Kind.NO_MOTION_FOUND]


def test_a_look_around_on_command(fleet):
    """A look around that failed is made good by one that a person asks for."""
    fleet.world.poses.clear()
    fleet.wires.crash("ex", Point.BEFORE, restart_s=200.0)
    fleet.say()
    assert fact(Kind.NOT_ANSWERING, "ex") in with_reasons(refused(fleet, 120.0))
    fleet.until(fleet.at_rest, 400.0)
    fleet.say("look around")
    assert fleet.finish(2) == ["failed", "done"]
    fleet.say()
    fleet.finish(3)
    assert fact(Kind.SEEN_NOTHING) in fleet.tasks[-1].why, "the world was looked at: it is empty"


def test_who_knows_of_its_end_knows_the_rest(some):
    """No question is answered before all that the look around showed is known, whatever is lost on
    the way.
    """
    for seed in some(range(10), 4):
        with Fleet(seed=seed, faults=Faults(loss=0.3)) as fleet:
            fleet.until(lambda fleet=fleet: fleet.up("km") and not fleet.wires.memory("km").patient)
            assert set(fleet.wires.memory("km").scene.things) == set(fleet.world.poses), seed


def test_what_was_seen_is_told_though_the_end_of_the_look_around_is_not_known():
    """ta was gone for good before it told the end."""
    jar = wm.SeenObject("jar_1", "jar", Pose((0.8, 0.0, 0.9)), 1.0)
    away = (fact(Kind.OBSERVER_AWAY),)
    memory = knowledge.Memory(observed(Scene(), jar, (1, 1)), patient=False, blind=away)
    assert isinstance(knowledge.answer(memory, wm.ListObjects())[1], wm.Objects)
    why = fact(Kind.NOT_LOOKED_AROUND, *away)
    empty = replace(memory, scene=Scene())
    assert knowledge.answer(empty, wm.ListObjects())[1] == wm.Unknown((why,))


def test_what_was_looked_at_stays_looked_at(fleet):
    """If a later look around fails, nobody is told that nothing was looked at."""
    fleet.until(lambda: fleet.up("km") and not fleet.wires.memory("km").patient)
    fleet.until(fleet.at_rest)
    late = wm.NothingSeen((fact(Kind.NOTHING_IS_SEEN),))
    ta = fleet.wires.nodes["ta"].state.incarnation
    of_ta = (one for one in fleet.wires.traffic if one.sender == "ta")
    told = next(one for one in of_ta if str(one.performative) == "inform")
    fleet.wires.deliver(replace(told, id=f"look@{ta}.9999", content=msgspec.Raw(WM.encode(late))))
    fleet.wires.run_for(1.0)
    assert not fleet.wires.memory("km").blind
