"""The supervisor's core: what it orders, whatever happens in whatever order."""

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agent_runtime.io.options import USAGE_ERROR
from companion.tools.system import PROCESSES
from operate.fleet_file import ProcessState
from operate.supervisor import core
from operate.supervisor.processes import Process, agents, around

THREE = (
    Process("router", "r"),
    Process("monitor", "m", after=("router",), optional=True),
    Process("ta", "t", after=("router", "monitor")),
)


class World:
    """Pretended processes under a core: does at once what is ordered, and dies or gets ready when
    told to.
    """

    def __init__(self, processes: tuple[Process, ...] = THREE) -> None:
        self.now = 0.0
        self.fleet = core.begin(processes, self.now)
        self.log: list[core.Action] = []
        self.deaf: set[str] = set()

    def tick(self, seconds: float = 0.05) -> list[core.Action]:
        """Let time pass; give what was ordered."""
        self.now += seconds
        self.fleet, actions = core.decide(self.fleet, self.now)
        for action in actions:
            self.log.append(action)
            match action:
                case core.Start(name=name):
                    assert all(
                        self.ready_or_optional(other)
                        for other in self.fleet.known[name].process.after
                    )
                    self.tell(core.Started(name, pid=100 + len(self.log)))
                case core.Terminate(name=name):
                    followers = [
                        known for known in self.fleet.known.values() if name in known.process.after
                    ]
                    assert not any(known.running for known in followers)
                    if name not in self.deaf:
                        self.tell(core.Exited(name, 0))
                case core.Kill(name=name):
                    self.tell(core.Exited(name, -9))
        return actions

    def ready_or_optional(self, name: str) -> bool:
        known = self.fleet.known[name]
        return known.state is ProcessState.READY or known.process.optional or known.restarts > 0

    def tell(self, event: core.Event) -> None:
        self.fleet = core.take(self.fleet, event, self.now)

    def all_ready(self) -> None:
        """Bring everything up."""
        for _ in self.fleet.known:
            for action in self.tick():
                self.tell(core.Ready(action.name))
        assert self.fleet.ready

    def state(self, name: str) -> ProcessState:
        return self.fleet.known[name].state


def test_a_process_starts_when_all_before_it_are_ready() -> None:
    """First the router alone, then the next, and nobody twice."""
    world = World()
    assert world.tick() == [core.Start("router")]
    assert world.tick() == []
    world.tell(core.Ready("router"))
    assert world.tick() == [core.Start("monitor")]
    assert world.tick() == []
    world.tell(core.Ready("monitor"))
    assert world.tick() == [core.Start("ta")]


@pytest.mark.parametrize("how", ["never ready", "given up"])
def test_nobody_waits_long_for_an_optional_process(how: str) -> None:
    """The robot works without its recorder."""
    world = World()
    world.tick()
    world.tell(core.Ready("router"))
    world.tick()
    if how == "given up":
        world.tell(core.Refused("monitor", "no program"))
    else:
        assert world.tick() == []
        world.now += 11.0
    assert core.Start("ta") in world.tick()
    world.tell(core.Ready("ta"))
    assert world.fleet.ready


def test_a_process_that_dies_is_started_again_and_counted() -> None:
    """One death costs one restart, after a short pause, of that process alone."""
    world = World()
    world.all_ready()
    world.tell(core.Exited("router", -9, "bye"))
    assert not world.fleet.ready
    assert world.fleet.known["router"].note == "killed by signal 9: bye"
    assert world.tick(0.1) == []
    assert world.tick(0.2) == [core.Start("router")]
    world.tell(core.Ready("router"))
    assert world.fleet.ready
    assert [status.restarts for status in world.fleet.status] == [1, 0, 0]


def test_pauses_grow_with_failures_in_a_row_up_to_a_bound() -> None:
    """A process that keeps dying does not keep the machine busy."""
    world = World()
    world.all_ready()
    pauses = []
    for _ in range(9):
        world.tell(core.Exited("router", 1))
        began = world.now
        while not world.tick():
            pass
        pauses.append(world.now - began)
        world.tell(core.Ready("router"))
    assert pauses == sorted(pauses)
    assert pauses[0] < 0.3
    assert pauses[-1] == pytest.approx(core.LONGEST_PAUSE_S, abs=0.1)


