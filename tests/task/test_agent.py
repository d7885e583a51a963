"""ta's agent with scripted partners: refusals, unknown outcomes, late acts, and who is told what and when."""

from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import pytest
from msgspec.structs import replace
from scripted_partner import Open, Say
from ta_alone import BODY, CANCELLED, HOME, LOOK, OK, STUCK, Scene, plan

from agent_runtime.core.events import Woken
from agent_runtime.testing.memory_bus import Point
from companion.design import AgentName
from companion.languages import hfsm, rc, rs, sw, wm
from companion.languages.evidence import Claim, Evidence, Sense
from companion.languages.facts import Fact, Facts, Kind, fact
from companion.languages.values import Pose, Side
from companion.tasks.hand_over.done import HandOver, HandOverClaim, HandOverKind
from companion.tasks.pour.done import Pour, PourClaim, PourKind
from fipa_codec import languages
from fipa_codec.performatives import Performative as P
from services.task import acts, behaviours, outgoing_messages
from services.task.memory import Memory, RunningAct

ARRIVED = (Evidence(PourClaim.ARRIVED, "bowl_1", (Sense.EYES,), 3.0),)
PUT = Evidence(Claim.STANDS, "jar_1")


def test_a_plan_that_leads_nowhere_is_refused() -> None:
    """The log names the state that is not there, and ta stays idle."""
    scene, logged = Scene(), list[str]()
    scene.wires.on_step = lambda agent, effects: logged.extend(
        line.fields["why"] for line in effects.logs if line.event == "wrong plan"
    )
    scene.start(plan(hfsm.ActState("look", LOOK, (hfsm.Arc(OK, "nowhere"),))))
    report = scene.hears("co", 1)
    assert scene.heard["co"][0][1] == "refuse"
    assert report.why == (fact(Kind.WRONG_PLAN),)
    assert ["nowhere" in line for line in logged] == [True]
    scene.start(plan(hfsm.EndState("end", hfsm.Outcome.FAILED, STUCK)))
    assert scene.hears("co", 3).why == STUCK
    assert scene.states()[1:] == ["Running", "Failed"]


def test_states_are_reported_and_confirmed() -> None:
    """Running at each state with its path, and one final report."""
    scene = Scene()
    scene.start(plan(hfsm.ActState("look", LOOK, (hfsm.Arc(OK, "home"),)), hfsm.ActState("home", HOME)))
    assert scene.hears("co", 1).at.id == "look"
    scene.hears("ex", 1)
    scene.ex(P.INFORM, rc.Done("plan/1", BODY))
    assert scene.hears("co", 2).at.id == "home"
    scene.hears("ex", 2)
    scene.ex(P.REFUSE, rc.NotDone("plan/2", "refused", STUCK), number=1)
    scene.wires.run(lambda: scene.wires.nodes["ta"].state.state == "closing")
    assert len(scene.heard["co"]) == 2, "the final report waits for km"
    scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
    scene.wires.run_for(1.0)
    report = scene.hears("co", 3)
    assert (report.state, report.why) == (sw.WorkerState.FAILED, STUCK)


def test_an_unknown_outcome() -> None:
    """The world is looked at without moving an arm, then Replan is reported; the act is not repeated."""
    scene, restarted = Scene(), (fact(Kind.ENDED, AgentName.EX),)
    scene.start(plan(hfsm.ActState("home", HOME)))
    scene.hears("ex", 1)
    scene.ex(P.FAILURE, rc.NotDone("plan/2", "unknown", restarted))
    look = scene.hears("ex", 2)
    assert isinstance(look, rc.Look)
    scene.ex(P.FAILURE, rc.NotDone(look.key, "failed", STUCK), number=1)
    report = scene.hears("co", 3)
    assert scene.states() == ["Running", "Error", "Replan"]
    assert report.why == restarted
    assert [type(content) for _, _, content in scene.heard["ex"]] == [rc.Home, rc.Look]


