"""ta's agent with scripted partners: refusals, unknown outcomes, late acts, and who is told what
and when.
"""

from types import SimpleNamespace

import msgspec
import pytest
from msgspec.structs import replace
from scripted_partner import Open, Say
from ta_alone import BODY, HOME, LOOK, OK, STUCK, Scene, plan

from agent_runtime.core.events import Woken
from agent_runtime.testing.memory_bus import Point
from companion.design import AgentName
from companion.languages import hfsm, rc, rs, sw, wm
from companion.languages.evidence import Claim, Evidence, Sense
from companion.languages.facts import Kind, fact
from companion.languages.values import Pose, Side
from companion.tasks.hand_over.done import HandOver, HandOverClaim, HandOverKind
from companion.tasks.pour.done import Pour, PourClaim, PourKind
from fipa_codec.performatives import Performative as P
from services.task import acts, behaviours, outgoing_messages
from services.task.memory import Memory, RunningAct

AT = Pose((0.6, -0.5, 0.875))
ARRIVED = (Evidence(PourClaim.ARRIVED, "bowl_1", (Sense.EYES,), 3.0),)
PUT = Evidence(Claim.STANDS, "jar_1")
HELD = {Side.LEFT: ("jar_1", "19", Pose((0.0, 0.0, 0.12)))}
POUR = Pour("plan/1", Side.LEFT, "jar_1", "bowl_1", 0.0, 0.0, (0.3, 2.3), 1.0, 0.2)
GRASP = rc.Grasp("plan/1", Side.LEFT, "jar_1", "19", (), 0.3, 1.0, 0.2)
ILL = (rc.Ill(rc.Sensor.LEFT_WRIST, rc.Fault.ZERO),)
FEELS_NOTHING = fact(Kind.ILL, rc.Sensor.LEFT_WRIST, rc.Fault.ZERO, 0.0)
SUCCEEDED, FAILED, REPLAN = sw.WorkerState.SUCCEEDED, sw.WorkerState.FAILED, sw.WorkerState.REPLAN


def done(**more):
    """An act that ended well."""
    return rc.Done("plan/1", BODY, **more)


def not_done(kind, *why, **more):
    """An act that did not."""
    return rc.NotDone("plan/1", kind, why or STUCK, BODY, **more)


def seen(name, at=3.0, content=None):
    """Something that stands there."""
    return rs.Seen(name, name[:-2], AT, at, content)


def held(*by):
    """The jar in the hand, as these senses tell."""
    return {"held": HELD, "evidence": (Evidence(Claim.HELD, "jar_1", by, 3.0),)}


def poured(arrived, content, after=0.2):
    """A pour out of 0.26 kg."""
    bowl, evidence = (seen("bowl_1", content=content),), ARRIVED if arrived else ()
    return done(seen=bowl, weighed=(0.26, after), arrived=arrived, evidence=evidence)


def left(mass):
    """So much [kg] was felt to leave the jar."""
    return fact(PourKind.LEFT, "jar_1", mass)


def arrived(mass):
    """So much [kg] was seen to be in the bowl."""
    return fact(PourKind.ARRIVED, "bowl_1", mass)


