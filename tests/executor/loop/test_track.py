"""A track: set-points that never jump."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.skills.loop_messages import KNOT_S
from services.executor.loop.act import BRAKE_S, FARTHEST_START, Track
from velma.errors import MotionError
from velma.names import START

DT = 0.002


def knots(seconds=1.0, reach=0.3):
    """A smooth rise of every joint."""
    u = np.linspace(0, 1, round(seconds / KNOT_S) + 1)
    return START + reach * (u**3 * (10 - 15 * u + 6 * u * u))[:, None]


def advance(track, cycles):
    """Run some cycles; return the first joint's place and speed after each."""
    rows = []
    for _ in range(cycles):
        track.advance(DT)
        rows.append((track.q[0], track.v[0]))
    return np.array(rows).reshape(-1, 2).T


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
    """The body follows without a jump and arrives from any place near the first knot."""
    path = knots(seconds)
    q, v = walk(Track(path, START + offset))
    np.testing.assert_allclose(q[0], START + offset)
    np.testing.assert_allclose(q[-1], path[-1], atol=1e-12)
    np.testing.assert_array_equal(v[-1], 0)
    fastest = np.abs(np.diff(path, axis=0)).max() / KNOT_S + abs(offset) * 1.875 / 0.3
    assert np.abs(np.diff(q, axis=0)).max() <= (fastest + 1e-6) * DT * 1.05
    travelled = (0.5 * (v[1:] + v[:-1])).sum(axis=0) * DT
    np.testing.assert_allclose(
        travelled, q[-1] - q[0], atol=0.02 * abs(path[-1] - q[0]).max() + 2e-3
    )


@settings(max_examples=25, deadline=None)
@given(after=st.integers(0, 400))
def test_braking_comes_to_rest_on_the_path(after):
    """Velocity falls to zero within the braking time, and the position stays one of the path."""
    path = knots()
    track = Track(path, START)
    advance(track, after)
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
    """Paused anywhere and for any time: no jump of position or velocity, and the last knot is
    reached.
    """
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
    advance(track, 250)
    at = track.q[0]
    track.brake()
    q, _ = walk(track)
    assert track.q[0] - at == pytest.approx(0.15, abs=0.004)
    assert (len(q) - 1) * DT == pytest.approx(0.3, abs=0.005)


def test_what_was_braked_is_not_resumed():
    """A cancel is for good."""
    track = Track(knots(), START)
    advance(track, 100)
    track.brake()
    track.resume()
    walk(track)
    assert track.q[0] < knots()[-1, 0] - 0.1


def test_a_single_knot_is_a_motion_that_has_ended():
    """Standing still takes no time."""
    track = Track(START[None], START)
    track.advance(DT)
    assert track.ended
    np.testing.assert_array_equal(track.q, START)


def test_between_knots_the_speed_is_that_of_the_path():
    """A straight line at 1 rad/s: 1 rad/s in every cycle but those of the first and last knot,
    where it is at rest.
    """
    path = START + np.arange(0.0, 0.105, KNOT_S)[:, None]
    q, v = walk(Track(path, START))
    assert len(q) == 51, "0.1 s"
    np.testing.assert_allclose(q, START + np.arange(51)[:, None] * DT, atol=1e-12)
    inner = np.arange(51) * DT
    inner = (inner > KNOT_S - 1e-9) & (inner < 0.1 - KNOT_S + 1e-9)
    np.testing.assert_allclose(v[inner], 1.0, atol=1e-9)
    assert ((v[1:-1] > 0.49) & (v[1:-1] < 1.01)).all()


def test_the_speed_of_a_bend_is_that_of_the_parabola_through_its_knots():
    """q = t^2 has the speed 2 t at each knot, which a central difference gives exactly."""
    at = np.arange(11) * KNOT_S
    path = START + (at**2)[:, None]
    track = Track(path, START)
    for k in range(1, 50):
        track.advance(DT)
        if KNOT_S - 1e-9 < k * DT < 0.09 + 1e-9:
            np.testing.assert_allclose(track.v, 2 * k * DT, atol=1e-9)