def test_a_late_act_is_cancelled() -> None:
    """Five times its expected time and a margin after the agree; then Replan, once ex has had its last word."""
    scene = Scene()
    scene.start(plan(hfsm.ActState("home", HOME)))
    scene.hears("ex", 1)
    began = scene.wires.now
    scene.ex(P.AGREE, rc.Accepted("plan/2", 4.0))
    scene.wires.run(lambda: scene.heard["ex"][-1][1] == "cancel")
    assert abs(scene.wires.now - began - (5 * 4.0 + 10.0)) < 0.5, "the ruling: 5 x its expected duration + 10 s"
    stopped = rc.NotDone("plan/2", "cancelled", CANCELLED)
    scene.wires.post("ex", Say(0, P.INFORM, stopped, languages.Kind.CANCEL))
    report = scene.hears("co", 2)
    assert report.state is sw.WorkerState.REPLAN
    assert report.why == (fact(Kind.TOOK_TOO_LONG, AgentName.EX),)


@pytest.mark.parametrize(
    ("kind", "end"),
    [("interrupted", sw.WorkerState.REPLAN), ("busy", sw.WorkerState.REPLAN), ("failed", sw.WorkerState.FAILED)],
)
def test_what_the_machine_ended_is_planned_again(kind: str, end: sw.WorkerState) -> None:
    """An act that the world ended is not: the person is told."""
    scene = Scene()
    scene.start(plan(hfsm.ActState("home", HOME)))
    scene.hears("ex", 1)
    scene.ex(P.FAILURE, rc.NotDone("plan/2", kind, STUCK))
    report = scene.hears("co", 2)
    assert (report.state, report.why) == (end, STUCK)


def test_a_question_without_an_answer() -> None:
    """The plan fails and says who does not answer."""
    scene = Scene()
    scene.start(plan(hfsm.AskState("is it there?", wm.Holds(relation="isOn", subject="jar_1"))))
    report = scene.hears("co", 2)
    assert report.state is sw.WorkerState.FAILED
    assert report.why == (fact(Kind.NOT_ANSWERING, AgentName.KM),)


KNOWN = wm.Holds(relation=wm.Relation.HAS_EXACT_POSE, subject="jar_1")
ON = wm.Holds(relation=wm.Relation.IS_ON, subject="jar_1")


@pytest.mark.parametrize(
    ("query", "answer", "why"),
    [
        (KNOWN, wm.Truth(False), fact(Kind.NOT_LOCALIZED, "jar_1")),
        (ON, wm.Truth(False), fact(Kind.NEW_PLAN_WANTED)),
        (ON, wm.UnknownState("plan"), fact(Kind.NEW_PLAN_WANTED)),
        (ON, wm.Unknown((fact(Kind.NOT_SEEN, "jar_1"),)), fact(Kind.NOT_SEEN, "jar_1")),
    ],
)
def test_an_answer_that_the_plan_does_not_expect(query: wm.AnyQuery, answer: Any, why: Fact) -> None:
    """A new plan is wanted, and why."""
    scene = Scene()
    scene.start(plan(hfsm.AskState("is it there?", query)))
    scene.hears("km", 1)
    scene.wires.post("km", Say(0, P.INFORM_REF if isinstance(answer, wm.Truth) else P.FAILURE, answer))
    report = scene.hears("co", 2)
    assert (report.state, report.why) == (sw.WorkerState.REPLAN, (why,))


@pytest.mark.parametrize("given", [True, False])
def test_what_was_told_of_a_hand_over_is_said_at_the_end_of_the_plan(given: bool) -> None:
    """The arm that goes home behind it does not hide it; a look in between tells nothing."""
    scene, give = Scene(), HandOver("plan/2", Side.LEFT, "jar_1", 1.0, 0.1, 30.0)
    wanted = (LOOK, give, HOME) if given else (LOOK, HOME)
    states = [hfsm.ActState(type(act).__name__, replace(act, key=f"plan/{n}")) for n, act in enumerate(wanted)]
    chained = [replace(one, arcs=(hfsm.Arc(OK, two.name),)) for one, two in pairwise(states)]
    scene.start(plan(*chained, states[-1]))
    left = (Evidence(HandOverClaim.GIVEN, "jar_1", (Sense.WRIST, Sense.EYES), 1.0),)
    for number, act in enumerate(wanted):
        scene.hears("ex", number + 1)
        scene.ex(P.INFORM, rc.Done(f"plan/{number}", BODY, evidence=left if act is give else ()), number)
    report = scene.hears("co", len(wanted) + 1)
    told = [HandOverKind.HANDED_OVER, HandOverKind.FELT_LEAVING, HandOverKind.SEEN_LEAVING] if given else []
    assert report.state is sw.WorkerState.SUCCEEDED
    assert [one.kind for one in report.why if isinstance(one.kind, HandOverKind)] == told
    assert Kind.SEEN not in {one.kind for one in report.why}


