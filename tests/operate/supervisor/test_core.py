"""The supervisor's core: what it orders, whatever happens in whatever order."""

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agent_runtime.io.options import USAGE_ERROR
from companion.tools.system import PROCESSES
from operate.fleet_file import ProcessState
from operate.supervisor import core
from operate.supervisor.core import Kill, Start, Terminate
from operate.system import Process, agents, around

ROUTER = Process("router", "r")
THREE = (
    ROUTER,
    Process("monitor", "m", after=("router",), optional=True),
    Process("ta", "t", after=("router", "monitor")),
)
TA_FIRST = [Terminate("ta"), Terminate("monitor"), Terminate("router")]


class World:
    """Pretended processes under a core: does at once what is ordered, and dies or gets ready when
    told to. `ready`: all are.
    """

    def __init__(self, *processes: Process, ready: bool = False) -> None:
        self.now = 0.0
        self.fleet = core.begin(processes or THREE, self.now)
        self.log: list[core.Action] = []
        self.deaf: set[str] = set()
        self.alive: set[str] = set()
        self.by_hand = False  # somebody switches processes off: no order holds
        if ready:
            for _ in self.fleet.known:
                self.readily(0.05)
            assert self.fleet.ready

    def tick(self, seconds: float = 0.05) -> list[core.Action]:
        """Let time pass; give what was ordered."""
        self.now += seconds
        self.fleet, actions = core.decide(self.fleet, self.now)
        for action in actions:
            self.log.append(action)
            match action:
                case Start(name=name):
                    before = self[name].process.after
                    assert self.by_hand or all(map(self.ready_or_optional, before))
                    self.tell(core.Started(name, pid=100 + len(self.log)))
                case Terminate(name=name):
                    known = self.fleet.known.values()
                    followers = [one for one in known if name in one.process.after]
                    assert self.by_hand or not any(one.running for one in followers)
                    if name not in self.deaf:
                        self.dies(name, 0)
                case Kill(name=name):
                    self.dies(name, -9)
        return actions

    def readily(self, seconds: float) -> list[core.Action]:
        """Let time pass; whatever is started is ready at once."""
        actions = self.tick(seconds)
        for action in actions:
            if isinstance(action, Start):
                self.tell(core.Ready(action.name))
        return actions

    def __getitem__(self, name: str) -> core.Known:
        return self.fleet.known[name]

    def ready_or_optional(self, name: str) -> bool:
        known = self[name]
        ready = known.state is ProcessState.READY
        return ready or known.process.optional or known.restarts > 0

    def tell(self, event: core.Event) -> None:
        if isinstance(event, core.Started):
            self.alive.add(event.name)
        elif isinstance(event, core.Exited):
            self.alive.discard(event.name)
        self.fleet = core.take(self.fleet, event, self.now)

    def dies(self, name: str, code: int = 1, last: str = "") -> None:
        self.tell(core.Exited(name, code, last))

    def stops(self, ticks: int = 4) -> list[core.Action]:
        """Ask it to end, and give what it orders then."""
        self.fleet = core.stop(self.fleet)
        return [action for _ in range(ticks) for action in self.tick()]

    def hears(self, *names: str, periods: int = 1) -> None:
        """Look at heartbeats: these beat."""
        self.fleet = core.look(self.fleet, frozenset(names), periods)

    def silent(self, name: str, seconds: float) -> list[core.Action]:
        """Look for so long, and hear everybody but this one."""
        actions = []
        for _ in range(round(seconds / core.PERIOD_S)):
            self.hears(*set(self.fleet.known) - {name})
            actions += self.tick(core.PERIOD_S)
        return actions


def test_a_process_starts_when_all_before_it_are_ready() -> None:
    """First the router alone, then the next, and nobody twice."""
    world = World()
    for name in ("router", "monitor", "ta"):
        assert world.tick() == [Start(name)]
        assert world.tick() == []
        world.tell(core.Ready(name))


