"""A motion under way, by hand: when it has ended, by which rule, and how its report says so."""

import itertools

import numpy as np
import pytest

from companion.languages.facts import Kind, fact
from companion.skills.loop_messages import Close, HandReport, Phase, Until, motion
from services.executor.loop.act import RunningMotion
from velma.names import START

WHY = (fact(Kind.CANCELLED),)
PATH = np.linspace(START, START + 0.1, 101)  # one second
NOTHING = np.zeros(12)
RIGHT, LEFT = HandReport(locked=True), HandReport(touched=(True, False, False))
GRIP = {"until": "touch", "left": Close(squeeze=0.02)}


def act(path=PATH, began_s=0.0, **options):
    return RunningMotion(motion("m", path, **options), START, began_s)


def error(right=(0.0, 0.0, 0.0), left=(0.0, 0.0, 0.0)):
    """A task error (12,) whose rotations, which are not distances, are large."""
    return np.array([*right, 9.0, 9.0, 9.0, *left, 9.0, 9.0, 9.0])


def judged(act, now_s=0.0, error=NOTHING, hands_done=True, head_done=True):
    return act.judge(now_s, error, hands_done=hands_done, head_done=head_done)


def arrived(act):
    """The same motion at its last knot."""
    act.track.advance(10.0)
    return act


def report(act, now_s=0.0):
    return act.report(Phase.RUNNING, WHY, now_s, RIGHT, LEFT)


def test_a_report_has_the_facts_the_hands_and_the_time_since_the_start():
    """Nothing has ended it yet, and no hand was beside its path."""
    told = report(act(began_s=3.0), now_s=4.5)
    assert (told.key, told.phase, told.why, told.ended_by) == ("m", Phase.RUNNING, WHY, None)
    assert (told.right, told.left) == (RIGHT, LEFT)
    assert told.time_s == 1.5
    assert told.largest_error_m == (0.0, 0.0)


def test_the_largest_distance_of_each_hand_is_kept():
    """The length of its own three coordinates, right before left, however small it is later."""
    one = act()
    first, then = ((0.0, 0.03, 0.04), (0.0, 0.0, 0.01)), ((0.0, 0.0, 0.01), (0.012, 0.0, 0.016))
    for hands in (first, then, ((0, 0, 0), (0, 0, 0))):
        assert judged(one, error=error(*hands)) is None
    assert report(one).largest_error_m == pytest.approx((0.05, 0.02))


def test_a_hand_beside_its_path_ends_the_motion_in_any_direction():
    """By name and distance; at the tolerance itself it goes on. The body stays where it is then."""
    for side, axis in itertools.product(("right", "left"), range(3)):
        at, beyond = (tuple(np.eye(3)[axis] * reach) for reach in (-0.25, -0.251))
        one = act(tolerance_m=0.25)
        assert judged(one, error=error(**{side: at})) is None
        assert one.track is not None
        why = (fact(Kind.BESIDE_ITS_PATH, side, 0.251),)
        assert judged(one, error=error(**{side: beyond})) == (Phase.BLOCKED, why)
        assert one.track is None


def test_a_motion_is_done_when_its_path_hands_and_head_are():
    """In the cycle after its last knot, and not before all three."""
    one = act()
    assert judged(one) is None
    assert report(one).ended_by is None
    arrived(one)
    assert judged(one, 1.0) is None
    assert report(one).ended_by is Until.END
    assert judged(one, 1.002, hands_done=False) is None
    assert judged(one, 1.004, head_done=False) is None
    assert judged(one, 1.006) == (Phase.DONE, ())


def test_settling_lasts_as_long_as_asked_from_the_last_thing_done():
    """Half a second in a row, less what summed cycles are rounded: a head that moves once more
    begins it again.
    """
    one = arrived(act(settle_s=0.5))
    judged(one, 10.0)
    assert judged(one, 10.25) is None
    assert judged(one, 10.5, head_done=False) is None
    assert judged(one, 10.75) is None
    assert judged(one, 11.248) is None
    assert judged(one, 11.25 - 1e-12) == (Phase.DONE, ())