@pytest.mark.parametrize("things", [("jar_1", "table_1"), ()])
def test_a_look_tells_what_was_seen(things: tuple[str, ...]) -> None:
    """The final report of a look names the things, in their order."""
    scene = Scene()
    scene.start(plan(hfsm.ActState("look", LOOK)))
    scene.hears("ex", 1)
    scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
    seen = tuple(rs.Seen(one, one[:-2], Pose((1.0, 0.0, 0.0)), 3.0) for one in reversed(things))
    scene.ex(P.INFORM, rc.Done("plan/1", BODY, seen))
    report = scene.hears("co", 2)
    assert report.state is sw.WorkerState.SUCCEEDED
    assert report.why == ((fact(Kind.SEEN, *things) if things else fact(Kind.SEEN_NOTHING)),)


def test_a_look_that_finds_another_world_wants_a_new_plan() -> None:
    """With its reason."""
    scene, moved = Scene(), (fact(Kind.MOVED, "jar_1", 0.1),)
    scene.start(plan(hfsm.ActState("look", LOOK)))
    scene.hears("ex", 1)
    scene.ex(P.FAILURE, rc.NotDone("plan/1", "replan", moved))
    report = scene.hears("co", 2)
    assert (report.state, report.why) == (sw.WorkerState.REPLAN, moved)


def test_a_new_world_is_told_before_anything_is_seen_in_it() -> None:
    """ex knows nothing of it; km is told to forget, ta looks around, and co is asked for a new plan."""
    scene = Scene()
    scene.start(plan(hfsm.ActState("home", HOME)))
    scene.hears("ex", 1)
    scene.ex(P.REFUSE, rc.NotDone("plan/1", rc.NotDoneKind.NEW_WORLD, (fact(Kind.NEW_WORLD),)))
    look = scene.hears("ex", 2)
    assert isinstance(look, rc.Look)
    scene.ex(P.INFORM, rc.Done(look.key, BODY), number=1)
    scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
    assert scene.hears("co", 3).state is sw.WorkerState.REPLAN
    told = [content for _, _, content in scene.heard["km"] if content is not None]
    assert told[0] == wm.WorldLost((fact(Kind.NEW_WORLD),))
    assert isinstance(told[-1], wm.SeenBody)


@pytest.mark.parametrize(
    "kind", [rc.NotDoneKind.LOST, rc.NotDoneKind.EMPTY, rc.NotDoneKind.MISSING, rc.NotDoneKind.BLOCKED]
)
def test_a_loss_is_said_at_once_and_looked_after(kind: str) -> None:
    """co hears why before the look begins, km that nobody knows where the thing is; then a new plan is wanted."""
    scene, lost = Scene(), (fact(Kind.LOST, Side.LEFT, "jar_1"),)
    scene.start(plan(hfsm.ActState("home", HOME)))
    scene.hears("ex", 1)
    scene.ex(P.FAILURE, rc.NotDone("plan/1", kind, lost, BODY, lost={Side.LEFT: "jar_1"}))
    assert (report := scene.hears("co", 2)).state is sw.WorkerState.ERROR
    assert report.why == lost
    look = scene.hears("ex", 2)
    assert isinstance(look, rc.Look)
    scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
    scene.ex(P.INFORM, rc.Done(look.key, BODY), number=1)
    assert scene.hears("co", 3).state is sw.WorkerState.REPLAN
    told = [content for _, _, content in scene.heard["km"] if content is not None]
    assert wm.LostObject("jar_1", Side.LEFT) in told


def test_a_look_afterwards_that_does_not_see_says_so() -> None:
    """With why there was a look at all."""
    scene, touched = Scene(), fact(Kind.TOUCHED, Side.LEFT, "jar_1", 0)
    scene.start(plan(hfsm.ActState("home", HOME)))
    scene.hears("ex", 1)
    scene.ex(P.FAILURE, rc.NotDone("plan/1", rc.NotDoneKind.EMPTY, (touched,), BODY))
    look = scene.hears("ex", 2)
    scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
    dark = rc.NotDone(look.key, rc.NotDoneKind.FAILED, STUCK, BODY, ill=(rc.Ill(rc.Sensor.CAMERA, rc.Fault.DARK),))
    scene.ex(P.FAILURE, dark, number=1)
    assert scene.hears("co", 3).why == (touched, fact(Kind.ILL, rc.Sensor.CAMERA, rc.Fault.DARK, 0.0))


