"""ta's agent with scripted partners: refusals, unknown outcomes, late acts, and who is told what and when."""

from scripted_partner import Open, Say
from ta_alone import BODY, HOME, LOOK, OK, Scene, plan

from companion.languages import hfsm, rc, sw, wm
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from services.task import acts


def test_a_plan_that_leads_nowhere_is_refused() -> None:
    """The reason names the state that is not there, and ta stays idle."""
    scene = Scene()
    scene.start(plan(hfsm.ActState("look", LOOK, (hfsm.Arc(OK, "nowhere"),))))
    report = scene.hears("co", 1)
    assert scene.heard["co"][0][1] == "refuse"
    assert "nowhere" in report.reason
    scene.start(plan(hfsm.EndState("end", hfsm.Outcome.FAILED, "because")))
    scene.hears("co", 3)
    assert scene.states()[1:] == ["Running", "Failed"]


def test_states_are_reported_and_confirmed() -> None:
    """Running at each state with its path, and one final report."""
    scene = Scene()
    scene.start(plan(hfsm.ActState("look", LOOK, (hfsm.Arc(OK, "home"),)), hfsm.ActState("home", HOME)))
    assert scene.hears("co", 1).at == "look"
    scene.hears("ex", 1)
    scene.ex(P.INFORM, rc.Done("plan/1", BODY))
    assert scene.hears("co", 2).at == "home"
    scene.hears("ex", 2)
    scene.ex(P.REFUSE, rc.NotDone("plan/2", "refused", "the arm is stuck"), number=1)
    scene.wires.run(lambda: scene.wires.nodes["ta"].state.state == "closing")
    assert len(scene.heard["co"]) == 2, "the final report waits for km"
    scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
    scene.wires.run_for(1.0)
    report = scene.hears("co", 3)
    assert (report.state, report.reason) == (sw.WorkerState.FAILED, "the arm is stuck")


def test_an_unknown_outcome() -> None:
    """The world is looked at without moving an arm, then Replan is reported; the act is not repeated."""
    scene = Scene()
    scene.start(plan(hfsm.ActState("home", HOME)))
    scene.hears("ex", 1)
    scene.ex(P.FAILURE, rc.NotDone("plan/2", "unknown", "ex was restarted"))
    look = scene.hears("ex", 2)
    assert isinstance(look, rc.Look)
    scene.ex(P.FAILURE, rc.NotDone(look.key, "failed", "no"), number=1)
    report = scene.hears("co", 3)
    assert scene.states() == ["Running", "Error", "Replan"]
    assert report.reason == "ex was restarted"
    assert [type(content) for _, _, content in scene.heard["ex"]] == [rc.Home, rc.Look]


def test_a_late_act_is_cancelled() -> None:
    """Five times its expected time and a margin after the agree; then Failed, once ex has had its last word."""
    scene = Scene()
    scene.start(plan(hfsm.ActState("home", HOME)))
    scene.hears("ex", 1)
    began = scene.wires.now
    scene.ex(P.AGREE, rc.Accepted("plan/2", 4.0))
    scene.wires.run(lambda: scene.heard["ex"][-1][1] == "cancel")
    assert abs(scene.wires.now - began - (acts.SLACK * 4.0 + acts.MARGIN_S)) < 0.5
    stopped = rc.NotDone("plan/2", "cancelled", "cancelled")
    scene.wires.post("ex", Say(0, P.INFORM, stopped, Kind.CANCEL))
    report = scene.hears("co", 2)
    assert report.state is sw.WorkerState.FAILED
    assert "too long" in report.reason


def test_a_question_without_an_answer() -> None:
    """The plan fails and says what km was asked."""
    scene = Scene()
    scene.start(plan(hfsm.AskState("is it there?", wm.Holds(relation="isOn", subject="jar_1"))))
    report = scene.hears("co", 2)
    assert report.state is sw.WorkerState.FAILED
    assert "is it there?" in report.reason


def test_a_look_tells_what_was_seen() -> None:
    """The final report of a look names the things."""
    scene = Scene()
    scene.start(plan(hfsm.ActState("look", LOOK)))
    scene.hears("ex", 1)
    scene.ex(P.FAILURE, rc.NotDone("plan/1", "replan", "moved"))
    assert scene.hears("co", 2).state is sw.WorkerState.REPLAN


def test_a_look_around_whose_end_crosses_the_cancel_is_tried_again() -> None:
    """ex answers late, so its end and ta's cancel cross; ta does not wait in `surveying` for ever."""
    scene = Scene()
    scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
    assert isinstance(scene.hears("ex", 1), rc.Look)
    scene.ex(P.AGREE, rc.Accepted(rc.Look("", ()).key, 1.0))
    scene.wires.run(lambda: len(scene.heard["ex"]) > 1, limit_s=acts.AGREE_WITHIN_S + 100.0)
    assert scene.heard["ex"][1][1] == P.CANCEL
    scene.ex(P.FAILURE, rc.NotDone("survey", "failed", "too late"))
    assert isinstance(scene.hears("ex", 3), rc.Look)