def test_a_death_after_a_long_good_time_counts_as_the_first() -> None:
    """Old failures are forgotten."""
    world = World()
    world.all_ready()
    for _ in range(5):
        world.now += 2 * core.SETTLED_S
        world.tell(core.Exited("router", 1))
        assert world.fleet.known["router"].failures == 1
        world.tick(0.3)
        world.tell(core.Ready("router"))


def test_a_process_that_never_gets_ready_is_given_up() -> None:
    """It ends with the last words of the process."""
    world = World()
    for _ in range(core.ATTEMPTS):
        world.tick(6.0)
        world.tell(core.Exited("router", 1, "ImportError: no module named x"))
    assert world.state("router") is ProcessState.GIVEN_UP
    assert "ImportError" in world.fleet.known["router"].note
    assert world.tick(100.0) == []


def test_deaths_after_it_was_ready_are_no_failed_attempts() -> None:
    """Only ends in a row without being ready count; one that served and is given up has the robot
    held.
    """
    world = World((THREE[0],))
    for _ in range(core.ATTEMPTS - 1):
        world.tick(6.0)
        world.tell(core.Ready("router"))
        world.tell(core.Exited("router", -9))
    for attempt in range(core.ATTEMPTS):
        assert world.state("router") is ProcessState.BACKING_OFF, attempt
        assert world.fleet.failing == ()
        world.tick(6.0)
        world.tell(core.Exited("router", 1, "Address already in use"))
    assert world.state("router") is ProcessState.GIVEN_UP
    assert world.fleet.failing == ("router",)


def test_what_the_machine_cannot_start_now_is_tried_without_end() -> None:
    """No memory or no disk: it may be there later, and nothing of the program is at fault."""
    world = World()
    for _ in range(3 * core.ATTEMPTS):
        assert core.Start("router") in world.tick(6.0)
        world.tell(core.NotStarted("router", "[Errno 11] Resource temporarily unavailable"))
        assert world.tick(0.0) == []
    world.tick(6.0)
    world.tell(core.Ready("router"))
    assert world.state("router") is ProcessState.READY


def test_a_wrong_option_is_not_tried_again() -> None:
    """Exit code 2 is a usage error."""
    world = World()
    world.tick()
    world.tell(core.Exited("router", USAGE_ERROR, "Invalid value for --speed"))
    assert world.state("router") is ProcessState.GIVEN_UP


def test_the_end_comes_in_reverse_order() -> None:
    """The last one started ends first; each is asked once."""
    world = World()
    world.all_ready()
    world.fleet = core.stop(world.fleet)
    ended = [action for _ in range(4) for action in world.tick()]
    assert ended == [core.Terminate("ta"), core.Terminate("monitor"), core.Terminate("router")]
    assert world.fleet.ended


def test_agents_start_beside_the_monitor_and_end_before_it() -> None:
    """It reads their logs, so it misses nothing of their start; its report has their end."""
    world = World((*around(), *agents("a", "ta")))
    world.tick()
    world.tell(core.Ready("router"))
    assert [*world.tick(), *world.tick()] == [core.Start("monitor"), core.Start("ta")]
    world.fleet = core.stop(world.fleet)
    ended = [action for _ in range(4) for action in world.tick()]
    assert ended == [core.Terminate("ta"), core.Terminate("monitor"), core.Terminate("router")]


def test_who_does_not_end_in_order_is_killed_once() -> None:
    """SIGKILL follows after the time the table gives."""
    world = World()
    world.all_ready()
    world.deaf = {"ta"}
    world.fleet = core.stop(world.fleet)
    assert world.tick() == [core.Terminate("ta")]
    assert world.tick(4.0) == []
    assert world.tick(2.0) == [core.Kill("ta")]
    assert "did not stop in 5 s" in world.fleet.known["ta"].note