def test_what_is_missing_is_said_at_once_and_looked_for() -> None:
    """A look that was done, and showed that the bowl is not there: km hears so, the robot looks around, plans again."""
    scene, at = Scene(), Pose((1.0, 0.0, 0.0))
    scene.start(plan(hfsm.ActState("look", rc.Look("plan/1", ((0.6, -0.5, 0.8),)))))
    scene.hears("ex", 1)
    scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
    table = rs.Seen("table_1", "table", at, 3.0)
    scene.ex(P.INFORM, rc.Done("plan/1", BODY, (table,), missing=("bowl_1",)))
    assert (report := scene.hears("co", 2)).state is sw.WorkerState.ERROR
    assert report.why == (fact(Kind.NOT_WHERE_IT_WAS, "bowl_1"),)
    look = scene.hears("ex", 2)
    assert isinstance(look, rc.Look)
    scene.ex(P.INFORM, rc.Done(look.key, BODY), number=1)
    assert scene.hears("co", 3).state is sw.WorkerState.REPLAN
    told = [content for _, _, content in scene.heard["km"] if content is not None]
    assert wm.MissingObject("bowl_1") in told
    assert wm.SeenObject("table_1", "table", at, 3.0) in told


def test_a_plan_that_fails_says_what_nobody_has_checked() -> None:
    """The thing was put down, and the camera shows nothing: whether it stands is not known. A new plan is to see it."""
    for kind, doubts in ((rc.NotDoneKind.FAILED, (fact(Kind.NOT_CHECKED, Claim.STANDS, "jar_1"),)), ("replan", ())):
        scene = Scene()
        look = hfsm.ActState("look", rc.Look("plan/2", ((0.6, -0.5, 0.8),)))
        arcs = (hfsm.Arc(hfsm.Outcome.SUCCEEDED, "look"),)
        scene.start(plan(hfsm.ActState("home", HOME, arcs), look))
        scene.hears("ex", 1)
        scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
        scene.ex(P.INFORM, rc.Done("plan/1", BODY, evidence=(Evidence(Claim.STANDS, "jar_1"),)))
        scene.hears("ex", 2)
        scene.ex(P.FAILURE, rc.NotDone("plan/2", kind, (fact(Kind.NOTHING_IS_SEEN),), BODY), number=1)
        assert scene.hears("co", 3).why == (fact(Kind.NOTHING_IS_SEEN), *doubts)


def test_what_was_put_down_and_not_seen_is_told_so() -> None:
    """km hears where the hand let go of it, and of no sight."""
    scene, at = Scene(), Pose((0.6, -0.5, 0.875))
    scene.start(plan(hfsm.ActState("home", HOME)))
    scene.hears("ex", 1)
    scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
    scene.ex(P.INFORM, rc.Done("plan/1", BODY, placed=(rs.Seen("jar_1", "jar", at, 3.0),)))
    assert scene.hears("co", 2).state is sw.WorkerState.SUCCEEDED
    told = [content for _, _, content in scene.heard["km"] if isinstance(content, wm.SeenObject | wm.PlacedObject)]
    assert told == [wm.PlacedObject("jar_1", "jar", at, 3.0)]


@pytest.mark.parametrize("looked", [True, False])
def test_what_nobody_saw_standing_is_told_so_until_it_is_seen(looked: bool) -> None:
    """By the plan that put it down, and as evidence by the next one: a look at it tells that it stands."""
    scene, at = Scene(), Pose((0.6, -0.5, 0.875))
    scene.start(plan(hfsm.ActState("home", HOME)))
    scene.hears("ex", 1)
    scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
    scene.ex(P.INFORM, rc.Done(HOME.key, BODY, evidence=(PUT,)))
    report = scene.hears("co", 2)
    assert (report.state, report.evidence) == (sw.WorkerState.SUCCEEDED, (PUT,))
    assert report.why == (fact(Kind.NOT_CHECKED, Claim.STANDS, "jar_1"),)
    scene.start(plan(hfsm.ActState("look", LOOK)))
    scene.hears("ex", 2)
    seen = (rs.Seen("jar_1", "jar", at, 5.0),) if looked else ()
    scene.ex(P.INFORM, rc.Done(LOOK.key, BODY, seen), number=1)
    by = Evidence(Claim.STANDS, "jar_1", (Sense.EYES,), 5.0)
    assert scene.hears("co", 4).evidence == ((by,) if looked else (PUT,))


