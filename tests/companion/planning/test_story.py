"""The paper's story: jar left, bowl right and down, a look, a new plan, and that one pours."""

import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from planned import Km, acts, steps

from companion.design import HFSM
from companion.languages import hfsm, rc, wm
from companion.languages.facts import Kind, fact
from companion.languages.values import Side
from companion.planning import placing as under_test
from companion.planning.placing import NEAR_M, TOGETHER, Spot
from services.task import plan as plans
from velma import names
from velma.kinematics.frames import tilt, transform
from velma.kinematics.robot import Robot
from velma.kinematics.tasks.carrying import CARRY_TILT

REPLAN = hfsm.Outcome.REPLAN


def put_down(machine):
    """Return the things put down where a plan is cancelled, in order."""
    releases = hfsm.acts(machine) if machine is not None else ()
    return [command.object for command in releases if isinstance(command, rc.Release)]


def test_the_first_plan_takes_both_and_puts_the_bowl_down(first):
    """The jar with the left hand and out of the way, the bowl with the right one; then the bowl is
    to be localized.
    """
    _, plan = first
    assert steps(plan) == [
        "take jar_1", "carry jar_1", "take bowl_1", "place bowl_1", "home right", "look at bowl_1",
        "localize bowl_1", "replan",
    ]  # fmt: skip
    said = [(type(c).__name__, getattr(c, "side", None)) for c in acts(plan)]
    left, right = Side.LEFT, Side.RIGHT
    assert said == [
        ("MoveJoint", left), ("Grasp", left), ("MoveCartesian", left), ("MoveJoint", left),
        ("MoveJoint", right), ("Grasp", right), ("MoveCartesian", right), ("MoveJoint", right),
        ("Release", right),
        ("MoveJoint", right), ("Look", None),
    ]  # fmt: skip
    end = hfsm.EndState("replan", REPLAN, (fact(Kind.LOCALIZED, "bowl_1"),))
    assert plan.root.states[-1] == end


def test_the_second_plan_pours(second):
    """Now that the bowl was seen where it stands, the jar is tilted over it, and that is the
    end.
    """
    _, plan = second
    assert steps(plan) == ["pour jar_1 bowl_1"]
    move, pour = acts(plan)
    assert isinstance(move, rc.MoveJoint)
    assert (pour.side, pour.source, pour.destination) == (Side.LEFT, "jar_1", "bowl_1")
    assert math.degrees(pour.tilts[1]) == pytest.approx(135.0)
    assert put_down(plan.root.safe) == ["jar_1"]


def test_the_bowl_goes_onto_a_table(first):
    """The place is told with what it stands on, clear of the edge, upright."""
    (release,) = acts(first[1], rc.Release)
    assert release.surface == "table_1"
    x, y, z = release.place.xyz
    assert 0.775 < z < 0.79
    assert math.hypot(x - 0.783, y + 0.840) < 0.5
    assert release.place.quat_wxyz[1:3] == pytest.approx((0.0, 0.0), abs=1e-6)
    assert release.retreat


def test_what_is_held_is_put_down_when_cancelled(first):
    """In every step all that a hand may hold by then, the last taken first."""
    machines = [state for state in first[1].root.states if isinstance(state, hfsm.Machine)]
    assert {state.name: put_down(state.safe) for state in machines} == {
        "take jar_1": ["jar_1"],
        "carry jar_1": ["jar_1"],
        "take bowl_1": ["bowl_1", "jar_1"],
        "place bowl_1": ["bowl_1", "jar_1"],
        "home right": ["jar_1"],
        "look at bowl_1": ["jar_1"],
    }


def test_ta_can_run_the_plans(first, second):
    """Every arc leads on, every act has a key of its own that names the request, and the wire keeps
    it all.
    """
    for _, plan in (first, second):
        plans.check(plan.root)
        keys = [command.key for command in acts(plan)]
        assert len(set(keys)) == len(keys)
        assert all(key.startswith(f"{plan.id}/") for key in keys)
        assert HFSM.decode(HFSM.encode(plan)) == plan


def test_motions_begin_where_the_robot_stands(first):
    """The first path begins in the observed posture, and its points are never far apart."""
    _, plan = first
    moves = acts(plan, rc.MoveJoint)
    assert moves[0].path[0] == pytest.approx(names.START[names.COLUMNS["left"]])
    for move in moves:
        for a, b in zip(move.path, move.path[1:], strict=False):
            assert max(abs(x - y) for x, y in zip(a, b, strict=True)) < 0.06
    home = tuple(names.START[names.ARM["right"]])
    assert moves[-1].path[-1][1:] == pytest.approx(home)


def test_what_is_carried_stays_upright(first):
    """All the way from before the cabinet to where the other arm has room."""
    grasp, carry = acts(first[1], rc.Grasp)[0], acts(first[1], rc.MoveJoint)[1]
    q = np.array(names.START)
    inside = transform(grasp.approach[-1].at).inverse()
    for point in carry.path[:: max(1, len(carry.path) // 20)]:
        q[names.COLUMNS["left"]] = point
        assert tilt(Robot().grip(q, "left") * inside) < CARRY_TILT + 0.01


def test_queries_are_counted_as_asked(first, second):
    """The number told with the plan is that of the queries km saw, none of them twice."""
    for km, plan in (first, second):
        assert plan.queries == len(km.asked)
        assert max(Counter(km.asked).values()) == 1


def test_hypothetical_states_bear_the_requests_name(first, second):
    """So that they can be dropped by it; after the first one is made, the observed world is not
    asked any more.
    """
    for km, plan in (first, second):
        made = [query.id for query in km.asked if isinstance(query, wm.HypotheticalState)]
        assert all(one.startswith(f"{plan.id}/") for one in made)
        assert list(km.overlays.states) == made
        observed = [query for query in km.asked if query.state == ""]
        assert [type(query) for query in observed] == [wm.ListObjects, wm.HypotheticalState]
        assert not km.overlays.drop(f"{plan.id}/").states


def test_the_same_seed_gives_the_same_plan(bowl_placed, second):
    """Chance is the request's; another seed moves otherwise."""
    again = Km(bowl_placed).plan("pour", "jar", "bowl", request="p2")
    assert again == second[1]
    other = Km(bowl_placed).plan("pour", "jar", "bowl", request="p2", seed=8)
    assert acts(other) != acts(again)


def test_the_expected_duration_is_plausible(first, second):
    """Below the limit of the main job together, and no less than the slow parts of it."""
    assert 25.0 < first[1].duration < 90.0
    assert 5.0 < second[1].duration < 40.0


# --- Spots to put something down, as they are offered: some at a time, ever farther from those that
# did not do


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
