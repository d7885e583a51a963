"""The fingers' set-points, cycle by cycle."""

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from companion.skills.loop_messages import Close, Move, Open
from services.executor.loop.hands import Fingers
from velma.names import FINGER_UPPER
from velma.sim.backend import at_rest, no_command

angles = st.floats(0.0, FINGER_UPPER)
commands = st.one_of(
    st.builds(Move, st.tuples(angles, angles, angles), st.just(3.0), st.floats(0.0, 3.0)),
    st.builds(Close, st.floats(0.0, 0.7), angles, st.just(0.3)),
    st.builds(Open, angles, st.just(3.0)),
    st.just("freeze"),
)
happenings = st.tuples(
    st.integers(1, 900), st.integers(0, 1), commands, st.sampled_from([0.2, 0.6, FINGER_UPPER])
)


@settings(max_examples=40, deadline=None)
@example([(900, 0, Close(0.0), 0.2)], 0)  # it waits for the lock while no motor moves
@given(st.lists(happenings, min_size=1, max_size=4), st.integers(0, 2**32 - 1))
def test_fingers_at_rest_command_what_computed_ones_do(told, seed):
    """Beside fingers that compute each cycle in full; the joints follow the motors, with some
    error, until they meet something.
    """
    ours, theirs = Fingers(), Fingers()
    sent, expected = no_command(), no_command()
    rng, state = np.random.default_rng(seed), at_rest()
    for cycles, row, command, meets in [*told, (5, 0, "freeze", FINGER_UPPER)]:
        for fingers in (ours, theirs):
            if command == "freeze":
                fingers.freeze()
            elif not (fingers.locked[row] and isinstance(command, Move | Close)):
                fingers.begin(row, command)
        for _ in range(cycles):
            state.proximal[:] = np.minimum(ours.motor, meets) + rng.normal(0.0, 1e-3, (2, 3))
            state.distal[:] = np.minimum(ours.motor, meets) / 3.0
            theirs._settled = False
            ours.update(state, sent, 0.002)
            theirs.update(state, expected, 0.002)
            for name in ("spread", "proximal", "distal", "locked"):
                np.testing.assert_array_equal(getattr(sent, name), getattr(expected, name))
        state.spread[:] = ours.spread
    assert ours._settled, "nothing is computed for fingers at rest"