MOVED, SEEN = fact(Kind.MOVED, "jar_1", 0.1), fact(Kind.SEEN, "jar_1", "table_1")
SOME, REST = (fact(kind, "bowl_1") for kind in (PourKind.ARRIVED_SOME, PourKind.REST_NOT_THERE))
UNCHECKED = {claim: fact(Kind.NOT_CHECKED, claim, "jar_1") for claim in (Claim.STANDS, Claim.HELD)}
STILL_IN, NOT_SEEN_IN = fact(PourKind.STILL_IN, "jar_1", 0.03), fact(PourKind.NOT_SEEN_IN, "bowl_1")
SIGHTS = (seen("table_1"), seen("jar_1"))
ENDS = {
    "the machine ended it": (HOME, not_done("interrupted"), REPLAN, *STUCK),
    "the machine was busy": (HOME, not_done("busy"), REPLAN, *STUCK),
    "the world ended it": (HOME, not_done("failed"), FAILED, *STUCK),
    "another world": (LOOK, not_done("replan", MOVED), REPLAN, MOVED),
    "objects seen, in their order": (LOOK, done(seen=SIGHTS), SUCCEEDED, SEEN),
    "nothing seen": (LOOK, done(), SUCCEEDED, fact(Kind.SEEN_NOTHING)),
    "a wrist that does not feel": (HOME, done(ill=ILL), SUCCEEDED, FEELS_NOTHING),
    "the same, and it failed": (HOME, not_done("failed", ill=ILL), FAILED, *STUCK, FEELS_NOTHING),
    "put down and not seen": (HOME, done(evidence=(PUT,)), SUCCEEDED, UNCHECKED[Claim.STANDS]),
    "taken": (GRASP, done(**held(Sense.FINGERS)), SUCCEEDED),
    "taken, and no sense told": (GRASP, done(**held()), FAILED, UNCHECKED[Claim.HELD]),
    "poured": (POUR, poured(True, 0.058), SUCCEEDED, left(0.06), arrived(0.06)),
    "poured aside": (POUR, poured(False, 0.03), FAILED, left(0.06), arrived(0.03), REST),
    "poured, not seen": (POUR, poured(None, None), FAILED, left(0.06), NOT_SEEN_IN),
    "a few grams stay": (POUR, poured(True, None, 0.21), SUCCEEDED, left(0.05), SOME),
    "some stays": (POUR, poured(True, None, 0.23), SUCCEEDED, left(0.03), STILL_IN, SOME),
    "poured, not felt": (POUR, done(arrived=True, evidence=ARRIVED), SUCCEEDED, SOME),
}


def test_the_end_of_an_act_is_that_of_its_plan():
    """With the reasons; km hears of the content that was felt to leave, and of that seen in the
    bowl.
    """
    wrong = {}
    for name, (command, outcome, state, *why) in ENDS.items():
        scene = Scene(command, observed=True)
        scene.ends(outcome)
        report = scene.hears("co", 2)
        if (report.state, [*report.why]) != (state, why):
            wrong[name] = report
        if command is POUR and isinstance(outcome, rc.Done):
            felt = [round(0.26 - outcome.weighed[1], 3)] if outcome.weighed else []
            left = [round(one.left, 3) for one in scene.news(wm.FeltContent)]
            assert not outcome.arrived or left == felt, name
            sights = [one.content for one in scene.news(wm.SeenObject)]
            assert sights == [one.content for one in outcome.seen], name
    assert not wrong


def test_a_plan_that_leads_nowhere_is_refused():
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


def test_states_are_reported_and_confirmed():
    """Running at each state with its path, and one final report."""
    scene = Scene(LOOK, HOME)
    assert scene.hears("co", 1).at.id == "Look"
    scene.ends(done())
    assert scene.hears("co", 2).at.id == "Home"
    scene.ends(not_done("refused"), 1, P.REFUSE)
    scene.wires.run(lambda: scene.state == "closing")
    assert len(scene.heard["co"]) == 2, "the final report waits for km"
    scene.observe()
    scene.wires.run_for(1.0)
    report = scene.hears("co", 3)
    assert (report.state, report.why) == (FAILED, STUCK)


def test_an_unknown_outcome():
    """The world is looked at without moving an arm, then Replan is reported; the act is not
    repeated.
    """
    scene, restarted = Scene(HOME), (fact(Kind.ENDED, AgentName.EX),)
    scene.ends(rc.NotDone("plan/2", "unknown", restarted))
    look = scene.hears("ex", 2)
    scene.ends(rc.NotDone(look.key, "failed", STUCK), 1)
    report = scene.hears("co", 3)
    assert scene.states() == ["Running", "Error", "Replan"]
    assert report.why == restarted
    assert [type(content) for _, _, content in scene.heard["ex"]] == [rc.Home, rc.Look]


def test_a_late_act_is_cancelled():
    """Five times its expected time and a margin after the agree; then Replan, once ex has had its
    last word.
    """
    scene = Scene(HOME)
    began = scene.wires.now
    scene.ex(P.AGREE, rc.Accepted("plan/2", 4.0))
    scene.wires.run(lambda: scene.heard["ex"][-1][1] == "cancel")
    assert abs(scene.wires.now - began - (5 * 4.0 + 10.0)) < 0.5, (
        "the ruling: 5 x its expected duration + 10 s"
    )
    scene.cancelled("plan/2")
    report = scene.hears("co", 2)
    assert report.state is REPLAN
    assert report.why == (fact(Kind.TOOK_TOO_LONG, AgentName.EX),)