def test_what_a_wrist_does_not_feel_is_not_checked_to_be_in_the_hand() -> None:
    """Fingers told so when they closed on it, then the wrist told otherwise. Nothing told which of them is right."""
    scene, at = Scene(), Pose((0.0, 0.0, 0.12))
    held = {Side.LEFT: ("jar_1", "19", at)}
    move = hfsm.Arc(hfsm.Outcome.SUCCEEDED, "home")
    scene.start(plan(hfsm.ActState("look", LOOK, (move,)), hfsm.ActState("home", HOME)))
    scene.hears("ex", 1)
    scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
    by = Evidence(Claim.HELD, "jar_1", (Sense.FINGERS,), 3.0)
    scene.ex(P.INFORM, rc.Done(LOOK.key, BODY, held=held, evidence=(by,)))
    scene.hears("ex", 2)
    doubted = (fact(Kind.WRIST_DOUBTED, Side.LEFT, "jar_1"),)
    scene.ex(P.FAILURE, rc.NotDone(HOME.key, rc.NotDoneKind.REPLAN, doubted, BODY, held=held), number=1)
    assert scene.hears("co", 3).evidence == (Evidence(Claim.HELD, "jar_1"),)


ILL = (rc.Ill(rc.Sensor.LEFT_WRIST, rc.Fault.ZERO),)
FEELS_NOTHING = fact(Kind.ILL, rc.Sensor.LEFT_WRIST, rc.Fault.ZERO, 0.0)


@pytest.mark.parametrize("sense", rc.Sensor)
@pytest.mark.parametrize("fault", rc.Fault)
def test_each_fault_of_each_sense_is_told(sense: rc.Sensor, fault: rc.Fault) -> None:
    """Of which some never come together; with the number of an offset."""
    told = outgoing_messages.ill(rc.Done("act", BODY, ill=(rc.Ill(sense, fault, 0.05),)))  # type: ignore[arg-type]
    assert told == (fact(Kind.ILL, sense, fault, 0.05),)


def test_a_wrist_that_does_not_feel_is_told() -> None:
    """With what the task came to, well or not."""
    for outcome, why in ((rc.Done("plan/1", BODY, ill=ILL), ()), (lost(), STUCK)):
        scene = Scene()
        scene.start(plan(hfsm.ActState("home", replace(HOME, key="plan/1"))))
        scene.hears("ex", 1)
        scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
        scene.ex(P.INFORM if isinstance(outcome, rc.Done) else P.FAILURE, outcome)
        assert scene.hears("co", 2).why == (*why, FEELS_NOTHING)


def lost() -> rc.NotDone:
    """A failure with a wrist that does not feel."""
    return rc.NotDone("plan/1", rc.NotDoneKind.FAILED, STUCK, ill=ILL)


def test_what_stays_in_the_jar_is_told() -> None:
    """Beside what left it; a few grams are not, since the hand does not tell them from nothing."""
    told = []
    for after in (0.21, 0.23):
        scene = Scene()
        scene.start(
            plan(hfsm.ActState("pour", Pour("plan/1", Side.LEFT, "jar_1", "b", 0.0, 0.0, (0.3, 2.3), 1.0, 0.2)))
        )
        scene.hears("ex", 1)
        scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
        scene.ex(P.INFORM, rc.Done("plan/1", BODY, weighed=(0.26, after), arrived=True, evidence=ARRIVED))
        told.append(scene.hears("co", 2).why)
    felt = (left(0.05),), (left(0.03), fact(PourKind.STILL_IN, "jar_1", 0.03))
    assert told == [(*one, fact(PourKind.ARRIVED_SOME, "b")) for one in felt]


def left(mass: float) -> Fact:
    """So much [kg] was felt to leave the jar."""
    return fact(PourKind.LEFT, "jar_1", mass)


