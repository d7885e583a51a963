"""The second worked example runs as its design says: every order is carried once, whatever is lost
or dies.
"""

import subprocess
import sys
from pathlib import Path

import pytest
from depot import world
from depot.carrier.wheels import Drive, wheels
from depot.design import DESIGN, LANGUAGES
from depot.desk.people import ORDERS, read
from depot.languages.order import Figures
from depot.mule.memory import FIRST
from depot_in_memory import Depot, Told, wishes
from msgspec.structs import replace

from agent_runtime.testing.memory_bus import Faults
from fipa_codec.exploration import explore
from topdown.check import agreement, check
from topdown.model import elements
from topdown.model.design import Design
from topdown.prove.engine import explore as explore_model
from topdown.prove.fleet import Faults as FleetFaults
from topdown.prove.fleet import Fleet
from topdown.scaffold import scaffold

EXAMPLE = Path(__file__).parents[2] / "examples" / "depot"
NORTH, SOUTH = ("receiving", "press"), ("store", "shipping")


def test_the_design_is_consistent():
    """In itself, and with the languages."""
    names = [entry.name for entry in DESIGN.file.language]
    classes = {name: [kind.__name__ for kind in LANGUAGES.named(name).classes] for name in names}
    assert check(DESIGN) == ()
    assert agreement.check_languages(DESIGN, classes) == ()


def test_its_own_protocol_has_no_hole():
    """Both roles of `passage` over two channels: every reception has a row, nothing is stuck."""
    explored = explore(DESIGN.own_tables["passage"])
    assert (explored.unspecified, explored.stuck) == ((), ())


def test_the_method_is_shown_in_full():
    """A split, a complement, a protocol of its own, a contract net, a group that stays one."""
    steps = DESIGN.file.step
    assert any(step.split for step in steps)
    assert any(step.complement for step in steps)
    assert {use.follows for use in DESIGN.file.protocol} == {
        "request",
        "subscribe",
        "cfp",
        "passage",
    }
    assert 3 <= len(DESIGN.agents) <= 5


def test_the_nearest_robot_carries_and_everything_is_delivered():
    """The orders of the example's file: the quick robot in its own hall, the other while that one
    drives home.
    """
    depot = Depot(*read(ORDERS))
    depot.run(3)
    assert depot.orders == (3, 0)
    assert depot.assigned == ["mule", "ox", "mule"]
    depot.until(lambda: Figures(3, 0) in depot.told(Figures))


def test_robots_wait_for_each_other_at_the_aisle():
    """The quick one drives home through the aisle while the strong one wants to come through: one
    has to wait.
    """
    depot = Depot(*wishes(("receiving", "store"), ("store", "press")))
    waited: list[bool] = []
    depot.until(
        lambda: (
            waited.append(bool(depot.wires.memory("traffic").waiting))
            or len(depot.said("inform", "ox")) > 1
        )
    )
    assert any(waited)


def test_whatever_is_lost_doubled_delayed_or_dies_every_order_is_carried_once(some):
    """Faults of every kind: one award and one delivery each."""
    faults = Faults(loss=0.1, duplication=0.1, delay=0.2, crash=0.01)
    ways = wishes(("receiving", "shipping"), ("store", "press"), ("press", "receiving"))
    for seed in some(range(20), 6):
        depot = Depot(*ways, seed=seed, faults=faults)
        depot.run(3, limit_s=3600.0)
        assert depot.orders == (3, 0), seed
        assert len(depot.said("accept-proposal")) == 3, seed


def test_a_robot_that_comes_back_drives_on_from_where_it_was():
    """Reports of the wheels died with it, so they are told again, from the last point it knew."""
    depot = Depot(*wishes(("receiving", "shipping")))
    told: list[Drive] = []
    depot.wires.nodes["mule"].maker = lambda post: Told(wheels(post), told)
    depot.until(lambda: depot.wires.memory("mule").here != FIRST.here)
    here = depot.wires.memory("mule").here
    depot.wires.crash("mule")
    depot.until(lambda: len(told) > 1)
    assert (told[1].start, told[1].goal) == (here, told[0].goal)


def test_people_who_say_everything_again_are_heard_once():
    """The desk dies and comes back: what was ordered before is not ordered again."""
    depot = Depot(*wishes(NORTH, SOUTH))
    depot.until(lambda: depot.wires.memory("desk").heard == 2)
    depot.wires.crash("desk")
    depot.run(2)
    depot.wires.run_for(60.0)
    assert depot.orders == (2, 0)


@pytest.mark.parametrize("away", ["mule", "ox"])
def test_one_robot_carries_alone_while_the_other_is_away(away):
    """The call to the other waits for it in the outbox and passes its reply-by; it is not called
    again meanwhile.
    """
    depot = Depot(*wishes(NORTH, SOUTH), without=(away,))
    depot.run(2)
    assert depot.orders == (2, 0)
    assert len(depot.said("cfp")) == 2 + (depot.wires.memory("dispatcher").rounds - 1)


def test_a_robot_that_dies_for_good_with_the_job_fails_the_order_only():
    """The desk is told when the patience is over; the next order goes to the other robot."""
    depot = Depot(*wishes(NORTH, SOUTH))
    depot.until(lambda: bool(depot.said("accept-proposal")))
    depot.wires.crash("mule", restart_s=1e6)
    depot.run(2)
    assert depot.orders == (1, 1)
    assert depot.assigned == ["mule", "ox"]


