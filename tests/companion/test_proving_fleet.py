"""The composed fleet: it holds under faults; every naive variant of a row fails, and by what."""

import pytest
from msgspec.structs import replace

from companion.design import DESIGN
from topdown.model import elements
from topdown.model.design import Design
from topdown.prove.engine import DEADLOCK, UNREACHED, explore
from topdown.prove.fleet import Faults, Fleet, Soft
from topdown.prove.local import Agent

STUCK = f"{DEADLOCK}|{UNREACHED}"
Rows = tuple[elements.Row, ...]


def with_rows(agent, change):
    """The design with other rows of an agent."""
    agents = tuple(
        replace(one, row=change(one.row)) if one.name == agent else one for one in DESIGN.file.agent
    )
    return Design(replace(DESIGN.file, agent=agents), DESIGN.path)


def without(agent, **wanted):
    """The design less the rows of an agent whose fields hold these words; at least one must."""

    def change(rows):
        left = tuple(
            row
            for row in rows
            if not all(word in str(getattr(row, name)) for name, word in wanted.items())
        )
        assert len(left) < len(rows), f"no row of {agent} has {wanted}"
        return left

    return with_rows(agent, change)


def in_place(agent, event, /, **fields):
    """The design with fields of an agent's rows for an event changed."""

    def change(rows):
        assert any(row.on == event for row in rows), f"no row of {agent} is on {event}"
        return tuple(replace(row, **fields) if row.on == event else row for row in rows)

    return with_rows(agent, change)


def found(design, faults):
    """Return the first findings, within a bound that the right design does not need."""
    return explore(Fleet(design, faults), most_states=400_000)


def holds(faults):
    """All of it is explored, and nothing is found."""
    result = explore(Fleet(DESIGN, faults))
    assert result.complete
    assert result.findings == ()


# --- the design as it is --------------------------------------------------------------------------


def test_the_fleet_holds():
    """No deadlock, nothing unforeseen, rest in reach from everywhere, no act twice, no planning on
    a stale world.

    And every row is used: one that no path takes is one that nobody needs, or one whose guard is
    wrong.
    """
    holds(Faults(0))
    fleet = Fleet(DESIGN, Faults(1))
    assert explore(fleet).findings == ()
    known = {(words.split()[0], event) for words, events in UNUSED.items() for event in events}
    for note in fleet.unused():
        agent, event = note.split()[3], note.rpartition(" on ")[2].rstrip(")")
        assert (agent, event) in known, note


def test_the_start_of_all_agents_holds():
    """Commands may come while some agents have not even heard of each other."""
    holds(Faults(0, boot=True))


@pytest.mark.long
@pytest.mark.timeout(900)
def test_the_fleet_holds_with_two_faults():
    """Likewise."""
    holds(Faults(2))


@pytest.mark.parametrize("agent", ["ta", "pl", "km", "ex"])
def test_who_waits_is_told_when_an_agent_dies_for_good(agent):
    """The command of a person ends, whatever else happens."""
    holds(Faults(0, gone=agent, waiting=("hi",)))


UNUSED = {
    # said by nobody in this design, but allowed by the protocols' tables, and taken should it come
    "co": {"generate_plan refuse"},
    "pl": {"ask_for_planning refuse"},
    "km": {"observe_world refuse", "observe_world failure"},
    "ex": {"watch_robot subscribe"},
    # the answer of which nobody waits (`may`)
    "pl idle": {
        "ask_for_planning inform-ref",
        "ask_for_planning failure",
        "ask_for_planning refuse",
    },
    # a look around takes one death, its end or wait that crosses a cancel needs a second fault
    "ta surveying": {
        "act inform",
        "act failure",
        "act refuse",
        "act inform[cancel]",
        "act failure[cancel]",
        "late act",
    },
    "ta": {"ask_for_acting refuse"},
    # a subscriber that is gone for good is not explored
    "ta closing": {"late observe_world"},
}
"""Rows that one fault does not reach, by agent (and state), and why."""


# --- naive variants ---


def no_barrier():
    """ta reports the end of its plan though km does not know yet what its acts changed."""

    def now(way):
        guards = (guard for guard in way.when if not guard.startswith("observe_world"))
        return replace(way, when=tuple(guards))

    ta = DESIGN.agent("ta")
    open_ways = {one: [way for way in one.ways if way.to != "closing"] for one in ta.choice}
    choices = (replace(one, ways=tuple(map(now, ways))) for one, ways in open_ways.items())
    agent = replace(ta, choice=tuple(choices))
    agents = tuple(agent if one.name == "ta" else one for one in DESIGN.file.agent)
    return Design(replace(DESIGN.file, agent=agents), DESIGN.path)