@pytest.mark.parametrize("how", ["never ready", "given up"])
def test_nobody_waits_long_for_an_optional_process(how: str) -> None:
    """The robot works without its recorder."""
    world = World()
    world.readily(0.05)
    world.tick()
    if how == "given up":
        world.tell(core.Refused("monitor", "no program"))
    else:
        assert world.tick() == []
        world.now += 11.0
    assert Start("ta") in world.readily(0.05)
    assert world.fleet.ready


def test_a_process_that_dies_is_started_again_and_counted() -> None:
    """One death costs one restart, after a short pause, of that process alone."""
    world = World(ready=True)
    world.dies("router", -9, "bye")
    assert not world.fleet.ready
    assert world["router"].note == "killed by signal 9: bye"
    assert world.tick(0.1) == []
    assert world.readily(0.2) == [Start("router")]
    assert world.fleet.ready
    assert [status.restarts for status in world.fleet.status] == [1, 0, 0]


def test_pauses_grow_with_failures_in_a_row_up_to_a_bound() -> None:
    """A process that keeps dying does not keep the machine busy; old failures are forgotten."""
    world, pauses = World(ready=True), []
    for _ in range(9):
        world.dies("router")
        began = world.now
        while not world.readily(0.05):
            pass
        pauses.append(world.now - began)
    assert pauses == sorted(pauses)
    assert pauses[0] < 0.3
    assert pauses[-1] == pytest.approx(core.LONGEST_PAUSE_S, abs=0.1)
    for _ in range(5):
        world.now += 2 * core.SETTLED_S
        world.dies("router")
        assert world["router"].failures == 1
        world.readily(0.3)


def test_a_process_that_never_gets_ready_is_given_up() -> None:
    """It ends with the last words of the process."""
    world = World()
    for _ in range(core.ATTEMPTS):
        world.tick(6.0)
        world.dies("router", 1, "ImportError: no module named x")
    assert world["router"].state is ProcessState.GIVEN_UP
    assert "ImportError" in world["router"].note
    assert world.tick(100.0) == []


def test_deaths_after_it_was_ready_are_no_failed_attempts() -> None:
    """Only ends in a row without being ready count; one that served and is given up has the robot
    held.
    """
    world = World(ROUTER)
    for _ in range(core.ATTEMPTS - 1):
        world.readily(6.0)
        world.dies("router", -9)
    for attempt in range(core.ATTEMPTS):
        assert world["router"].state is ProcessState.BACKING_OFF, attempt
        assert world.fleet.failing == ()
        world.tick(6.0)
        world.dies("router", 1, "Address already in use")
    assert world["router"].state is ProcessState.GIVEN_UP
    assert world.fleet.failing == ("router",)


def test_what_the_machine_cannot_start_now_is_tried_without_end() -> None:
    """No memory or no disk: it may be there later, and nothing of the program is at fault."""
    world = World()
    for _ in range(3 * core.ATTEMPTS):
        assert Start("router") in world.tick(6.0)
        world.tell(core.NotStarted("router", "[Errno 11] Resource temporarily unavailable"))
        assert world.tick(0.0) == []
    world.readily(6.0)
    assert world["router"].state is ProcessState.READY


def test_a_wrong_option_is_not_tried_again() -> None:
    """Exit code 2 is a usage error."""
    world = World()
    world.tick()
    world.dies("router", USAGE_ERROR, "Invalid value for --speed")
    assert world["router"].state is ProcessState.GIVEN_UP


def test_agents_start_beside_the_monitor_and_end_before_it() -> None:
    """It reads their logs, so it misses nothing of their start; its report has their end. The last
    one started ends first; each is asked once.
    """
    world = World(*around(), *agents("a", "ta"))
    world.readily(0.05)
    assert [*world.tick(), *world.tick()] == [Start("monitor"), Start("ta")]
    assert world.stops() == TA_FIRST
    whole = World(ready=True)
    assert whole.stops() == TA_FIRST
    assert whole.fleet.ended