def test_an_order_that_nobody_can_carry_is_given_up():
    """Both robots are away: after some calls the desk is told that it failed, and why."""
    depot = Depot(*wishes(NORTH), without=("mule", "ox"))
    depot.run(1)
    assert (depot.orders, len(depot.said("failure"))) == ((0, 1), 1)


@pytest.mark.parametrize("way", [("receiving", "moon"), ("press", "press")])
def test_an_order_between_no_two_stations_is_refused(way):
    """At once, and no robot hears of it."""
    depot = Depot(*wishes(way))
    depot.run(1)
    assert (len(depot.said("refuse")), depot.said("cfp")) == (1, [])


def test_a_late_proposal_is_rejected():
    """A robot that was frozen at the call offers afterwards: the job is another's, its offer is
    rejected.
    """
    depot = Depot(*wishes(NORTH))
    depot.until(lambda: bool(depot.said("cfp")))
    depot.wires.crash("mule", restart_s=6.0)
    depot.run(1)
    depot.until(lambda: bool(depot.said("reject-proposal")))
    assert len(depot.said("accept-proposal")) == 1


def test_a_way_through_the_aisle_is_longer_than_the_straight_line():
    """The small world: ways are as long as their legs, and one is everywhere on them once."""
    start = world.STATIONS["press"]
    points = world.way(start, "shipping")
    assert points[1:-1] == world.AISLE
    assert world.length(points) > world.length((start, world.STATIONS["shipping"]))
    assert world.along(points, 0.0) == start
    assert world.along(points, world.length(points) + 1.0) == points[-1]
    assert world.duration(start, ("shipping",), 2.0) == pytest.approx(world.length(points) / 2.0)


def test_making_the_project_again_keeps_what_was_filled_in(tmp_path):
    """No file of the example would change: its design and its files belong together."""
    copy = tmp_path / "depot"
    subprocess.run(["cp", "-r", str(EXAMPLE), str(copy)], check=True)
    outcome = scaffold((EXAMPLE / "depot" / "design.toml").read_text(), copy)
    assert outcome.written == ()
    assert outcome.left == ()
    assert [kept for kept in outcome.kept if kept.missing] == []


@pytest.mark.process
def test_its_own_tests_pass():
    """As its user runs them, but for the one that opens a router."""
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        "--ignore",
        "tests/test_run.py",
    ]
    done = subprocess.run(command, cwd=EXAMPLE, capture_output=True, text=True, timeout=55)
    assert done.returncode == 0, done.stdout + done.stderr


# --- proven ---


def changed(agent: str, rows: tuple[elements.Row, ...]) -> Design:
    """The design with other rows of an agent."""
    agents = tuple(
        replace(one, row=rows) if one.name == agent else one for one in DESIGN.file.agent
    )
    return Design(replace(DESIGN.file, agent=agents), DESIGN.path)


def test_the_composed_agents_always_come_to_rest():
    """All five, without faults: no message that no row takes, nobody stuck, rest in reach from
    everywhere.
    """
    explored = explore_model(Fleet(DESIGN))
    assert explored.findings == ()
    assert explored.complete


@pytest.mark.long
def test_the_composed_agents_bear_a_fault():
    """One loss, copy, death or expiry, anywhere."""
    explored = explore_model(Fleet(DESIGN, FleetFaults(1)))
    assert explored.findings == ()
    assert explored.complete


def test_a_careless_traffic_is_found():
    """It lets a second robot into the aisle: the design says that this must never happen, and it
    would.
    """
    careless = tuple(
        replace(row, say=(row.on.replace("request", "agree"),)) if row.text == "it waits" else row
        for row in DESIGN.agent("traffic").row
    )
    (finding,) = explore_model(Fleet(changed("traffic", careless))).findings
    assert "two in the aisle" in finding.text


@pytest.mark.parametrize("gone", ["mule", "ox"])
def test_the_desk_comes_to_rest_though_a_robot_dies_for_good(gone):
    """At any time, also with a job: every order then ends all the same."""
    explored = explore_model(Fleet(DESIGN, FleetFaults(gone=gone, waiting=("desk",))))
    assert explored.findings == ()
    assert explored.complete


@pytest.mark.parametrize(
    ("agent", "on", "gone"),
    [
        ("mule", "tender_mule reject-proposal", ""),
        ("mule", "way_mule agree", ""),
        ("ox", "tender_ox accept-proposal", ""),
        ("traffic", "way_ox inform", ""),
        ("dispatcher", "tender_mule inform", ""),
        ("dispatcher", "late tender_ox", "ox"),
        ("desk", "order failure", "ox"),
    ],
)
def test_an_event_forgotten_is_found(agent, on, gone):
    """Without its rows somebody is stuck; what answers a silence is missed only where somebody is
    silent.
    """
    rows = tuple(row for row in DESIGN.agent(agent).row if row.on != on)
    assert len(rows) < len(DESIGN.agent(agent).row)
    faults = FleetFaults(gone=gone, waiting=("desk",) if gone else ())
    assert explore_model(Fleet(changed(agent, rows), faults)).findings
