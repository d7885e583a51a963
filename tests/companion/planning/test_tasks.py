"""Other beginnings of the same task, and the other tasks."""

import math

import numpy as np
import pytest

from companion.languages import hfsm, rc, wm
from companion.languages.facts import Fact, Kind, fact
from companion.languages.values import Pose, Side
from companion.planning.registry import tasks
from companion.tasks.pour.done import PourKind
from companion.tasks.put_down.command import PutDown
from services.knowledge.geometry import place as placed
from services.knowledge.observe import observed
from services.knowledge.scene import Scene
from velma import names
from velma.kinematics.frames import tilt, transform
from velma.kinematics.robot import Robot

LIES = (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0)
TURNED = (0.0, 1.0, 0.0, 0.0)  # upside down


def told(scene: Scene, *observations: wm.AnyObservation) -> Scene:
    """The scene with these observations, newer than all before."""
    newest, _ = max(scene.versions.values())
    for count, observation in enumerate(observations):
        scene = observed(scene, observation, (newest + 1, count), 3.0)
    return scene


def ends(plan: hfsm.HierarchicalPlan) -> hfsm.Outcome:
    """Return the end of a plan if all its acts succeed."""
    last = plan.root.states[-1]
    return last.outcome if isinstance(last, hfsm.EndState) else hfsm.Outcome.SUCCEEDED


# --- pour -------------------------------------------------------------------------------------------------------------


def test_a_held_destination_is_put_down_first(km, named, bowl_out: Scene) -> None:
    """Then looked at; pouring is for the next plan."""
    plan = km(bowl_out).plan("pour", "jar", "bowl")
    assert named(plan)[:3] == ["place bowl_1", "home right", "look at bowl_1"]
    assert ends(plan) is hfsm.Outcome.REPLAN


def test_a_destination_in_the_open_is_left_where_it_is(km, named, beginning: Scene, bowl_placed: Scene) -> None:
    """The source is taken and tilted, with whichever hand can."""
    bowl = bowl_placed.things["bowl_1"]
    scene = told(beginning, wm.SeenObject(bowl.id, bowl.model, bowl.pose, 3.0))
    plan = km(scene).plan("pour", "jar", "bowl")
    assert named(plan) == ["take jar_1", "pour jar_1 bowl_1"]
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
    assert named(plan) == ["look at bowl_1", "localize bowl_1", "replan"]


@pytest.mark.parametrize(
    ("name", "pose", "why"),
    [
        ("jar_1", Pose((0.7, 0.3, 0.1)), fact(Kind.ON_THE_FLOOR, "jar_1")),
        ("bowl_1", Pose((0.58, -0.52, 0.875), LIES), fact(Kind.PERSON_NEEDED, fact(Kind.LIES, "bowl_1"))),
        ("bowl_1", Pose((0.58, -0.52, 0.875), TURNED), fact(Kind.PERSON_NEEDED, fact(Kind.UPSIDE_DOWN, "bowl_1"))),
    ],
)
def test_what_no_grasp_fits_needs_a_person(km, beginning: Scene, name: str, pose: Pose, why: Fact) -> None:
    """On the floor, or a bowl on a table where a standing one would be in reach."""
    model = beginning.things[name].model
    plan = km(told(beginning, wm.SeenObject(name, model, pose, 3.0))).plan("take", name, "")
    assert isinstance(plan, hfsm.NoPlan)
    assert why in plan.why


def test_a_jar_that_lies_is_taken_from_above_and_stood_up(km, named, beginning: Scene) -> None:
    """Across its axis; by the end of the plan it stands upright on a table."""
    lying = Pose((0.58, -0.52, 0.815), LIES)
    known = km(told(beginning, wm.SeenObject("jar_1", "jar", lying, 3.0)))
    plan = known.plan("put_at", "jar_1", "table")
    assert named(plan) == ["take jar_1", "place jar_1", "home right", "look at jar_1"]
    (grasp,) = [leaf.command for step in plan.root.states for leaf in step.states if isinstance(leaf.command, rc.Grasp)]
    hand = transform(lying) * transform(grasp.approach[-1].at)
    assert hand.rotation[2, 2] < -0.8
    assert abs(hand.rotation[:, 2] @ transform(lying).rotation[:, 2]) < 0.01
    assert lying.xyz[2] + 0.02 < hand.translation[2] < lying.xyz[2] + 0.05
    supposed = known.overlays.states[list(known.overlays.states)[-1]].scene.things["jar_1"]
    assert tilt(transform(supposed.pose)) < 0.02


