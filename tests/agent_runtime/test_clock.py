"""The clock of an agent is even, whatever becomes of the wall clock."""

from hypothesis import given
from hypothesis import strategies as st

from agent_runtime.io.logs import Clock


@given(st.lists(st.tuples(st.floats(0.0, 1e4), st.floats(-1e5, 1e5)), max_size=20))
def test_it_tells_the_time_that_passed(changes: list[tuple[float, float]]) -> None:
    """Not what the wall clock was set to meanwhile; it begins with the wall's time."""
    wall, steady = [1.7e9], [50.0]
    clock = Clock(lambda: wall[0], lambda: steady[0])
    passed = 0.0
    for seconds, moved in changes:
        steady[0] += seconds
        wall[0] += seconds + moved
        passed += seconds
        assert abs(clock.now() - (1.7e9 + passed)) < 1e-3


def test_a_restart_begins_with_the_wall_clock() -> None:
    """So a deadline in a journal is compared with what people call the time."""
    assert Clock(lambda: 5.0, lambda: 99.0).now() == 5.0
