"""An act that waits for the operator: what lets it begin, what ends its plan, what co is told."""

import pytest
from scripted_partner import Say
from ta_alone import BODY, HOME, LOOK, OK, Scene, plan, plan_of

from agent_runtime.core.control import SetParameter
from companion.autonomy import LEVEL, STEP, WAIT_S, Level, Permission, Verb
from companion.languages import hfsm, rc, sw
from companion.languages.facts import Kind, fact
from fipa_codec.performatives import Performative as P
from services.task.running import WANTED

OTHERWISE = plan(
    hfsm.ActState("look", LOOK, (hfsm.Arc(OK, "home"), hfsm.Arc(hfsm.Outcome.REPLAN, "home"))),
    hfsm.ActState("home", HOME),
)


def waiting(asked=None):
    """ta with a plan whose first act, a look, waits."""
    scene = Scene()
    scene.wires.order("ta", SetParameter(LEVEL, Level.CONFIRM.value))
    scene.start(asked or plan_of(LOOK, HOME))
    scene.wires.run_for(1.0)
    assert (scene.state, scene.states(), scene.heard["ex"]) == ("waiting", ["Waiting"], [])
    return scene


def order(scene, verb, at):
    """The operator's word about a leaf, and a second after it."""
    scene.wires.order("ta", SetParameter(STEP, str(Permission(verb, at))))
    scene.wires.run_for(1.0)


def wakes(scene):
    """What ta is to be woken for."""
    return [*scene.wires.nodes["ta"].state.wakes]


def begun(scene):
    """The acts that ex was asked for."""
    return [content for _, _, content in scene.heard["ex"]]


def test_each_act_begins_at_the_operators_word_about_it():
    """It goes on waiting after any other word; when it begins, nobody is waited for any more."""
    scene = waiting()
    assert scene.heard["co"][-1][2].at.id == "Look"
    order(scene, Verb.GO, "Home")
    scene.observe()
    scene.wires.run_for(1.0)
    assert (scene.state, begun(scene), len(wakes(scene))) == ("waiting", [], 1)
    order(scene, Verb.GO, "Look")
    assert (scene.state, begun(scene), wakes(scene)) == ("running", [LOOK], [])
    scene.ends(rc.Done(LOOK.key, BODY))
    scene.wires.run_for(1.0)
    assert (scene.state, scene.heard["co"][-1][2].at.id) == ("waiting", "Home")
    order(scene, Verb.GO, "Home")
    assert begun(scene) == [LOOK, HOME]


def test_an_act_begins_when_the_level_asks_for_it_no_more():
    """A look handles nothing."""
    scene = waiting()
    scene.wires.order("ta", SetParameter(LEVEL, Level.HANDLING.value))
    scene.wires.run_for(1.0)
    assert begun(scene) == [LOOK]


def test_a_new_plan_in_place_of_an_act_that_waits_is_what_the_plan_says_of_it():
    """Its end, or another act, which was asked about with this word."""
    scene = waiting()
    order(scene, Verb.REPLAN, "Look")
    scene.wires.run_for(40.0)
    report = scene.heard["co"][-1][2]
    assert (report.state, report.why[: len(WANTED)]) == (sw.WorkerState.REPLAN, WANTED)
    assert begun(scene) == []
    scene = waiting(OTHERWISE)
    order(scene, Verb.REPLAN, "look")
    assert begun(scene) == [HOME]


@pytest.mark.timeout(60)
def test_a_plan_for_which_nobody_comes_has_failed():
    """After ten minutes; the reason says how many."""
    scene = waiting()
    scene.wires.run_for(WAIT_S - 3.0)
    assert scene.states() == ["Waiting"]
    scene.wires.run_for(40.0)
    report = scene.heard["co"][-1][2]
    assert (scene.states(), report.why[0]) == (["Waiting", "Failed"], fact(Kind.NOBODY_CAME, 10.0))
    assert (scene.state, begun(scene)) == ("idle", [])


def test_a_plan_that_is_cancelled_while_an_act_waits_begins_nothing():
    """The operator is not waited for."""
    scene = waiting()
    scene.wires.post("co", Say(0, P.CANCEL))
    scene.wires.run_for(40.0)
    assert scene.states() == ["Waiting", "Terminating", "Preempted"]
    assert (begun(scene), wakes(scene)) == ([], [])