def test_what_a_hand_lost_is_looked_for_until_it_is_seen(km, beginning: Scene) -> None:
    """The plan is to look, and to ask km, which says which hand lost it; seen again, it is taken again."""
    jar = beginning.things["jar_1"]
    scene = told(beginning, wm.LostObject("jar_1", Side.LEFT))
    known = km(scene)
    plan = known.plan("take", "jar", "")
    assert isinstance(plan, hfsm.HierarchicalPlan)
    asked = plan.root.states[1]
    assert isinstance(asked, hfsm.AskState)
    assert known.ask(asked.query) == wm.Unknown((fact(Kind.LOST_SINCE, Side.LEFT, "jar_1"),))
    scene = observed(scene, wm.SeenObject("jar_1", jar.model, jar.pose, 4.0), (9, 10), 4.0)
    assert isinstance(km(scene).plan("take", "jar", ""), hfsm.HierarchicalPlan)


def test_a_jar_out_of_reach_is_told(km, beginning: Scene) -> None:
    """On the far corner of the table no grasp is found with either hand; the reason names jar and hands."""
    scene = told(beginning, wm.SeenObject("jar_1", "jar", Pose((1.30, -0.88, 0.876)), 3.0))
    plan = km(scene).plan("pour", "jar", "bowl")
    assert isinstance(plan, hfsm.NoPlan)
    assert {fact(Kind.NO_GRASP, side, "jar_1") for side in Side} <= set(plan.why)


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


def test_what_was_put_down_unseen_is_taken_from_where_the_hand_left_it(km, named, jar_carried: Scene) -> None:
    """From the table, not out of the cabinet where it was seen last: no part of the plan goes there."""
    put = wm.PlacedObject("jar_1", "jar", JAR_ON_TABLE.pose, 3.0)
    scene = told(jar_carried, wm.SeenHand(Side.LEFT), put)
    plan = km(scene).plan("take", "jar", "")
    assert named(plan)[-1] == "take jar_1"
    move, grasp = plan.root.states[-1].states[:2]
    q, side = np.zeros(15), grasp.command.side
    q[names.COLUMNS[side]] = move.command.path[-1]
    grip = Robot().grip(q, side).translation
    assert math.dist(grip[:2], put.pose.xyz[:2]) < math.dist(grip[:2], jar_carried.things["cabinet_2"].pose.xyz[:2])


def test_what_was_put_down_unseen_is_looked_at_where_the_hand_left_it(km, named, bowl_out: Scene) -> None:
    """The look goes there, and another plan is made when it was seen."""
    put = wm.PlacedObject("bowl_1", "bowl_high", Pose((0.75, -0.75, 0.775)), 3.0)
    plan = km(told(bowl_out, wm.SeenHand(Side.RIGHT), put)).plan("pour", "jar", "bowl")
    assert named(plan)[0] == "look at bowl_1"
    look = plan.root.states[0].states[0].command
    assert isinstance(look, rc.Look)
    assert math.dist(look.at[0][:2], put.pose.xyz[:2]) < 0.05


@pytest.mark.parametrize("side", ["left", ""])
def test_what_is_held_already_needs_nothing(km, named, jar_carried: Scene, side: str) -> None:
    """The plan ends at once, well."""
    plan = km(jar_carried).plan("take", "jar", side)
    assert named(plan) == ["nothing to do"]
    assert ends(plan) is hfsm.Outcome.SUCCEEDED


def test_a_thing_in_the_other_hand_is_put_down_first(km, named, jar_carried: Scene) -> None:
    """Then looked at, and taken by the next plan."""
    plan = km(jar_carried).plan("take", "jar", "right")
    assert named(plan)[:3] == ["place jar_1", "home left", "look at jar_1"]
    assert ends(plan) is hfsm.Outcome.REPLAN


