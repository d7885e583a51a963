"""When the robot's state is told: at once where anything changed, seldom where only time passed."""

import msgspec
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from services.executor.loop.__main__ import build
from services.executor.loop.link import AgentLink, LoopAnswer
from services.executor.loop.process import Speed
from services.executor.telemetry import STILL_S, News, seen
from velma.model import scene
from velma.sim.mujoco_backend import MujocoBackend


@given(st.lists(st.tuples(st.floats(0.01, 2.0), st.integers(0, 1)), min_size=2))
def test_a_change_is_told_at_once_and_what_stays_every_half_second(looks):
    """Nothing that was looked at stays untold for longer than the time between two looks plus half
    a second.
    """
    news, now, last, told_at = News(), 0.0, None, None
    for after, what in looks:
        now += after
        due = news.due((what,), now)
        changed = what != last
        assert due == (changed or now >= told_at + STILL_S)
        if due:
            last, told_at = what, now


def test_time_alone_is_nothing_that_a_viewer_sees(tmp_path):
    """A robot that stands still is seen alike a second later; one whose hand, mode or act changed
    is not.
    """
    path = tmp_path / "loop.slots"
    build(path, MujocoBackend(scene.load()), speed=Speed.MAX, realtime=False)
    state = AgentLink(path).state()
    shown = seen(state, LoopAnswer(), "")
    replace = msgspec.structs.replace
    assert (
        seen(replace(state, time_s=state.time_s + 1.0, cycles=state.cycles + 500), LoopAnswer(), "")
        == shown
    )
    for change in (
        {"hands": np.ones(16).tobytes()},
        {"mode": "stopped"},
        {"faults": 1},
        {"world": b""},
    ):
        assert seen(replace(state, **change), LoopAnswer(), "") != shown, change
    assert seen(state, LoopAnswer(taken=1), "") != shown
    assert seen(state, LoopAnswer(), "Grasp") != shown
