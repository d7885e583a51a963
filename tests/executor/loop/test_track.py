"""A track: set-points that never jump."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.executor.loop.program import KNOT_S
from services.executor.loop.track import BRAKE_S, FARTHEST_START, Track
from velma.errors import MotionError
from velma.names import START

DT = 0.002


def knots(seconds=1.0, reach=0.3):
    """A smooth rise of every joint."""
    u = np.linspace(0, 1, round(seconds / KNOT_S) + 1)
    return START + reach * (u**3 * (10 - 15 * u + 6 * u * u))[:, None]


def walk(track, most=5000):
    q, v = [track.q.copy()], [track.v.copy()]
    while not track.ended and len(q) < most:
        track.advance(DT)
        q.append(track.q.copy())
        v.append(track.v.copy())
    return np.array(q), np.array(v)


@settings(max_examples=25, deadline=None)
@given(offset=st.floats(-0.99 * FARTHEST_START, 0.99 * FARTHEST_START), seconds=st.floats(0.3, 2.0))
def test_position_is_the_integral_of_velocity_and_ends_at_the_last_knot(offset, seconds):
    """Wherever near the first knot the body was, it follows without a jump and arrives."""
    path = knots(seconds)
    q, v = walk(Track(path, START + offset))
    np.testing.assert_allclose(q[0], START + offset)
    np.testing.assert_allclose(q[-1], path[-1], atol=1e-12)
    np.testing.assert_array_equal(v[-1], 0)
    fastest = np.abs(np.diff(path, axis=0)).max() / KNOT_S + abs(offset) * 1.875 / 0.3
    assert np.abs(np.diff(q, axis=0)).max() <= (fastest + 1e-6) * DT * 1.05
    travelled = (0.5 * (v[1:] + v[:-1])).sum(axis=0) * DT
    np.testing.assert_allclose(travelled, q[-1] - q[0], atol=0.02 * abs(path[-1] - q[0]).max() + 2e-3)


@settings(max_examples=25, deadline=None)
@given(after=st.integers(0, 400))
def test_braking_comes_to_rest_on_the_path(after):
    """Velocity falls to zero within the braking time, and the position stays one of the path."""
    path = knots()
    track = Track(path, START)
    for _ in range(after):
        track.advance(DT)
    track.brake()
    q, v = walk(track)
    assert (len(q) - 1) * DT <= BRAKE_S + 2 * DT
    assert np.abs(np.diff(v, axis=0)).max() < 0.02
    along = (q[-1] - START) / 0.3
    np.testing.assert_allclose(along, along[0], atol=1e-9)
    assert track.ended


@settings(max_examples=25, deadline=None)
@given(after=st.integers(0, 400), rest=st.integers(0, 400))
def test_a_paused_motion_rests_on_its_path_and_arrives_all_the_same(after, rest):
    """Paused anywhere and for any time: no jump of position or velocity, and the last knot is reached."""
    path = knots()
    track = Track(path, START)
    speeds = []
    for k in range(after + rest + 1000):
        if k == after:
            track.pause()
        if k == after + rest:
            track.resume()
        track.advance(DT)
        speeds.append(track.v[0])
        if k > after and track.ended:
            break
        if after + round(0.3 / DT) <= k < after + rest and not track.ended:
            assert speeds[-1] == 0.0, "0.3 s after the pause it stands still"
    assert np.abs(np.diff(speeds)).max() < 0.02
    np.testing.assert_allclose(track.q, path[-1])


def test_braking_takes_the_way_it_was_meant_to():
    """At 0.35 m/s a hand comes to rest over 5 cm: at 1 rad/s a joint over 0.15 rad, in 0.3 s."""
    path = START + np.arange(0.0, 2.0, KNOT_S)[:, None]
    track = Track(path, START)
    for _ in range(250):
        track.advance(DT)
    at = track.q[0]
    track.brake()
    q, _ = walk(track)
    assert track.q[0] - at == pytest.approx(0.15, abs=0.004)
    assert (len(q) - 1) * DT == pytest.approx(0.3, abs=0.005)


def test_what_was_braked_is_not_resumed():
    """A cancel is for good."""
    track = Track(knots(), START)
    for _ in range(100):
        track.advance(DT)
    track.brake()
    track.resume()
    walk(track)
    assert track.q[0] < knots()[-1, 0] - 0.1


def test_a_start_far_away_is_refused_with_the_joint():
    """The loop does not jump to where a motion would like to begin."""
    with pytest.raises(MotionError, match="torso_0_joint"):
        Track(knots(), START + np.eye(15)[0])


def test_a_single_knot_is_a_motion_that_has_ended():
    """Standing still takes no time."""
    track = Track(START[None], START)
    track.advance(DT)
    assert track.ended
    np.testing.assert_array_equal(track.q, START)
