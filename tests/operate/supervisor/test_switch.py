"""A process that is switched off stays down, whatever happens, until somebody switches it on
again.
"""

from hypothesis import given
from hypothesis import strategies as st

from agent_runtime.io.options import USAGE_ERROR
from operate.fleet_file import ProcessState
from operate.supervisor import core
from operate.supervisor.processes import Process

TWO = (Process("router", "r"), Process("ta", "t", after=("router",)))


class World:
    """Two processes that do as they are told, at once."""

    def __init__(self) -> None:
        self.now, self.fleet, self.pid = 0.0, core.begin(TWO, 0.0), 100
        self.started: list[str] = []

    def turn(self, off: frozenset[str]) -> None:
        """One step of the shell, a tenth of a second later."""
        self.now += 0.1
        self.fleet, actions = core.decide(core.switch(self.fleet, off, self.now), self.now)
        for action in actions:
            match action:
                case core.Start(name=name):
                    self.started.append(name)
                    self.pid += 1
                    self.tell(core.Started(name, self.pid))
                    self.tell(core.Ready(name))
                case core.Terminate(name=name) | core.Kill(name=name):
                    self.tell(core.Exited(name, 0))

    def tell(self, event: core.Event) -> None:
        self.fleet = core.take(self.fleet, event, self.now)


turns = st.lists(
    st.tuples(st.sets(st.sampled_from(["router", "ta", "nobody"])), st.booleans()), max_size=12
)


@given(turns)
def test_who_is_off_is_down_and_who_is_on_comes_up(told: list[tuple[set[str], bool]]) -> None:
    """Also when it died just before; in the end all that may run do."""
    world = World()
    for off, dies in told:
        if dies and world.fleet.known["ta"].running:
            world.tell(core.Exited("ta", -9))
        before = len(world.started)
        world.turn(frozenset(off))
        assert not set(world.started[before:]) & off
        for name in off & {"router", "ta"}:
            known = world.fleet.known[name]
            assert known.state is ProcessState.STOPPED
            assert known.note == core.OFF
    for _ in range(60):
        world.turn(frozenset())
    assert world.fleet.ready


def test_switched_on_again_is_no_failure() -> None:
    """A restart by hand is not counted as one that was needed, and revives who was given up."""
    world = World()
    world.turn(frozenset())
    world.turn(frozenset())
    world.tell(core.Exited("ta", USAGE_ERROR))
    assert world.fleet.known["ta"].state is ProcessState.GIVEN_UP
    world.turn(frozenset({"ta"}))
    world.turn(frozenset())
    assert world.fleet.known["ta"].state is ProcessState.READY
    assert world.fleet.known["ta"].restarts == 0