KNOWN = wm.Holds(relation=wm.Relation.HAS_EXACT_POSE, subject="jar_1")
ON = wm.Holds(relation=wm.Relation.IS_ON, subject="jar_1")
NOT_SEEN = fact(Kind.NOT_SEEN, "jar_1")


@pytest.mark.parametrize(
    ("query", "answer", "why"),
    [
        (KNOWN, wm.Truth(False), fact(Kind.NOT_LOCALIZED, "jar_1")),
        (ON, wm.Truth(False), fact(Kind.NEW_PLAN_WANTED)),
        (ON, wm.UnknownState("plan"), fact(Kind.NEW_PLAN_WANTED)),
        (ON, wm.Unknown((NOT_SEEN,)), NOT_SEEN),
        (ON, None, fact(Kind.NOT_ANSWERING, AgentName.KM)),
    ],
)
def test_an_answer_that_the_plan_does_not_expect(query, answer, why):
    """A new plan is wanted, and why; without any answer the plan fails."""
    scene = Scene()
    scene.start(plan(hfsm.AskState("is it there?", query)))
    scene.hears("km", 1)
    if answer is not None:
        act = P.INFORM_REF if isinstance(answer, wm.Truth) else P.FAILURE
        scene.wires.post("km", Say(0, act, answer))
    report = scene.hears("co", 2)
    assert (report.state, report.why) == (REPLAN if answer else FAILED, (why,))


@pytest.mark.parametrize("given", [True, False])
def test_what_was_told_of_a_hand_over_is_said_at_the_end_of_the_plan(given):
    """The arm that goes home behind it does not hide it; a look in between tells nothing."""
    give = HandOver("plan/2", Side.LEFT, "jar_1", 1.0, 0.1, 30.0)
    wanted = (LOOK, give, HOME) if given else (LOOK, HOME)
    scene = Scene(*wanted)
    away = (Evidence(HandOverClaim.GIVEN, "jar_1", (Sense.WRIST, Sense.EYES), 1.0),)
    for number, act in enumerate(wanted):
        scene.ends(rc.Done(act.key, BODY, evidence=away if act is give else ()), number)
    report = scene.hears("co", len(wanted) + 1)
    leaving = [HandOverKind.FELT_LEAVING, HandOverKind.SEEN_LEAVING]
    told = [HandOverKind.HANDED_OVER, *leaving] if given else []
    assert report.state is SUCCEEDED
    assert [one.kind for one in report.why if isinstance(one.kind, HandOverKind)] == told
    assert Kind.SEEN not in {one.kind for one in report.why}


LOST = fact(Kind.LOST, Side.LEFT, "jar_1")
GONE = [
    *(
        (not_done(kind, LOST, lost={Side.LEFT: "jar_1"}), LOST, wm.LostObject("jar_1", Side.LEFT))
        for kind in (
            rc.NotDoneKind.LOST,
            rc.NotDoneKind.EMPTY,
            rc.NotDoneKind.MISSING,
            rc.NotDoneKind.BLOCKED,
        )
    ),
    (not_done(rc.NotDoneKind.NEW_WORLD, new := fact(Kind.NEW_WORLD)), new, wm.WorldLost((new,))),
    (done(missing=("bowl_1",)), fact(Kind.NOT_WHERE_IT_WAS, "bowl_1"), wm.MissingObject("bowl_1")),
]


@pytest.mark.parametrize(("outcome", "why", "news"), GONE)
def test_a_loss_is_said_at_once_and_looked_after(outcome, why, news):
    """co hears why before the look begins, km what is not known any more; then a new plan is
    wanted.
    """
    scene = Scene(HOME, observed=True)
    scene.ends(outcome)
    report = scene.hears("co", 2)
    assert (report.state, report.why) == (sw.WorkerState.ERROR, (why,))
    look = scene.hears("ex", 2)
    assert isinstance(look, rc.Look)
    scene.ends(rc.Done(look.key, BODY), 1)
    assert scene.hears("co", 3).state is REPLAN
    told = [one for one in scene.news() if not isinstance(one, wm.NothingSeen)]
    assert told[0] == news
    assert isinstance(told[-1], wm.SeenBody)