@settings(max_examples=25, deadline=None)
@given(offset=st.floats(0.01, 0.049), pause_at=st.integers(0, 200))
def test_the_blend_moves_at_the_speed_it_reports(offset, pause_at):
    """A body 0.05 rad off comes over in 0.3 s, at most at 1.875 times the mean, and waits in a
    pause.
    """
    track = Track(np.tile(START, (101, 1)), START + offset)
    q, v = [track.q[0]], [track.v[0]]
    for k in range(500):
        if k == pause_at:
            track.pause()
        if k == pause_at + 100:
            track.resume()
        track.advance(DT)
        q.append(track.q[0])
        v.append(track.v[0])
    measured = np.diff(q) / DT
    fastest = 1.875 * offset / 0.3
    assert np.abs(measured).max() <= fastest * 1.001
    assert (measured <= 1e-12).all(), "it comes over from above and does not turn"
    between = 0.5 * (np.array(v[1:]) + np.array(v[:-1]))
    np.testing.assert_allclose(between, measured, atol=0.01 * fastest)
    assert q[-1] == START[0]


def test_the_blend_is_smooth_and_takes_three_tenths_of_a_second():
    """The share 10 s^3 - 15 s^4 + 6 s^5 of the way: 0.05792 at a fifth of the time, half at half,
    all at the end.
    """
    track = Track(np.tile(START, (101, 1)), START + 0.04)
    left = advance(track, 151)[0] - START[0]
    assert left[29] == pytest.approx(0.04 * (1 - 0.05792), abs=1e-9)
    assert left[74] == pytest.approx(0.04 * 0.5, abs=1e-9)
    assert left[119] == pytest.approx(0.04 * 0.05792, abs=1e-9)
    assert left[145] > 0.0
    assert left[150] == 0.0
    np.testing.assert_array_equal(track.v, 0.0)


def test_a_fresh_track_is_where_the_robot_was_told_to_be_at_rest():
    """Nothing has moved before the first cycle, and the first cycle is one of full speed."""
    path = START + np.arange(0.0, 1.0, KNOT_S)[:, None]
    track = Track(path, START + 0.01)
    assert not track.ended
    np.testing.assert_array_equal(track.q, START + 0.01)
    np.testing.assert_array_equal(track.v, 0.0)
    track = Track(path, START)
    track.advance(DT)
    np.testing.assert_allclose(track.q, START + DT, atol=1e-12)


def test_a_pause_of_a_motion_that_stands_is_not_its_end():
    """At rest and paused it goes on when it may; at rest and braked it has ended."""
    track = Track(knots(), START)
    track.advance(DT)
    track.pause()
    advance(track, 200)
    assert not track.ended
    track.resume()
    assert not track.ended
    track.brake()
    assert track.ended


def test_a_blend_is_over_when_its_time_is():
    """At 0.3 s and not a cycle later; a cycle before it is under way."""
    for seconds, over in ((0.3 - DT, False), (0.3, True)):
        track = Track(START[None], START + 0.04)
        track.advance(seconds)
        assert track.ended is over
    np.testing.assert_array_equal(track.q, START)


def test_a_motion_at_its_last_knot_has_ended_only_with_its_blend():
    """A path of 0.1 s from 0.04 rad beside it lasts as long as the blend, 0.3 s."""
    q, _ = walk(Track(knots(0.1), START + 0.04))
    assert (len(q) - 1) * DT == pytest.approx(0.3, abs=DT)
    np.testing.assert_allclose(q[-1], knots(0.1)[-1])


@pytest.mark.parametrize("way", [-1.0, 1.0])
def test_a_start_as_far_as_allowed_is_taken(way):
    """0.05 rad, four centimetres at a hand; more is refused, with the joint: the loop does not jump
    to where a motion would like to begin.
    """
    told = np.zeros_like(START)
    at, beyond = (np.full((1, 15), way * far) for far in (0.05, 0.0501))
    assert not Track(at, told).ended
    with pytest.raises(MotionError, match=r"0\.050 rad"):
        Track(beyond, told)
    with pytest.raises(MotionError, match="left_arm_6_joint"):
        Track((told + np.eye(15)[14])[None], told)


def test_going_on_after_a_pause_takes_as_long_as_the_pause():
    """From rest to full speed in 0.3 s, evenly."""
    track = Track(START + np.arange(0.0, 3.0, KNOT_S)[:, None], START)
    advance(track, 100)
    track.pause()
    advance(track, 160)
    assert track.v[0] == 0.0
    track.resume()
    _, speeds = advance(track, 160)
    assert speeds[74] == pytest.approx(0.5, abs=0.01)
    assert speeds[151] == pytest.approx(1.0, abs=1e-9)
    assert max(np.diff(speeds)) <= DT / 0.3 + 1e-9
