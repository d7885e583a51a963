"""Other beginnings of the same task, and the other tasks."""

import math

import pytest

from companion.languages import hfsm, rc, wm
from companion.languages.values import Pose, Side
from services.knowledge.observe import observed
from services.knowledge.scene import Scene


def told(scene: Scene, *observations: wm.AnyObservation) -> Scene:
    """The scene with these observations."""
    for count, observation in enumerate(observations):
        scene = observed(scene, observation, (9, count), 3.0)
    return scene


def ends(plan: hfsm.HierarchicalPlan) -> hfsm.Outcome:
    """How a plan ends where all its acts succeed."""
    last = plan.root.states[-1]
    return last.outcome if isinstance(last, hfsm.EndState) else hfsm.Outcome.SUCCEEDED


# --- pour -------------------------------------------------------------------------------------------------------------


def test_a_held_destination_is_put_down_first(km, named, bowl_out: Scene) -> None:
    """Then looked at; pouring is for the next plan."""
    plan = km(bowl_out).plan("pour", "jar", "bowl")
    assert named(plan)[:3] == ["place bowl_1", "right arm home", "look at bowl_1"]
    assert ends(plan) is hfsm.Outcome.REPLAN


def test_a_destination_in_the_open_is_left_where_it_is(km, named, beginning: Scene, bowl_placed: Scene) -> None:
    """The source is taken and tilted, with whichever hand can."""
    bowl = bowl_placed.things["bowl_1"]
    scene = told(beginning, wm.SeenObject(bowl.id, bowl.model, bowl.pose, 3.0))
    plan = km(scene).plan("pour", "jar", "bowl")
    assert named(plan) == ["take jar_1", "pour jar_1 into bowl_1"]
    assert ends(plan) is hfsm.Outcome.SUCCEEDED


def test_a_destination_not_seen_since_is_looked_at(km, named, bowl_placed: Scene, bowl_out: Scene) -> None:
    """It was in the hand when it was last seen: its place is not known well enough to pour."""
    bowl, held = bowl_placed.things["bowl_1"], bowl_out.hands[Side.RIGHT]
    scene = told(
        bowl_placed,
        wm.SeenHand(Side.RIGHT, "bowl_1", held.grasp, held.pose),
        wm.SeenObject(bowl.id, bowl.model, bowl.pose, 3.0),
        wm.SeenHand(Side.RIGHT),
    )
    plan = km(scene).plan("pour", "jar", "bowl")
    assert named(plan) == ["look at bowl_1", "is bowl_1 localized?", "replan"]


@pytest.mark.parametrize(
    ("pose", "words"),
    [
        (Pose((0.7, 0.3, 0.1)), "fell on the floor: a person is needed"),
        (Pose((0.58, -0.52, 0.815), (0.7071, 0.7071, 0.0, 0.0)), "lies on its side: a person is needed"),
    ],
)
def test_what_no_grasp_fits_needs_a_person(km, beginning: Scene, pose: Pose, words: str) -> None:
    """On the floor, or lying on a table where a standing one would be in reach."""
    plan = km(told(beginning, wm.SeenObject("jar_1", "jar", pose, 3.0))).plan("take", "jar", "")
    assert isinstance(plan, hfsm.NoPlan)
    assert f"jar_1 {words}" in plan.reason


def test_what_a_hand_lost_needs_a_person_until_it_is_seen(km, beginning: Scene) -> None:
    """The reason says which hand lost it; seen again, it is taken again."""
    jar = beginning.things["jar_1"]
    scene = told(beginning, wm.LostObject("jar_1", Side.LEFT))
    plan = km(scene).plan("take", "jar", "")
    assert isinstance(plan, hfsm.NoPlan)
    assert plan.reason == "the left hand lost jar_1, which has not been seen since: a person is needed"
    scene = observed(scene, wm.SeenObject("jar_1", jar.model, jar.pose, 4.0), (9, 10), 4.0)
    assert isinstance(km(scene).plan("take", "jar", ""), hfsm.HierarchicalPlan)