@pytest.mark.parametrize(
    ("arrived", "content", "state", "told"),
    [
        (True, 0.058, sw.WorkerState.SUCCEEDED, (fact(PourKind.ARRIVED, "bowl_1", 0.06),)),
        (
            False,
            0.03,
            sw.WorkerState.FAILED,
            (fact(PourKind.ARRIVED, "bowl_1", 0.03), fact(PourKind.REST_NOT_THERE, "bowl_1")),
        ),
        (None, None, sw.WorkerState.FAILED, (fact(PourKind.NOT_SEEN_IN, "bowl_1"),)),
    ],
)
def test_content_that_is_not_seen_to_arrive_was_not_poured(
    arrived: bool | None, content: float | None, state: sw.WorkerState, told: Facts
) -> None:
    """What left the jar was felt; what is in the bowl is seen, and told to km."""
    scene, at = Scene(), Pose((0.7, -0.3, 0.776))
    pour = Pour("plan/1", Side.LEFT, "jar_1", "bowl_1", 0.0, 0.0, (0.3, 2.3), 1.0, 0.2)
    scene.start(plan(hfsm.ActState("pour", pour)))
    scene.hears("ex", 1)
    scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
    seen, evidence = (rs.Seen("bowl_1", "bowl_high", at, 3.0, content),), ARRIVED if arrived else ()
    scene.ex(P.INFORM, rc.Done("plan/1", BODY, seen, weighed=(0.26, 0.2), arrived=arrived, evidence=evidence))
    report = scene.hears("co", 2)
    assert (report.state, report.why) == (state, (left(0.06), *told))
    news = [one for _, _, one in scene.heard["km"] if isinstance(one, wm.SeenObject)]
    assert news == [wm.SeenObject("bowl_1", "bowl_high", at, 3.0, content)]


@pytest.mark.parametrize("weighed", [None, (0.26, 0.2)])
def test_content_is_told_only_if_it_was_felt(weighed: tuple[float, float] | None) -> None:
    """With how much left the jar; without a weight km hears of no content."""
    scene = Scene()
    pour = Pour("plan/1", Side.LEFT, "jar_1", "bowl_1", 0.0, 0.0, (0.3, 2.3), 1.0, 0.2)
    scene.start(plan(hfsm.ActState("pour", pour)))
    scene.hears("ex", 1)
    scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
    scene.ex(P.INFORM, rc.Done("plan/1", BODY, weighed=weighed, arrived=True, evidence=ARRIVED))
    report = scene.hears("co", 2)
    assert report.state is sw.WorkerState.SUCCEEDED
    felt = [content for _, _, content in scene.heard["km"] if isinstance(content, wm.FeltContent)]
    assert [round(one.left, 3) for one in felt] == ([] if weighed is None else [0.06])
    assert (left(0.06) in report.why) is (weighed is not None)


def test_a_look_around_whose_end_crosses_the_cancel_is_tried_again() -> None:
    """ex answers late, so its end and ta's cancel cross; ta does not wait in `surveying` for ever."""
    scene = Scene()
    scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
    assert isinstance(scene.hears("ex", 1), rc.Look)
    scene.ex(P.AGREE, rc.Accepted(rc.Look("", ()).key, 1.0))
    scene.wires.run(lambda: len(scene.heard["ex"]) > 1, limit_s=acts.AGREE_WITHIN_S + 100.0)
    assert scene.heard["ex"][1][1] == P.CANCEL
    scene.ex(P.FAILURE, rc.NotDone("survey", "failed", STUCK))
    assert isinstance(scene.hears("ex", 3), rc.Look)


def test_what_was_cancelled_is_not_cancelled_again() -> None:
    """ex agreed while the cancel was on its way, and its time passes again: nothing more is said to it."""
    memory = Memory(act=RunningAct("ta-1-1", HOME, agreed=True, stopped=True))
    turn: Any = SimpleNamespace(event=Woken(acts.PATIENCE), say=lambda *_: pytest.fail("a second cancel"))
    assert not acts.overdue(memory, turn)
    assert acts.stop(memory, turn) is memory


def looks_told(scene: Scene) -> list[Facts]:
    """Return the facts that km was told for each look around that showed nothing."""
    return [content.why for _, _, content in scene.heard["km"] if isinstance(content, wm.NothingSeen)]


def test_the_posture_is_told_last() -> None:
    """It ends a look around; nothing else is said of that."""
    scene = Scene()
    scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
    scene.hears("ex", 1)
    scene.ex(P.INFORM, rc.Done("survey-1", BODY))
    scene.wires.run_for(5.0)
    assert looks_told(scene) == []
    assert isinstance(scene.heard["km"][-1][2], wm.SeenBody)