def test_a_full_hand_takes_nothing(km, jar_carried: Scene) -> None:
    """The reason names what it holds."""
    plan = km(jar_carried).plan("take", "bowl", "left")
    assert isinstance(plan, hfsm.NoPlan)
    assert plan.why == (fact(Kind.HOLDS, Side.LEFT, "jar_1"),)


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
    assert named(plan)[:3] == ["place jar_1", "home left", "look at jar_1"]
    assert ends(plan) is hfsm.Outcome.REPLAN


@pytest.mark.parametrize("thing", ["jar", ""])
def test_hands_are_swapped_over_the_table(km, named, jar_carried: Scene, thing: str) -> None:
    """Put down, looked at, taken with the other hand; without a name the only thing that is held."""
    plan = km(jar_carried).plan("swap_hands", thing)
    assert named(plan) == ["place jar_1", "home left", "look at jar_1", "take jar_1", "offer jar_1"]
    assert plan.holds == {Side.RIGHT: "jar_1"}


def test_hands_are_not_swapped_where_nothing_or_too_much_is_held(km, beginning: Scene, bowl_out: Scene) -> None:
    """The reasons say so."""
    reasons = [
        km(scene).plan("swap_hands", thing).why
        for scene, thing in ((beginning, ""), (beginning, "jar"), (bowl_out, ""), (bowl_out, "bowl"))
    ]
    assert reasons == [
        (fact(Kind.HANDS_EMPTY),),
        (fact(Kind.NO_HAND_HOLDS, "jar_1"),),
        (fact(Kind.HANDS_FULL),),
        (fact(Kind.HOLDS, Side.LEFT, "jar_1"),),
    ]


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
    assert named(plan) == ["place jar_1", "home left", "look at jar_1"]


def test_things_are_not_put_onto_each_other(km, named, bowl_out: Scene, bowl_placed: Scene) -> None:
    """If the best place is taken by another bowl, one beside it is found."""
    there = bowl_placed.things["bowl_1"].pose
    scene = told(bowl_out, wm.SeenObject("bowl_2", "bowl_high", there, 3.0))
    plan = km(scene).plan("put_down", "bowl_1")
    assert named(plan) == ["place bowl_1", "home right", "look at bowl_1"]
    release = plan.root.states[0].states[-1].command
    assert isinstance(release, rc.Release)
    assert math.dist(release.place.xyz[:2], there.xyz[:2]) > 0.2


def test_what_no_hand_holds_is_not_put_down(km, beginning: Scene) -> None:
    """The reason says so."""
    plan = km(beginning).plan("put_down", "jar")
    assert isinstance(plan, hfsm.NoPlan)
    assert plan.why == (fact(Kind.NO_HAND_HOLDS, "jar_1"),)


def test_a_later_plan_finds_it_where_a_hand_left_it(km, named, jar_carried: Scene, beginning: Scene) -> None:
    """The act of that hand had failed, but had let go before. Which thing is meant is settled by the first plan."""
    first = km(jar_carried).plan("put_down", "jar")
    later = PutDown("jar").settled(first)
    assert later == hfsm.Task("stand", ("jar_1",))
    assert named(km(jar_carried).plan(later.name, *later.arguments)) == named(first)
    assert named(km(beginning).plan(later.name, *later.arguments)) == ["look at jar_1"]
    assert PutDown("jar", "table").settled(first) is None
    assert PutDown("jar").settled(km(beginning).plan("look_around")) is None


# --- put somewhere, put back, clear the table -------------------------------------------------------------------------

JAR_ON_TABLE = wm.SeenObject("jar_1", "jar", Pose((0.55, -0.5, 0.875)), 3.0)


def released(plan: hfsm.HierarchicalPlan) -> list[rc.Release]:
    """Its commands that put something down."""
    steps = [state for state in plan.root.states if isinstance(state, hfsm.Machine)]
    return [leaf.command for step in steps for leaf in step.states if isinstance(leaf.command, rc.Release)]