def test_reasons_and_evidence_of_a_report_have_room_together():
    """The more reasons there are, the less evidence is told; a few of it are left here."""
    many = tuple(
        Evidence(Claim.STANDS, f"jar_{number}", (Sense.EYES,), 3.0) for number in range(20)
    )
    scene = Scene(LOOK, HOME, observed=True)
    scene.ends(done(evidence=many))
    scene.ends(not_done("failed", *(fact(Kind.NOT_SEEN, f"bowl_{n}") for n in range(5))), 1)
    report = scene.hears("co", 3)
    sizes = [len(msgspec.msgpack.encode(part)) for part in (report.why, report.evidence)]
    assert len(report.why) == 5
    assert 0 < len(report.evidence) < len(many)
    assert sum(sizes) <= behaviours.REASON_BYTES


def test_in_a_new_world_the_hands_hold_nothing():
    """Whatever they held in the one before."""
    scene = Scene(LOOK, HOME, observed=True)
    scene.ends(done(held=HELD))
    scene.ends(not_done(rc.NotDoneKind.NEW_WORLD), 1)
    scene.hears("ex", 3)
    assert scene.wires.memory("ta").hands == {}


def test_a_look_afterwards_that_does_not_see_says_so():
    """With why there was a look at all."""
    scene, touched = Scene(HOME, observed=True), fact(Kind.TOUCHED, Side.LEFT, "jar_1", 0)
    scene.ends(not_done(rc.NotDoneKind.EMPTY, touched))
    look = scene.hears("ex", 2)
    dark = (rc.Ill(rc.Sensor.CAMERA, rc.Fault.DARK),)
    scene.ends(replace(not_done("failed", ill=dark), key=look.key), 1)
    dark = fact(Kind.ILL, rc.Sensor.CAMERA, rc.Fault.DARK, 0.0)
    assert scene.hears("co", 3).why == (touched, dark)


def test_a_plan_that_fails_says_what_nobody_has_checked():
    """It was put down, and the camera shows nothing: whether it stands is not known. A new plan is
    to see it.
    """
    for kind, doubts in (
        (rc.NotDoneKind.FAILED, (fact(Kind.NOT_CHECKED, Claim.STANDS, "jar_1"),)),
        ("replan", ()),
    ):
        scene = Scene(HOME, LOOK, observed=True)
        scene.ends(done(evidence=(PUT,)))
        scene.ends(not_done(kind, fact(Kind.NOTHING_IS_SEEN)), 1)
        assert scene.hears("co", 3).why == (fact(Kind.NOTHING_IS_SEEN), *doubts)


def test_what_was_put_down_and_not_seen_is_told_so():
    """km hears where the hand let go of it, and of no sight."""
    scene = Scene(HOME, observed=True)
    scene.ends(done(placed=(seen("jar_1"),)))
    assert scene.hears("co", 2).state is SUCCEEDED
    assert scene.news(wm.SeenObject | wm.PlacedObject) == [wm.PlacedObject("jar_1", "jar", AT, 3.0)]


@pytest.mark.parametrize("looked", [True, False])
def test_what_nobody_saw_standing_is_told_so_until_it_is_seen(looked):
    """As evidence by the plan that put it down and by the next one: a look at it tells that it
    stands.
    """
    scene = Scene(HOME, observed=True)
    scene.ends(rc.Done(HOME.key, BODY, evidence=(PUT,)))
    assert scene.hears("co", 2).evidence == (PUT,)
    scene.start(plan(hfsm.ActState("look", LOOK)))
    scene.ends(rc.Done(LOOK.key, BODY, (seen("jar_1", 5.0),) if looked else ()), 1)
    by = Evidence(Claim.STANDS, "jar_1", (Sense.EYES,), 5.0)
    assert scene.hears("co", 4).evidence == ((by,) if looked else (PUT,))


def test_what_a_wrist_does_not_feel_is_not_checked_to_be_in_the_hand():
    """Fingers told so when they closed on it, then the wrist told otherwise. Nothing told which of
    them is right.
    """
    scene = Scene(LOOK, HOME, observed=True)
    scene.ends(done(**held(Sense.FINGERS)))
    scene.ends(not_done("replan", fact(Kind.WRIST_DOUBTED, Side.LEFT, "jar_1"), held=HELD), 1)
    assert scene.hears("co", 3).evidence == (Evidence(Claim.HELD, "jar_1"),)