def test_a_look_around_that_fails_is_told_after_the_last_try() -> None:
    """With the reason; tries before it say nothing."""
    scene = Scene()
    scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
    for number in range(behaviours.SURVEYS):
        assert looks_told(scene) == []
        scene.hears("ex", number + 1)
        scene.ex(P.REFUSE, rc.NotDone(f"survey-{number + 1}", "refused", STUCK, BODY), number)
        scene.wires.run_for(0.5)
    assert looks_told(scene) == [STUCK]


def test_a_look_around_that_never_ends_is_told_as_failed() -> None:
    """ex neither agrees nor answers the cancel."""
    scene = Scene()
    scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
    scene.hears("ex", 2)
    scene.wires.run_for(acts.STOPPED_S - 1.0)
    assert looks_told(scene) == []
    scene.wires.run_for(2.0)
    assert looks_told(scene) == [(fact(Kind.NOT_ANSWERING, AgentName.EX),)]


def test_a_robot_that_does_not_answer_a_cancel_is_told_of() -> None:
    """Once, amid a plan; the answer is waited for all the same, and ends the plan."""
    scene = Scene()
    scene.start(plan(hfsm.ActState("home", HOME)))
    scene.hears("ex", 1)
    scene.wires.run(lambda: scene.heard["ex"][-1][1] == "cancel")
    scene.wires.run_for(acts.STOPPED_S - 1.0)
    assert scene.states() == ["Running"]
    scene.wires.run_for(5 * acts.STOPPED_S)
    assert scene.states() == ["Running", "Terminating"]
    report = scene.heard["co"][-1][2]
    assert (report.at.id, report.why) == ("home", (fact(Kind.NOT_ANSWERING, AgentName.EX),))
    scene.wires.post("ex", Say(0, P.INFORM, rc.NotDone(HOME.key, "cancelled", CANCELLED), languages.Kind.CANCEL))
    scene.wires.run_for(1.0)
    assert scene.states()[-1] == "Replan"


def test_an_observer_that_comes_amid_a_plan_does_not_wait_for_a_look() -> None:
    """None is made for it, and it is told so."""
    scene = Scene()
    scene.start(plan(hfsm.ActState("home", HOME)))
    scene.hears("ex", 1)
    scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
    scene.wires.run_for(1.0)
    assert looks_told(scene) == [(fact(Kind.NO_LOOK_IN_A_PLAN),)]


def looks(scene: Scene) -> list[str]:
    """Keys of the looks that ex was asked for."""
    return [content.key for _, _, content in scene.heard["ex"] if isinstance(content, rc.Look)]


def observer(scene: Scene) -> None:
    """km subscribes, once more."""
    scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
    scene.wires.run_for(0.2)


def test_acts_beside_plans_are_counted_over_plans() -> None:
    """No look has the key of an earlier one: ex would not do it again. ta is idle after its plan, and serves on."""
    scene = Scene()
    for number in (1, 2):
        observer(scene)
        assert looks(scene) == [f"survey-{n}" for n in range(1, number + 1)]
        observer(scene)
        assert scene.heard["km"][-1][1] == "agree", "one look around does for both"
        assert len(looks(scene)) == number
        scene.ex(P.INFORM, rc.Done(f"survey-{number}", BODY), 2 * (number - 1))
        scene.wires.run_for(0.5)
        scene.start(plan(hfsm.ActState("home", HOME)))
        scene.wires.run_for(0.5)
        scene.ex(P.INFORM, rc.Done(HOME.key, BODY), 2 * number - 1)
        scene.wires.run_for(1.0)
        assert scene.states() == ["Running", "Succeeded"] * number
        assert scene.wires.nodes["ta"].state.state == "idle"
        assert scene.wires.nodes["ta"].state.wakes == {}


def test_a_report_does_not_wait_for_km_for_ever() -> None:
    """After a while it says what km has not; ta goes on with the next plan."""
    scene = Scene()
    scene.start(plan(hfsm.ActState("home", HOME)))
    scene.hears("ex", 1)
    scene.ex(P.INFORM, rc.Done(HOME.key, BODY))
    scene.wires.run_for(behaviours.BARRIER_S - 1.0)
    assert scene.states() == ["Running"]
    scene.wires.run_for(2.0)
    assert scene.states() == ["Running", "Succeeded"]
    assert scene.heard["co"][-1][2].why == (fact(Kind.NOT_OBSERVED_YET),)
    assert scene.wires.nodes["ta"].state.state == "idle"