@pytest.mark.parametrize("thing", ["jar", "bowl"])
def test_a_thing_is_taken_and_put_on_a_table(km, named, beginning: Scene, thing: str) -> None:
    """Out of the cabinet, by a grasp that leaves a way, and the hand goes home."""
    plan = km(beginning).plan("put_at", thing, "table")
    assert named(plan)[:2] == [f"take {thing}_1", f"place {thing}_1"]
    assert named(plan)[2].startswith("home")
    (release,) = released(plan)
    assert (release.surface, release.way, plan.holds) == ("table_1", (), {})


def test_what_is_held_is_put_where_it_is_wanted(km, named, jar_carried: Scene) -> None:
    """Without another grasp."""
    for place, surface in (("table", "table_1"), ("table_1", "table_1"), ("cabinet", "cabinet_2")):
        plan = km(jar_carried).plan("put_at", "jar", place)
        assert named(plan) == ["place jar_1", "home left", "look at jar_1"]
        assert [release.surface for release in released(plan)] == [surface]


def test_a_thing_goes_into_the_cabinet_by_the_way_it_would_come_out(km, named, beginning: Scene) -> None:
    """From the front, over a shelf that is free, and down; seen there, it is in the cabinet."""
    plan = km(told(beginning, JAR_ON_TABLE)).plan("put_at", "jar", "cabinet")
    assert named(plan)[:2] == ["take jar_1", "place jar_1"]
    (release,) = released(plan)
    before, over = release.way
    assert math.hypot(*before[:2]) > 0.2
    assert over[:2] == (0.0, 0.0)
    after = told(beginning, wm.SeenObject("jar_1", "jar", release.place, 4.0))
    assert after.things["jar_1"].inside == ("cabinet_2",)
    assert math.dist(release.place.xyz, beginning.things["bowl_1"].pose.xyz) > 0.15


@pytest.mark.parametrize(("thing", "place"), [("jar", "cabinet"), ("bowl", "cabinet_2")])
def test_what_is_there_already_stays(km, named, beginning: Scene, thing: str, place: str) -> None:
    """Nothing moves but the head, to see that it is so."""
    assert named(km(beginning).plan("put_at", thing, place)) == [f"look at {thing}_1"]


def test_a_place_that_nobody_has_seen_is_refused(km, beginning: Scene) -> None:
    """With those that there are; a thing that can be taken is not a place."""
    for place in ("shelf", "bowl", "table_7"):
        plan = km(beginning).plan("put_at", "jar", place)
        assert isinstance(plan, hfsm.NoPlan)
        assert plan.why == (fact(Kind.NOT_A_PLACE, place), fact(Kind.SEEN, "cabinet_2", "table_1", "table_2"))


def test_a_full_cabinet_is_refused(km, jar_carried: Scene) -> None:
    """The reason says that no shelf has room for one thing more."""
    cabinet = jar_carried.things["cabinet_2"].pose
    shelves = [placed(cabinet, (0.0, y, z)) for y in (-0.2, -0.1, 0.0, 0.1, 0.2) for z in (-0.145, 0.155)]
    jars = (wm.SeenObject(f"jar_{n}", "jar", Pose(xyz), 3.0) for n, xyz in enumerate(shelves, start=2))
    plan = km(told(jar_carried, *jars)).plan("put_at", "jar_1", "cabinet")
    assert isinstance(plan, hfsm.NoPlan)
    assert plan.why == (fact(Kind.NO_ROOM, "jar_1", "cabinet_2"),)


@pytest.mark.parametrize("where", ["in the hand", "on the table"])
def test_a_thing_is_put_back_where_it_was_taken_from(km, named, beginning: Scene, jar_carried: Scene, where) -> None:
    """Also when it was put down elsewhere between; there it is at home."""
    scene, held = jar_carried, jar_carried.hands[Side.LEFT]
    taken, let_go = wm.SeenHand(Side.LEFT, "jar_1", held.grasp, held.pose), wm.SeenHand(Side.LEFT)
    if where == "on the table":
        scene = told(beginning, taken, let_go, JAR_ON_TABLE)
    plan = km(scene).plan("put_at", "jar", "back")
    assert named(plan)[-3] == "place jar_1"
    (release,) = released(plan)
    assert math.dist(release.place.xyz, beginning.things["jar_1"].pose.xyz) < 0.02
    there = told(scene, taken, let_go, wm.SeenObject("jar_1", "jar", release.place, 5.0))
    away = ["home left"] if where == "in the hand" else []
    assert named(km(there).plan("put_at", "jar", "back")) == [*away, "look at jar_1"]