def co_forgets():
    """At reply-by co tells hi and takes the next command; the old plan runs on."""

    def change(rows):
        late = {"say": ("execute_command failure",), "when": ("execute_command agreed",)}
        kept = (replace(row, **late) if row.on == "late execute_plan" else row for row in rows)
        return tuple(
            replace(row, when=()) if row.on == "execute_command request" else row for row in kept
        )

    return with_rows("co", change)


NAIVE = {
    "no barrier": (no_barrier, 0, "stale world"),
    "ta takes no cancel in finished": (
        lambda: in_place("ta", "execute_plan cancel", in_=("running", "stopping", "closing")),
        0,
        STUCK,
    ),
    "ta takes no cancel while an act goes on": (
        lambda: without("ta", on="execute_plan cancel", say="act cancel"),
        0,
        "no row",
    ),
    "km does not renew its subscription": (
        lambda: in_place("km", "back ta", on="own subscribe", when=("observe_world none",)),
        1,
        STUCK,
    ),
    "pl forgets the request it agreed to": (
        lambda: in_place("pl", "restart", say=(), to="idle"),
        1,
        STUCK,
    ),
    "ex forgets its act": (lambda: in_place("ex", "restart", to="idle"), 1, STUCK),
    "ex begins its act again": (
        lambda: in_place("ex", "restart", to="acting", moves="act"),
        1,
        "twice",
    ),
    "ta does not ask again after a death": (
        lambda: without("ta", on="restart", say="query-ref"),
        1,
        STUCK,
    ),
    "co gives up a late plan and forgets it": (co_forgets, 1, "no row"),
    "ex takes no cancel once it has stopped to act": (
        lambda: in_place("ex", "act cancel", in_=("preparing", "acting")),
        0,
        STUCK,
    ),
    "co drops a failure of pl": (
        lambda: in_place("co", "generate_plan failure", say=()),
        0,
        "no row",
    ),
    "co forgets a task that it put aside": (
        lambda: with_rows("co", lambda rows: tuple(replace(row, waits=()) for row in rows)),
        0,
        "no row",  # a cancel comes for what nobody remembers
    ),
    "co answers a cancel before pl has answered what was asked about the task": (
        lambda: with_rows(
            "co",
            lambda rows: tuple(
                replace(row, when=("execute_command waiting",))
                if row.on == "execute_command cancel" and "generate_plan none" in row.when
                else row
                for row in rows
            ),
        ),
        0,
        "no row",
    ),
    "co answers no cancel of a task that waits": (
        lambda: with_rows(
            "co",
            lambda rows: tuple(
                row
                for row in rows
                if row.on != "execute_command cancel" or "execute_command waiting" not in row.when
            ),
        ),
        0,
        "no row",
    ),
    "a command is taken though one is under way": (
        lambda: in_place("ta", "execute_plan cancel", to="idle"),
        0,
        STUCK,
    ),
}


@pytest.mark.parametrize("name", NAIVE)
def test_naive(name):
    """It fails with that many faults and not with fewer, for the reason given here."""
    make, most, what = NAIVE[name]
    design = make()
    result = found(design, Faults(most))
    assert result.findings, f"nothing is found in {result.states} states"
    assert any(word in str(result.findings[0]) for word in what.split("|")), str(result.findings[0])
    assert most == 0 or not found(design, Faults(most - 1)).findings


def test_co_waits_for_ever_for_a_robot_that_is_gone():
    """Without the rows by which a wait of co is over, a person's wish never ends when ta dies for
    good.
    """

    def change(rows):
        return tuple(row for row in rows if not row.on.startswith("late "))

    wish = Faults(0, gone="ta", waiting=("hi",))
    result = explore(Fleet(with_rows("co", change), wish), most_states=400_000)
    assert result.findings[0].kind in (DEADLOCK, UNREACHED)


def test_nobody_asks_again(monkeypatch):
    """A lost question is waited for, for ever."""
    monkeypatch.setattr(Soft, "by_itself", lambda self, ends: iter(()))
    result = found(DESIGN, Faults(1))
    assert result.findings[0].kind in (DEADLOCK, UNREACHED)


def test_what_is_owed_stands_in_ram(monkeypatch):
    """A death of ta between an act and its report makes pl plan on a stale world."""
    right = Agent._restarted

    def forgetful(self, local):
        return tuple(
            one._replace(there=one.there._replace(owed=frozenset())) for one in right(self, local)
        )

    monkeypatch.setattr(Agent, "_restarted", forgetful)
    result = found(DESIGN, Faults(1))
    assert "planning on a stale world" in result.findings[0].text