def test_a_jar_out_of_reach_is_told(km, beginning: Scene) -> None:
    """On the far corner of the table no grasp is found with either hand; the reason names jar and hands."""
    scene = told(beginning, wm.SeenObject("jar_1", "jar", Pose((1.30, -0.88, 0.876)), 3.0))
    plan = km(scene).plan("pour", "jar", "bowl")
    assert isinstance(plan, hfsm.NoPlan)
    assert "no grasp of jar_1 with the left hand can be reached" in plan.reason
    assert "right hand" in plan.reason


# --- take -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("side", ["left", "right", ""])
def test_a_thing_is_taken_with_the_wanted_hand(km, named, beginning: Scene, side: str) -> None:
    """Or with either where none is named."""
    plan = km(beginning).plan("take", "jar", side)
    assert named(plan) == ["take jar_1"]
    (step,) = plan.root.states
    hands = {state.command.side for state in step.states}
    assert len(hands) == 1
    assert side in ("", *hands)


@pytest.mark.parametrize("side", ["left", ""])
def test_what_is_held_already_needs_nothing(km, named, jar_carried: Scene, side: str) -> None:
    """The plan ends at once, well."""
    plan = km(jar_carried).plan("take", "jar", side)
    assert named(plan) == ["nothing to do"]
    assert ends(plan) is hfsm.Outcome.SUCCEEDED


def test_a_thing_in_the_other_hand_is_put_down_first(km, named, jar_carried: Scene) -> None:
    """Then looked at, and taken by the next plan."""
    plan = km(jar_carried).plan("take", "jar", "right")
    assert named(plan)[:3] == ["place jar_1", "left arm home", "look at jar_1"]
    assert ends(plan) is hfsm.Outcome.REPLAN


def test_a_full_hand_takes_nothing(km, jar_carried: Scene) -> None:
    """The reason names what it holds."""
    plan = km(jar_carried).plan("take", "bowl", "left")
    assert isinstance(plan, hfsm.NoPlan)
    assert plan.reason == "the left hand holds jar_1"


# --- bring, swap hands ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("side", ["right", ""])
def test_a_thing_that_is_brought_is_held_over_a_place_where_it_could_be_put_down(km, named, beginning, side) -> None:
    """By the wanted hand, upright, and that hand still holds it when the task is done."""
    plan = km(beginning).plan("bring", "jar", side)
    assert named(plan) == ["take jar_1", "offer jar_1"]
    (hand,) = plan.holds
    assert (plan.holds[hand], side in ("", hand)) == ("jar_1", True)
    assert ends(plan) is hfsm.Outcome.SUCCEEDED


def test_what_is_held_already_is_only_held_out(km, named, jar_carried: Scene) -> None:
    """By the hand that has it; the other one takes it over, if that is wanted."""
    assert named(km(jar_carried).plan("bring", "jar", "")) == ["offer jar_1"]
    plan = km(jar_carried).plan("bring", "jar", "right")
    assert named(plan)[:3] == ["place jar_1", "left arm home", "look at jar_1"]
    assert ends(plan) is hfsm.Outcome.REPLAN


@pytest.mark.parametrize("thing", ["jar", ""])
def test_hands_are_swapped_over_the_table(km, named, jar_carried: Scene, thing: str) -> None:
    """Put down, looked at, taken with the other hand; without a name the only thing that is held."""
    plan = km(jar_carried).plan("swap_hands", thing)
    assert named(plan) == ["place jar_1", "left arm home", "look at jar_1", "take jar_1", "offer jar_1"]
    assert plan.holds == {Side.RIGHT: "jar_1"}


def test_hands_are_not_swapped_where_nothing_or_too_much_is_held(km, beginning: Scene, bowl_out: Scene) -> None:
    """The reasons say so."""
    reasons = [
        km(scene).plan("swap_hands", thing).reason
        for scene, thing in ((beginning, ""), (beginning, "jar"), (bowl_out, ""), (bowl_out, "bowl"))
    ]
    assert reasons == [
        "no hand holds anything", "no hand holds jar_1", "both hands are full: say which thing",
        "the left hand holds jar_1",
    ]  # fmt: skip