def test_a_look_around_is_tried_again_after_a_while_and_not_for_other_news() -> None:
    """A peer that comes up between the tries is not an outcome of a look."""
    scene = Scene()
    observer(scene)
    scene.ex(P.REFUSE, rc.NotDone("survey-1", "refused", STUCK, BODY))
    scene.wires.run_for(behaviours.AGAIN_S / 2)
    assert looks(scene) == ["survey-1"]
    left = scene.wires.memory("ta").survey
    scene.wires.crash("co", Point.BEFORE, restart_s=0.1)
    scene.wires.post("co", Open("ta", "nothing", P.REQUEST))
    scene.wires.run_for(0.5)
    assert scene.wires.memory("ta").survey == left
    scene.wires.run_for(behaviours.AGAIN_S / 2)
    assert looks(scene) == ["survey-1", "survey-2"]


def test_what_the_hands_hold_is_known_from_plan_to_plan() -> None:
    """A later plan that must stop puts it down."""
    scene = Scene()
    held = {Side.LEFT: ("jar_1", "g", Pose((0.0, 0.0, 0.0)))}
    observer(scene)
    scene.ex(P.INFORM, rc.Done("survey-1", BODY))
    scene.wires.run_for(0.5)
    for number in (1, 2):
        scene.start(plan(hfsm.ActState("home", HOME)))
        scene.wires.run_for(0.5)
        hands = scene.wires.memory("ta").hands
        assert bool(hands) == (number > 1)
        scene.ex(P.INFORM, rc.Done(HOME.key, BODY, (), held), number)
        scene.wires.run_for(1.0)
        assert scene.wires.nodes["ta"].state.state == "idle"
        assert scene.wires.memory("ta").hands


@pytest.mark.parametrize("by", [(Sense.FINGERS,), ()])
def test_a_thing_that_no_sense_told_to_be_in_the_hand_was_not_taken(by: tuple[Sense, ...]) -> None:
    """Whatever ex says beside; the reason names the claim."""
    scene = Scene()
    grasp = rc.Grasp("plan/1", Side.LEFT, "jar_1", "247", (), 0.3, 1.0, 0.2)
    scene.start(plan(hfsm.ActState("grasp", grasp)))
    scene.hears("ex", 1)
    scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
    held = {Side.LEFT: ("jar_1", "247", Pose((0.0, 0.0, 0.1)))}
    scene.ex(P.INFORM, rc.Done("plan/1", BODY, held=held, evidence=(Evidence(Claim.HELD, "jar_1", by, 3.0),)))
    report = scene.hears("co", 2)
    assert report.state is (sw.WorkerState.SUCCEEDED if by else sw.WorkerState.FAILED)
    assert report.why == (() if by else (fact(Kind.NOT_CHECKED, Claim.HELD, "jar_1"),))


@pytest.mark.parametrize("by", [(Sense.WRIST, Sense.EYES), ()])
def test_km_hears_which_senses_told_what_a_hand_holds(by: tuple[Sense, ...]) -> None:
    """Also after an act that says nothing of it: the last word counts until the hand is empty."""
    scene, pose = Scene(), Pose((0.0, 0.0, 0.1))
    held = {Side.LEFT: ("jar_1", "247", pose)}
    scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
    scene.start(plan(hfsm.ActState("look", LOOK, (hfsm.Arc(OK, "home"),)), hfsm.ActState("home", HOME)))
    scene.hears("ex", 1)
    scene.ex(P.INFORM, rc.Done(LOOK.key, BODY, held=held, evidence=(Evidence(Claim.HELD, "jar_1", by, 3.0),)))
    scene.hears("ex", 2)
    scene.ex(P.INFORM, rc.Done(HOME.key, BODY, held=held), number=1)
    scene.hears("co", 3)
    told = [one for _, _, one in scene.heard["km"] if isinstance(one, wm.SeenHand) and one.object]
    assert told == [wm.SeenHand(Side.LEFT, "jar_1", "247", pose, by)] * len(told)
    assert told