def test_a_table_out_of_order_is_refused_by_name() -> None:
    """The processes that one waits for stand before it, so there is no circle."""
    with pytest.raises(
        ValueError, match="ta starts after monitor, but \\['router'\\] stands before it"
    ):
        core.begin((THREE[0], THREE[2], THREE[1]), 0.0)


def test_loop_and_agent_of_ex_are_siblings() -> None:
    """Each is restarted without the other."""
    world = World(PROCESSES)
    world.all_ready()
    for name in ("loop", "ex"):
        world.tell(core.Exited(name, -9))
        assert [action for _ in range(10) for action in world.tick()] == [core.Start(name)]
        world.tell(core.Ready(name))


happenings = st.lists(
    st.tuples(
        st.sampled_from([process.name for process in PROCESSES]),
        st.sampled_from(["ready", "dies", "wrong", "stop", "nothing"]),
        st.floats(0.0, 8.0),
    ),
    max_size=60,
)


@given(happenings)
def test_whatever_happens_the_end_is_reached_and_nothing_runs_twice(
    story: list[tuple[str, str, float]],
) -> None:
    """Starts only what does not run, stops only what does, and always comes to an end when
    asked.
    """
    world = World(PROCESSES)
    for name, what, seconds in story:
        running = {known.process.name for known in world.fleet.known.values() if known.running}
        for action in world.tick(seconds):
            assert isinstance(action, core.Start) == (action.name not in running)
        if what == "stop":
            world.fleet = core.stop(world.fleet)
        elif world.fleet.known[name].running:
            event = {
                "ready": core.Ready(name),
                "dies": core.Exited(name, 1),
                "wrong": core.Exited(name, 2),
            }.get(what)
            if event is not None:
                world.tell(event)
    world.fleet = core.stop(world.fleet)
    for _ in range(10):
        world.tick(100.0)
    assert world.fleet.ended
    assert not any(status.pid for status in world.fleet.status)
    assert msgspec.json.encode(world.fleet.status)


@given(data=st.data())
def test_what_a_dead_supervisor_left_is_ended_in_order_and_nothing_is_started(
    data: st.DataObject,
) -> None:
    """This holds for any surviving part of the real table, any deaf processes, and any time of
    their ends.
    """
    world = World(PROCESSES)
    names = [process.name for process in PROCESSES]
    found = data.draw(st.sets(st.sampled_from(names)))
    world.deaf = data.draw(st.sets(st.sampled_from(names)))
    for number, name in enumerate(sorted(found)):
        world.tell(core.Found(name, 100 + number))
    world.fleet = core.stop(world.fleet)
    for _ in range(5 * len(names)):
        world.tick(data.draw(st.sampled_from([0.05, 10.0, 130.0])))
    world.tick(200.0)
    for _ in names:
        world.tick(200.0)
    assert world.fleet.ended
    assert not any(isinstance(action, core.Start) for action in world.log)
    assert {action.name for action in world.log} == found


# --- heartbeats -----------------------------------------------------------------------------------


def silent(world: World, name: str, seconds: float) -> list[core.Action]:
    """Look for so long, and hear everybody but this one."""
    actions = []
    for _ in range(round(seconds / core.PERIOD_S)):
        world.fleet = core.look(world.fleet, frozenset(world.fleet.known) - {name})
        actions += world.tick(core.PERIOD_S)
    return actions


def test_one_that_hangs_is_told_then_killed_once_then_started_again() -> None:
    """After two seconds, after six; the note of its restart says why."""
    world = World()
    world.all_ready()
    world.fleet = core.look(world.fleet, frozenset(world.fleet.known))
    assert silent(world, "ta", 1.8) == []
    assert world.fleet.known["ta"].note == ""
    assert silent(world, "ta", 4.0) == []
    assert world.fleet.known["ta"].note == "hangs: no heartbeat for 5 s"
    assert silent(world, "ta", 0.25) == [core.Kill("ta")]
    assert world.fleet.known["ta"].note == "killed: it hung, no heartbeat for 6 s"
    assert silent(world, "ta", 6.0) == [core.Start("ta")]
    assert world.fleet.known["ta"].restarts == 1