@pytest.mark.parametrize("by", [(Sense.WRIST, Sense.EYES), ()])
def test_km_hears_which_senses_told_what_a_hand_holds(by):
    """Also after an act that says nothing of it: the newest evidence counts until the hand is
    empty.
    """
    scene = Scene(LOOK, HOME, observed=True)
    scene.ends(done(**held(*by)))
    scene.ends(done(held=HELD), 1)
    scene.hears("co", 3)
    told = [one for one in scene.news(wm.SeenHand) if one.object]
    assert told == [wm.SeenHand(Side.LEFT, *HELD[Side.LEFT], by)] * len(told)
    assert told


def test_each_fault_of_each_sense_is_told():
    """Of which some never come together; with the number of an offset."""
    for sense in rc.Sensor:
        for fault in rc.Fault:
            told = outgoing_messages.ill(done(ill=(rc.Ill(sense, fault, 0.05),)))
            assert told == (fact(Kind.ILL, sense, fault, 0.05),)


def test_what_was_cancelled_is_not_cancelled_again():
    """ex agreed while the cancel was on its way, and its time passes again: nothing more is said to
    it.
    """
    memory = Memory(act=RunningAct("ta-1-1", HOME, agreed=True, stopped=True))
    fail = pytest.fail
    turn = SimpleNamespace(event=Woken(acts.PATIENCE), say=lambda *_: fail("a second cancel"))
    assert not acts.overdue(memory, turn)
    assert acts.stop(memory, turn) is memory


def test_a_robot_that_does_not_answer_a_cancel_is_told_of():
    """Once, amid a plan; the answer is waited for all the same, and ends the plan."""
    scene = Scene(HOME)
    scene.wires.run(lambda: scene.heard["ex"][-1][1] == "cancel")
    scene.wires.run_for(acts.STOPPED_S - 1.0)
    assert scene.states() == ["Running"]
    scene.wires.run_for(5 * acts.STOPPED_S)
    assert scene.states() == ["Running", "Terminating"]
    report = scene.heard["co"][-1][2]
    assert (report.at.id, report.why) == ("Home", (fact(Kind.NOT_ANSWERING, AgentName.EX),))
    scene.cancelled(HOME.key)
    scene.wires.run_for(1.0)
    assert scene.states()[-1] == "Replan"


def test_a_report_does_not_wait_for_km_for_ever():
    """After a while it says what km has not; ta goes on with the next plan."""
    scene = Scene(HOME)
    scene.ends(done())
    scene.wires.run_for(behaviours.BARRIER_S - 1.0)
    assert scene.states() == ["Running"]
    scene.wires.run_for(2.0)
    assert scene.states() == ["Running", "Succeeded"]
    assert scene.heard["co"][-1][2].why == (fact(Kind.NOT_OBSERVED_YET),)
    assert scene.state == "idle"


def test_what_the_hands_hold_is_known_from_plan_to_plan():
    """A later plan that must stop puts it down."""
    scene = Scene(observed=True)
    scene.ends(rc.Done("survey-1", BODY))
    scene.wires.run(lambda: scene.state == "idle")
    for number in (1, 2):
        scene.start(plan(hfsm.ActState("home", HOME)))
        scene.hears("ex", number + 1)
        assert bool(scene.wires.memory("ta").hands) == (number > 1)
        scene.ends(rc.Done(HOME.key, BODY, (), HELD), number)
        scene.wires.run_for(1.0)
        assert scene.state == "idle"
        assert scene.wires.memory("ta").hands


# --- looks around for an observer -----------------------------------------------------------------


def reasons(scene):
    """What km was told of each look around that showed nothing."""
    return [one.why for one in scene.news(wm.NothingSeen)]


def looks(scene):
    """Keys of the looks that ex was asked for."""
    return [content.key for _, _, content in scene.heard["ex"] if isinstance(content, rc.Look)]


def test_a_look_around_whose_end_crosses_the_cancel_is_tried_again():
    """ex answers late, so its end and ta's cancel cross; ta does not wait in `surveying` for
    ever.
    """
    scene = Scene(observed=True)
    assert isinstance(scene.hears("ex", 1), rc.Look)
    scene.ex(P.AGREE, rc.Accepted(rc.Look("", ()).key, 1.0))
    scene.wires.run(lambda: len(scene.heard["ex"]) > 1, limit_s=acts.AGREE_WITHIN_S + 100.0)
    assert scene.heard["ex"][1][1] == P.CANCEL
    scene.ex(P.FAILURE, rc.NotDone("survey", "failed", STUCK))
    assert isinstance(scene.hears("ex", 3), rc.Look)