# --- schedule parameters ----------------------------------------------------------------------------------------------


def test_a_plan_says_what_it_costs_to_leave_it_and_to_go_on(first, second) -> None:
    """Less and less is left; leaving costs more with two things in the hands than with one; no step is forgotten."""
    for _, plan in (first, second):
        rests = [one.rest for one in plan.schedule]
        assert rests == sorted(rests, reverse=True)
        assert [one.at for one in plan.schedule] == [
            state.name for state in plan.root.states if isinstance(state, hfsm.Machine)
        ]
    costs = {one.at: one for one in first[1].schedule}
    assert costs["take bowl_1"].suspend > costs["carry jar_1"].suspend > 0.0
    assert costs["take bowl_1"].resume > costs["carry jar_1"].resume > 0.0
    assert first[1].schedule[0].rest > first[1].duration
    assert second[1].schedule[0].rest == pytest.approx(second[1].duration)


# --- put down ---------------------------------------------------------------------------------------------------------


def test_a_held_thing_is_put_down(km, named, jar_carried: Scene) -> None:
    """By the hand that holds it, which goes home empty."""
    plan = km(jar_carried).plan("put_down", "jar")
    assert named(plan) == ["place jar_1", "left arm home"]


def test_things_are_not_put_onto_each_other(km, named, bowl_out: Scene, bowl_placed: Scene) -> None:
    """Where the best place is taken by another bowl, one beside it is found."""
    there = bowl_placed.things["bowl_1"].pose
    scene = told(bowl_out, wm.SeenObject("bowl_2", "bowl_high", there, 3.0))
    plan = km(scene).plan("put_down", "bowl_1")
    assert named(plan) == ["place bowl_1", "right arm home"]
    release = plan.root.states[0].states[-1].command
    assert isinstance(release, rc.Release)
    assert math.dist(release.place.xyz[:2], there.xyz[:2]) > 0.2


def test_what_no_hand_holds_is_not_put_down(km, beginning: Scene) -> None:
    """The reason says so."""
    plan = km(beginning).plan("put_down", "jar")
    assert isinstance(plan, hfsm.NoPlan)
    assert plan.reason == "no hand holds jar_1"


# --- look, and what is no task ----------------------------------------------------------------------------------------


def test_looking_around_needs_no_fact(km, named) -> None:
    """It can always be done, also by a km that has seen nothing."""
    assert named(km(Scene()).plan("look_around")) == ["look around"]


def test_every_task_that_has_a_name_can_be_asked_for(km, beginning: Scene) -> None:
    """With three arguments none is one, and the sentence that says so lists each of them."""
    for name in hfsm.TaskName:
        plan = km(beginning).plan(name, "jar", "bowl", "table")
        assert isinstance(plan, hfsm.NoPlan)
        tasks = plan.reason.rpartition("tasks are ")[2].split(", ")
        assert [task.partition(" ")[0] for task in tasks] == list(hfsm.TaskName)


@pytest.mark.parametrize("task", [("dance",), ("pour", "jar"), ("take", "jar"), ("localize", "jar")])
def test_what_is_no_task_is_refused_in_words(km, beginning: Scene, task: tuple[str, ...]) -> None:
    """Unknown names and wrong numbers of things; the reason lists the tasks there are."""
    plan = km(beginning).plan(*task)
    assert isinstance(plan, hfsm.NoPlan)
    assert repr(task[0]) in plan.reason
    assert "put_down (1)" in plan.reason


def test_nothing_is_poured_into_itself(km, beginning: Scene) -> None:
    """Whatever word is used for it."""
    plan = km(beginning).plan("pour", "jar", "jar_1")
    assert isinstance(plan, hfsm.NoPlan)
    assert plan.reason == "jar_1 cannot be poured into itself"