def test_who_does_not_end_in_order_is_killed_once() -> None:
    """SIGKILL follows after the time the table gives."""
    world = World(ready=True)
    world.deaf = {"ta"}
    assert world.stops(1) == [Terminate("ta")]
    assert world.tick(4.0) == []
    assert world.tick(2.0) == [Kill("ta")]
    assert "did not stop in 5 s" in world["ta"].note


def test_a_table_out_of_order_is_refused_by_name() -> None:
    """The processes that one waits for stand before it, so there is no circle."""
    why = r"ta starts after monitor, but \['router'\] stands before it"
    with pytest.raises(ValueError, match=why):
        core.begin((THREE[0], THREE[2], THREE[1]), 0.0)


def test_loop_and_agent_of_ex_are_siblings() -> None:
    """Each is restarted without the other."""
    world = World(*PROCESSES, ready=True)
    for name in ("loop", "ex"):
        world.dies(name, -9)
        assert [action for _ in range(10) for action in world.readily(0.05)] == [Start(name)]


NAMES = [process.name for process in PROCESSES]
EVENTS = {"ready": core.Ready, "dies": lambda name: core.Exited(name, 1),
          "wrong": lambda name: core.Exited(name, 2)}  # fmt: skip
happenings = st.lists(
    st.tuples(
        st.sampled_from(NAMES),
        st.sampled_from([*EVENTS, "stop", "nothing"]),
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
    world = World(*PROCESSES)
    for name, what, seconds in story:
        running = {known.process.name for known in world.fleet.known.values() if known.running}
        for action in world.tick(seconds):
            assert isinstance(action, Start) == (action.name not in running)
        if what == "stop":
            world.fleet = core.stop(world.fleet)
        elif world[name].running and what in EVENTS:
            world.tell(EVENTS[what](name))
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
    world = World(*PROCESSES)
    found = data.draw(st.sets(st.sampled_from(NAMES)))
    world.deaf = data.draw(st.sets(st.sampled_from(NAMES)))
    for number, name in enumerate(sorted(found)):
        world.tell(core.Found(name, 100 + number))
    world.fleet = core.stop(world.fleet)
    for _ in range(5 * len(NAMES)):
        world.tick(data.draw(st.sampled_from([0.05, 10.0, 130.0])))
    for _ in range(len(NAMES) + 1):
        world.tick(200.0)
    assert world.fleet.ended
    assert not any(isinstance(action, Start) for action in world.log)
    assert {action.name for action in world.log} == found


# --- heartbeats -----------------------------------------------------------------------------------


def test_one_that_hangs_is_told_then_killed_once_then_started_again() -> None:
    """After two seconds, after six; the note of its restart says why."""
    world = World(ready=True)
    world.hears(*world.fleet.known)
    assert world.silent("ta", 1.8) == []
    assert world["ta"].note == ""
    assert world.silent("ta", 4.0) == []
    assert world["ta"].note == "hangs: no heartbeat for 5 s"
    assert world.silent("ta", 0.25) == [Kill("ta")]
    assert world["ta"].note == "killed: it hung, no heartbeat for 6 s"
    assert world.silent("ta", 6.0) == [Start("ta")]
    assert world["ta"].restarts == 1


def test_one_that_beats_again_is_forgiven() -> None:
    """A busy machine: nothing was done, and nothing is said any more."""
    world = World(ready=True)
    world.hears(*world.fleet.known)
    world.silent("ta", 5.0)
    world.hears("ta")
    assert world["ta"].note == ""
    assert world.silent("ta", 5.0) == []


def test_one_that_freezes_before_it_is_ready_is_killed() -> None:
    """After its first heartbeat as any other; before it after a minute, since imports take their
    time.
    """
    world = World(ROUTER)
    world.tick()
    assert world.silent("router", core.BORN_WITHIN_S - 0.1) == []
    assert Kill("router") in world.silent("router", 0.2)
    world.silent("router", 1.0)
    world.hears("router")
    assert Kill("router") in world.silent("router", ROUTER.hangs_s + 0.1)


def test_one_that_is_ready_and_has_no_heartbeat_is_let_be() -> None:
    """A program that knows nothing of heartbeats."""
    world = World(ROUTER, ready=True)
    assert world.silent("router", 500.0) == []


def test_one_that_is_asked_to_end_may_be_silent() -> None:
    """It writes its report; `stop_within_s` bounds that."""
    world = World(msgspec.structs.replace(ROUTER, stop_within_s=100.0))
    world.deaf.add("router")
    world.tick()
    world.hears("router")
    world.fleet = core.stop(world.fleet)
    assert world.silent("router", 50.0) == [Terminate("router")]


def test_a_machine_that_was_suspended_kills_nobody() -> None:
    """Silence is counted in looks: an hour between two of them is one look."""
    world = World(ready=True)
    world.hears(*world.fleet.known)
    world.hears()
    assert world.tick(3600.0) == []


def test_one_that_cannot_be_kept_alive_is_given_up_and_named() -> None:
    """Ready and dead, again and again; at the pace at which a test or a person kills it, it is
    restarted for ever.
    """
    for every_s, optional, given_up in (
        (0.5, False, True),
        (0.5, True, True),
        (10.0, False, False),
    ):
        world = World(msgspec.structs.replace(ROUTER, optional=optional))
        for _ in range(200):
            if world.readily(every_s):
                world.dies("router", -11, "boom")
        # without an optional one the robot need not be held
        assert world.fleet.failing == (("router",) if given_up and not optional else ())
        assert (world["router"].state is ProcessState.GIVEN_UP) is given_up
    assert world["router"].restarts > core.MOST_DEATHS


def test_a_look_after_some_periods_counts_as_many() -> None:
    """Where all is well looks are rarer, and a hang is seen as soon."""
    often, seldom = World(ready=True), World(ready=True)
    for world, periods in ((often, 1), (seldom, core.REST_PERIODS)):
        world.hears(*world.fleet.known)
        for _ in range(10 * core.REST_PERIODS // periods):
            world.hears(periods=periods)
    assert often.fleet.known == seldom.fleet.known


def test_it_rests_while_each_is_ready_or_given_up() -> None:
    """Not while one starts, waits for its restart or ends."""
    assert not World().fleet.resting
    world = World(ready=True)
    assert world.fleet.resting
    world.dies("ta")
    assert not world.fleet.resting
    world.fleet = core.stop(world.fleet)
    assert not world.fleet.resting


# --- switched off ---------------------------------------------------------------------------------


def switched(world: World, *off: str) -> list[core.Action]:
    """One step of the shell, a tenth of a second later, with these switched off."""
    world.by_hand, world.fleet = True, core.switch(world.fleet, frozenset(off), world.now)
    return world.readily(0.1)


turns = st.lists(
    st.tuples(st.sets(st.sampled_from(["router", "ta", "nobody"])), st.booleans()), max_size=12
)


@given(turns)
def test_who_is_off_is_down_and_who_is_on_comes_up(told: list[tuple[set[str], bool]]) -> None:
    """Whatever happens, also when it died just before; in the end all that may run do."""
    world = World(ROUTER, Process("ta", "t", after=("router",)))
    for off, dies in told:
        if dies and world["ta"].running:
            world.dies("ta", -9)
        started = {one.name for one in switched(world, *off) if isinstance(one, Start)}
        assert not started & off
        for name in off & {"router", "ta"}:
            assert name not in world.alive
            assert (world[name].state, world[name].note) == (ProcessState.STOPPED, core.OFF)
    for _ in range(60):
        switched(world)
    assert world.fleet.ready


def test_switched_on_again_is_no_failure() -> None:
    """A restart by hand is not counted as one that was needed, and revives who was given up."""
    world = World(ready=True)
    world.dies("ta", USAGE_ERROR)
    assert world["ta"].state is ProcessState.GIVEN_UP
    switched(world, "ta")
    switched(world)
    assert world["ta"].state is ProcessState.READY
    assert (world["ta"].restarts, world["ta"].failures) == (0, 0)