def test_the_posture_is_told_last():
    """It ends a look around; nothing else is said of that."""
    scene = Scene(observed=True)
    scene.ends(rc.Done("survey-1", BODY))
    scene.wires.run_for(5.0)
    assert reasons(scene) == []
    assert isinstance(scene.heard["km"][-1][2], wm.SeenBody)


def test_a_look_around_that_fails_is_told_after_the_last_try():
    """With the reason; tries before it say nothing."""
    scene = Scene(observed=True)
    for number in range(behaviours.SURVEYS):
        assert reasons(scene) == []
        scene.ends(rc.NotDone(f"survey-{number + 1}", "refused", STUCK, BODY), number, P.REFUSE)
        scene.wires.run_for(0.5)
    assert reasons(scene) == [STUCK]


def test_a_look_around_that_never_ends_is_told_as_failed():
    """ex neither agrees nor answers the cancel."""
    scene = Scene(observed=True)
    scene.hears("ex", 2)
    scene.wires.run_for(acts.STOPPED_S - 1.0)
    assert reasons(scene) == []
    scene.wires.run_for(2.0)
    assert reasons(scene) == [(fact(Kind.NOT_ANSWERING, AgentName.EX),)]


def test_an_observer_that_comes_amid_a_plan_does_not_wait_for_a_look():
    """None is made for it, and it is told so."""
    scene = Scene(HOME, observed=True)
    scene.wires.run_for(1.0)
    assert reasons(scene) == [(fact(Kind.NO_LOOK_IN_A_PLAN),)]


def test_an_observer_that_comes_before_the_final_report_is_confirmed_does_not_wait_for_a_look():
    """co is down meanwhile."""
    scene = Scene(HOME)
    scene.observe()
    scene.wires.run_for(1.0)
    scene.wires.crash("co", Point.BEFORE, restart_s=5.0)
    scene.ends(rc.Done(HOME.key, BODY))
    scene.wires.run(lambda: scene.state == "finished")
    before = len(reasons(scene))
    scene.observe()
    scene.wires.run_for(1.0)
    assert scene.state == "finished"
    assert reasons(scene)[before:] == [(fact(Kind.NO_LOOK_IN_A_PLAN),)]
    scene.wires.run_for(20.0)
    assert scene.state == "idle"


def test_acts_beside_plans_are_counted_over_plans():
    """No look has the key of an earlier one: ex would not do it again. ta is idle after its plan,
    and serves on.
    """
    scene = Scene()
    for number in (1, 2):
        for _ in range(2):
            scene.observe()
            scene.wires.run_for(0.2)
            assert looks(scene) == [f"survey-{n}" for n in range(1, number + 1)], (
                "one look around does for both"
            )
        assert scene.heard["km"][-1][1] == "agree"
        scene.ends(rc.Done(f"survey-{number}", BODY), 2 * (number - 1))
        scene.wires.run_for(0.5)
        scene.start(plan(hfsm.ActState("home", HOME)))
        scene.ends(rc.Done(HOME.key, BODY), 2 * number - 1)
        scene.wires.run_for(1.0)
        assert scene.states() == ["Running", "Succeeded"] * number
        assert scene.state == "idle"
        assert scene.wires.nodes["ta"].state.wakes == {}


def test_a_look_around_is_tried_again_after_a_while_and_not_for_other_news():
    """A peer that comes up between the tries is not an outcome of a look."""
    scene = Scene(observed=True)
    scene.ends(rc.NotDone("survey-1", "refused", STUCK, BODY), 0, P.REFUSE)
    scene.wires.run_for(behaviours.AGAIN_S / 2)
    assert looks(scene) == ["survey-1"]
    tries = scene.wires.memory("ta").survey
    scene.wires.crash("co", Point.BEFORE, restart_s=0.1)
    scene.wires.post("co", Open("ta", "nothing", P.REQUEST))
    scene.wires.run_for(0.5)
    assert scene.wires.memory("ta").survey == tries
    scene.wires.run_for(behaviours.AGAIN_S / 2)
    assert looks(scene) == ["survey-1", "survey-2"]
