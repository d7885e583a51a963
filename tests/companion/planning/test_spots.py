"""Spots to put something down, as they are offered: some at a time, ever farther from those that
did not do.
"""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from companion.languages import wm
from companion.planning import placing as under_test
from companion.planning.placing import NEAR_M, TOGETHER, Spot

ROOM = 1.0  # [m] side of the square in which spots are


class Free:
    """km's answer about the room over spots: those with x below `taken` are not free."""

    def __init__(self, taken):
        self.taken = taken
        self.ask = self.answer

    def answer(self, query, _):
        return wm.Objects(("box_1",) if query.volume.at.xyz[0] < self.taken else ())


points = st.lists(st.tuples(*[st.floats(0.0, ROOM)] * 2), max_size=120, unique=True)


@given(points, st.sampled_from((0.0, 0.4, 2.0)))
def test_each_time_free_spots_are_offered_farther_from_those_before(xy, taken):
    """All of them free, at most so many together, and a step farther from each earlier one each
    time.
    """
    found = [Spot("table_1", np.array([x, y, 0.8])) for x, y in xy]
    offered = list(under_test._free(Free(taken), "s", found, "jar_1"))
    assert all(1 <= len(some) <= TOGETHER for some in offered)
    assert all(spot.at[0] >= taken for some in offered for spot in some)
    for number, some in enumerate(offered):
        before = [spot for earlier in offered[:number] for spot in earlier]
        assert not any(spot.near(before, NEAR_M * (number + 1)) for spot in some), number


def test_a_free_spot_is_always_offered_if_there_is_one():
    """The first free one in their order, also among many that are not."""
    found = [Spot("table_1", np.array([x, 0.5, 0.8])) for x in np.linspace(0.0, ROOM, 41)]
    first = next(under_test._free(Free(0.9), "s", found, "jar_1"))
    assert first[0].at[0] >= 0.9
