"""The robot's belief beside the truth in a report: of a recorded run, and with one thing changed at
a time.
"""

import math
from pathlib import Path

import pytest
from msgspec.structs import replace
from synthetic import with_truth

from companion.design import LANGUAGES, RC, WM
from companion.languages import rc, rs, wm
from companion.languages.facts import Kind, fact
from companion.languages.values import Pose, Side
from companion.tasks.pour.done import Pour
from companion.tasks.pour.verdict import share
from companion.telemetry import TrueState
from companion.tools.report import believed, page, report
from companion.tools.report.believed import Beliefs
from companion.tools.report.plans import Share
from companion.tools.system import SYSTEM
from companion.tools.telemetry import every
from fipa_codec.communicate import encode
from operate.recording.run import Run

POUR = Path(__file__).parents[2] / "histories" / "pour_seed_7"
NEAR_MM = 10.0
"""The receptor errs by up to 4 mm on each axis, and a held thing is where its hand should be, some
mm higher.
"""


@pytest.fixture(scope="module")
def past():
    """The recorded pour; jar in the left hand, bowl on the table at its end."""
    return Run(POUR, SYSTEM).history


def saying(one, content, id, received):
    """The communicate with another content, said under this id at this time."""
    language = WM if isinstance(content, wm.AnyObservation) else RC
    wire = encode(replace(one.communicate, content=language.encode(content), id=id))
    return replace(one, wire=wire, id=id, received=received).read_in(LANGUAGES)


def told(past, *observations):
    """The history in which ta told km this at its end, newer than all before."""
    to_km = (one for one in past.said if one.content and one.receiver == "km")
    last = max(to_km, key=lambda one: one.received)
    at = last.received + 1.0
    more = (saying(last, one, f"test/{n}@9.{n}", at) for n, one in enumerate(observations))
    return replace(past, said=(*past.said, *more))


def found(past, name):
    """The belief about one thing."""
    return next(one for one in believed.beliefs(past) if one.object == name)


def test_belief_is_near_the_truth(past):
    """Of what stands and of what a hand holds, each with the observation that says so."""
    for one in believed.beliefs(past):
        assert one.id
        assert one.t is not None
        if one.true_at is not None:
            assert one.apart_mm == pytest.approx(1000.0 * math.dist(one.at or (), one.true_at))
            assert one.apart_mm < NEAR_MM
    jar, bowl = (found(past, name) for name in ("jar_1", "bowl_1"))
    no_evidence = "in the left hand, not checked"
    assert (jar.how, jar.held) == (no_evidence, "left"), "that run told no evidence"
    assert (bowl.how, bowl.after, bowl.held) == ("seen", "pour", "")
    assert jar.apart_mm is not None


def test_a_thing_that_was_moved_unseen_is_shown_apart(past):
    """The truth has the bowl 0.1 m away: the row says so, in red."""
    at, last = every(past, TrueState)[-1]
    x, y, z = last.at["bowl_1"]
    moved = replace(last, at={**last.at, "bowl_1": (x + 0.1, y, z)}, poses={})
    changed = with_truth(past, (*every(past, TrueState)[:-1], (at, moved)))
    assert found(changed, "bowl_1").apart_mm == pytest.approx(100.0, abs=NEAR_MM)
    text = page.rendered(changed, report.build(changed), "run")
    assert text.count('<td class="n wrong">') == 1


def test_what_was_put_down_unseen_or_lost_is_said_so(past):
    """With its place, or without one."""
    let_go = wm.SeenHand(Side.LEFT)
    placed = wm.PlacedObject("jar_1", "jar", Pose((0.6, -0.5, 0.876)), 9.0)
    put = found(told(past, let_go, placed), "jar_1")
    assert (put.how, put.at, put.held) == ("put down, not seen since", (0.6, -0.5, 0.876), "")
    assert put.id == "test/1@9.1"
    lost = found(told(past, let_go, wm.LostObject("jar_1", Side.LEFT)), "jar_1")
    assert (lost.how, lost.at, lost.apart_mm) == ("lost by the left hand", None, None)
    new = believed.beliefs(told(past, wm.WorldLost((fact(Kind.NEW_WORLD),))))
    assert [one.how for one in new if one.at] == []


def test_what_is_lost_is_in_no_hand(past):
    """Though no hand was told to be empty; before the loss it was."""
    jar = found(told(past, wm.LostObject("jar_1", Side.LEFT)), "jar_1")
    assert (jar.how, jar.held, jar.at) == ("lost by the left hand", "", None)
    held = wm.SeenHand(Side.LEFT, "jar_1", "47", Pose((0.0, 0.0, 0.0)))
    again = told(past, wm.LostObject("jar_1", Side.LEFT), held)
    assert found(again, "jar_1").held == "left"


def test_nothing_older_than_a_lost_world_counts(past):
    """Though it is heard after it."""
    lost = told(past, wm.WorldLost((fact(Kind.NEW_WORLD),)))
    (last,) = lost.said[-1:]
    placed = wm.PlacedObject("jar_1", "jar", Pose((0.6, -0.5, 0.876)), 9.0)
    late = saying(last, placed, "object/jar_1@8.0", last.received)
    beliefs = Beliefs()
    assert beliefs.hear(last)
    assert not beliefs.hear(late)
    assert beliefs.objects == set()


def test_the_poured_share_is_believed_by_weight(past):
    """The recording is of before pours were weighed; with weights, half of the content left the
    jar.
    """
    assert share(past) == Share(None, None, None, 1.0)
    (key,) = {one.content.key for one in past.said if isinstance(one.content, Pour)}
    (done,) = [
        one for one in past.said if isinstance(one.content, rc.Done) and one.content.key == key
    ]
    empty = next(one.content.empty_mass for one in past.said if isinstance(one.content, Pour))
    seen = (rs.Seen("bowl_1", "bowl_high", Pose((0.6, -0.5, 0.775)), 60.0, content=0.028),)
    content = replace(done.content, weighed=(empty + 0.06, empty + 0.03), seen=seen)
    one = saying(done, content, done.id, done.received)
    weighed = replace(past, said=tuple(one if other is done else other for other in past.said))
    half = share(weighed)
    shares = (half.believed, half.left_kg, half.content_kg)
    assert shares == pytest.approx((0.5, 0.03, 0.06))
    text = page.rendered(weighed, report.build(weighed), "run")
    assert half.seen_kg == 0.028
    assert "50\u00a0% by weight (30\u00a0g of 60\u00a0g left the jar)" in text
    assert "about 28\u00a0g seen in the bowl, " in text
    assert "100\u00a0% in truth" in text