@pytest.mark.parametrize("side", ["right", "left"])
def test_contact_is_what_holds_a_hand_up_further_than_at_the_start(side):
    """By its own z only, below and not above, and beyond the distance asked for, not at it."""
    one = act(until="contact", contact_side=side, contact_m=0.0625, tolerance_m=0.5)
    other = "left" if side == "right" else "right"
    for own, foreign in ((-0.125, 0.0), (0.0, -0.25), (-0.1875, 0.0), (0.25, 0.0)):
        # Its load is not known exactly: 0.125 m below is where it hangs without any contact.
        off = error(**{side: (0.1, -0.1, own), other: (-0.1, 0.1, foreign)})
        assert judged(one, error=off) is None
        assert report(one).ended_by is None
    assert one.track is not None
    assert judged(one, error=error(**{side: (0.0, 0.0, -0.19)})) is None
    assert report(one).ended_by is Until.CONTACT
    assert one.track is None, "the body stays where it is"
    assert judged(one, 1.0) == (Phase.DONE, ())


def test_without_contact_the_last_knot_ends_the_motion():
    """And a motion that asks for no contact is not ended by one."""
    one = arrived(act(until="contact"))
    judged(one)
    assert report(one).ended_by is Until.END
    other = act(tolerance_m=0.5)
    for below in (0.0, -0.25):
        judged(other, error=error(right=(0.0, 0.0, below)))
    assert report(other).ended_by is None
    assert other.track is not None


def test_a_touch_ends_a_path_when_the_hands_are_closed_and_the_body_rests():
    """The path goes on while they close; then it brakes within 0.3 s."""
    one = act(**GRIP)
    for _ in range(50):
        one.track.advance(0.002)
        assert judged(one, hands_done=False) is None
    moving = one.track.v.copy()
    assert (moving > 0.09).all(), "no braking before the touch"
    cycles = 0
    while report(one).ended_by is None:
        one.track.advance(0.002)
        assert judged(one) is None
        cycles += 1
    assert report(one).ended_by is Until.TOUCH
    assert cycles * 0.002 == pytest.approx(0.3, abs=0.006)
    np.testing.assert_array_equal(one.track.v, 0.0)
    last = arrived(act(**GRIP))  # waits at its last knot while a hand is still closing
    assert judged(last, hands_done=False) is None
    assert report(last).ended_by is None
    judged(last)
    assert report(last).ended_by is Until.TOUCH


def test_a_cancelled_motion_ends_at_rest_whatever_hands_and_head_do():
    """While it brakes it has no end."""
    one = act()
    one.track.advance(0.1)
    one.cancel()
    assert one.cancelled
    assert judged(one, hands_done=False, head_done=False) is None
    for _ in range(160):
        one.track.advance(0.002)
    assert judged(one, hands_done=False, head_done=False) == (Phase.CANCELLED, WHY)


def test_behind_a_contact_there_is_nothing_to_brake_or_pause():
    """The body rests already: a pause changes nothing and a cancel ends the motion at once."""
    one = act(until="contact", contact_m=0.01, settle_s=5.0)
    judged(one)
    judged(one, error=error(right=(0.0, 0.0, -0.02)))
    one.pause(True)
    one.pause(False)
    one.cancel()
    assert judged(one) == (Phase.CANCELLED, WHY)


def test_only_a_pull_lets_a_hand_be_beside_its_set_point():
    """A motion that ends at its last knot has to be there."""
    for pulled in (False, True):
        one = arrived(act(until="pull"))
        for now_s in (0.0, 1.0):
            verdict = one.judge(now_s, NOTHING, hands_done=True, head_done=True, pulled=pulled)
        assert verdict == (Phase.DONE, ())
        assert one.given_way is pulled


def test_what_is_late_has_three_seconds_since_it_was_missed_first():
    """Then the body stays where it is, and the reason is the newest."""
    one = arrived(act())
    for now_s in (10.0, 11.0, 12.998):
        assert one.wait(now_s, ()) is None
        assert one.track is not None
    assert one.wait(13.0, WHY) == (Phase.BLOCKED, WHY)
    assert one.track is None