def test_one_that_beats_again_is_forgiven() -> None:
    """A busy machine: nothing was done, and nothing is said any more."""
    world = World()
    world.all_ready()
    world.fleet = core.look(world.fleet, frozenset(world.fleet.known))
    silent(world, "ta", 5.0)
    world.fleet = core.look(world.fleet, frozenset({"ta"}))
    assert world.fleet.known["ta"].note == ""
    assert silent(world, "ta", 5.0) == []


def test_one_that_freezes_before_it_is_ready_is_killed() -> None:
    """After its first heartbeat as any other; before it after a minute, since imports take their
    time.
    """
    world = World((THREE[0],))
    world.tick()
    assert silent(world, "router", core.BORN_WITHIN_S - 0.1) == []
    assert core.Kill("router") in silent(world, "router", 0.2)
    silent(world, "router", 1.0)
    world.fleet = core.look(world.fleet, frozenset({"router"}))
    assert core.Kill("router") in silent(world, "router", THREE[0].hangs_s + 0.1)


def test_one_that_is_ready_and_has_no_heartbeat_is_let_be() -> None:
    """A program that knows nothing of heartbeats."""
    world = World((THREE[0],))
    world.tick()
    world.tell(core.Ready("router"))
    assert silent(world, "router", 500.0) == []


def test_one_that_is_asked_to_end_may_be_silent() -> None:
    """It writes its report; `stop_within_s` bounds that."""
    world = World((msgspec.structs.replace(THREE[0], stop_within_s=100.0),))
    world.deaf.add("router")
    world.tick()
    world.fleet = core.look(world.fleet, frozenset({"router"}))
    world.fleet = core.stop(world.fleet)
    assert silent(world, "router", 50.0) == [core.Terminate("router")]


def test_a_machine_that_was_suspended_kills_nobody() -> None:
    """Silence is counted in looks: an hour between two of them is one look."""
    world = World()
    world.all_ready()
    world.fleet = core.look(world.fleet, frozenset(world.fleet.known))
    world.fleet = core.look(world.fleet, frozenset())
    assert world.tick(3600.0) == []


def test_one_that_cannot_be_kept_alive_is_given_up_and_named() -> None:
    """Ready and dead, again and again; at the pace at which a test or a person kills it, it is
    restarted for ever.
    """
    for every_s, failing in ((0.5, True), (10.0, False)):
        world = World((THREE[0],))
        for _ in range(200):
            if any(isinstance(action, core.Start) for action in world.tick(every_s)):
                world.tell(core.Ready("router"))
                world.tell(core.Exited("router", -11, "boom"))
        assert (world.fleet.failing == ("router",)) is failing
        assert (world.fleet.known["router"].state is ProcessState.GIVEN_UP) is failing
    assert world.fleet.known["router"].restarts > core.MOST_DEATHS


def test_a_look_after_some_periods_counts_as_many() -> None:
    """Where all is well looks are rarer, and a hang is seen as soon."""
    often, seldom = World(), World()
    for world in (often, seldom):
        world.all_ready()
        world.fleet = core.look(world.fleet, frozenset(world.fleet.known))
    for _ in range(10 * core.REST_PERIODS):
        often.fleet = core.look(often.fleet, frozenset())
    for _ in range(10):
        seldom.fleet = core.look(seldom.fleet, frozenset(), core.REST_PERIODS)
    assert often.fleet.known == seldom.fleet.known


def test_it_rests_while_each_is_ready_or_given_up() -> None:
    """Not while one starts, waits for its restart or ends."""
    world = World()
    assert not world.fleet.resting
    world.all_ready()
    assert world.fleet.resting
    world.tell(core.Exited("ta", 1))
    assert not world.fleet.resting
    world.fleet = core.stop(world.fleet)
    assert not world.fleet.resting