def test_nothing_is_put_back_where_that_is_not_known_or_taken(km, beginning: Scene, jar_carried: Scene) -> None:
    """The reasons say so."""
    stood = beginning.things["jar_1"].pose
    taken = told(jar_carried, wm.SeenObject("jar_2", "jar", stood, 3.0))
    reasons = [km(scene).plan("put_at", "jar_1", "back").why for scene in (beginning, taken)]
    assert reasons[0][0] == fact(Kind.FIRST_PLACE_UNKNOWN, "jar_1")
    assert reasons[1] == (fact(Kind.NO_ROOM, "jar_1", "cabinet_2"),)


def test_the_table_is_cleared_thing_by_thing(km, named, beginning: Scene, bowl_placed: Scene) -> None:
    """Into the cabinet, each to a place of its own."""
    bowl = bowl_placed.things["bowl_1"]
    scene = told(beginning, JAR_ON_TABLE, wm.SeenObject(bowl.id, bowl.model, Pose((0.75, -0.75, 0.775)), 3.0))
    plan = km(scene).plan("clear_table")
    assert [name for name in named(plan) if name.startswith("place")] == ["place jar_1", "place bowl_1"]
    first, second = released(plan)
    assert first.surface == second.surface == "cabinet_2"
    assert math.dist(first.place.xyz, second.place.xyz) > 0.15


def test_an_empty_table_needs_no_clearing(km, named, beginning: Scene) -> None:
    """It says so."""
    plan = km(beginning).plan("clear_table")
    assert named(plan) == ["nothing to do"]
    assert plan.root.states[-1].why == (fact(Kind.NOTHING_ON_A_TABLE),)
    assert ends(plan) is hfsm.Outcome.SUCCEEDED


def test_what_cannot_be_cleared_away_is_told(km, named, beginning: Scene) -> None:
    """A thing out of reach stays, the other one goes; where all stay, that is not a success."""
    far = wm.SeenObject("jar_2", "jar", Pose((1.30, -0.88, 0.876)), 3.0)
    plan = km(told(beginning, JAR_ON_TABLE, far)).plan("clear_table")
    assert [release.object for release in released(plan)] == ["jar_1"]
    (stays,) = plan.root.states[-1].why
    assert (stays.kind, stays.things, stays.because[0].things) == (Kind.STAYS, ("jar_2",), ("jar_2",))
    assert ends(plan) is hfsm.Outcome.SUCCEEDED
    nothing = km(told(beginning, far)).plan("clear_table")
    assert isinstance(nothing, hfsm.NoPlan)
    assert any("jar_2" in one.things for one in nothing.why)


# --- look, and what is no task ----------------------------------------------------------------------------------------


def test_looking_around_needs_no_fact(km, named) -> None:
    """It can always be done, also by a km that has seen nothing."""
    assert named(km(Scene()).plan("look_around")) == ["look around"]


def test_every_task_that_has_a_name_can_be_asked_for(km, beginning: Scene) -> None:
    """With three arguments none is one."""
    for name in tasks():
        plan = km(beginning).plan(name, "jar", "bowl", "table")
        assert isinstance(plan, hfsm.NoPlan)
        assert plan.why == (fact(Kind.NOT_A_TASK, name),)


@pytest.mark.parametrize("task", [("dance",), ("pour", "jar"), ("take", "jar"), ("localize", "jar")])
def test_what_is_no_task_is_refused(km, beginning: Scene, task: tuple[str, ...]) -> None:
    """Unknown names and wrong numbers of things."""
    plan = km(beginning).plan(*task)
    assert isinstance(plan, hfsm.NoPlan)
    assert plan.why == (fact(Kind.NOT_A_TASK, task[0]),)


def test_nothing_is_poured_into_itself(km, beginning: Scene) -> None:
    """Pouring a thing into itself is refused under any word for it."""
    plan = km(beginning).plan("pour", "jar", "jar_1")
    assert isinstance(plan, hfsm.NoPlan)
    assert plan.why == (fact(PourKind.INTO_ITSELF, "jar_1"),)
