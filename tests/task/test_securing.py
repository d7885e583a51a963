"""A cancelled plan is made safe: ta goes on where one thing goes wrong, tries twice, and says what
is still held.
"""

from scripted_partner import Say
from ta_alone import BODY, HOME, Scene

from companion.languages import hfsm, rc, sw
from companion.languages.facts import Kind, fact
from companion.languages.values import Pose, Side
from fipa_codec.performatives import Performative as P

JAR = ("jar_1", "side", Pose((0.0, 0.0, 0.0)))
BOWL = ("bowl_1", "rim", Pose((0.0, 0.0, 0.0)))
NO_PLACE = (fact(Kind.NO_FREE_PLACE, Side.RIGHT, "bowl_1"),)
BOTH = {Side.LEFT: JAR, Side.RIGHT: BOWL}
ENDED = (hfsm.Outcome.SUCCEEDED, hfsm.Outcome.FAILED)
GO_ON = tuple(hfsm.Arc(outcome, "put down jar_1") for outcome in ENDED)
SAFE = hfsm.Machine(
    "put everything down",
    "put down bowl_1",
    (
        hfsm.ActState(
            "put down bowl_1", rc.Release("plan.1", Side.RIGHT, "bowl_1", "", None, ()), GO_ON
        ),
        hfsm.ActState("put down jar_1", rc.Release("plan.2", Side.LEFT, "jar_1", "", None, ())),
    ),
)
ROOT = hfsm.Machine("test", "home", (hfsm.ActState("home", HOME),), safe=SAFE)
PLAN = hfsm.HierarchicalPlan("plan", "test", ROOT, 1.0, 0)


def cancelled_while_holding_both(*ends):
    """ta with a plan cancelled in its act; both hands are full. The put-downs end with this in the
    hands, or fail.

    The keys of the put-downs asked of ex, and the final report.
    """
    scene = Scene(observed=True)
    scene.ends(rc.Done(scene.hears("ex", 1).key, BODY))  # the look around
    scene.wires.run(lambda: scene.state == "idle")
    scene.start(PLAN)
    scene.hears("ex", 2)
    scene.ex(P.AGREE, rc.Accepted("plan/2", 4.0), number=1)
    scene.wires.post("co", Say(0, P.CANCEL))
    scene.wires.run(lambda: scene.heard["ex"][-1][1] == "cancel")
    scene.cancelled("plan/2", 1, body=BODY, held=BOTH)
    keys = []
    for number, (kept, failed) in enumerate(ends, start=2):
        keys.append(scene.hears("ex", number + 2).key)
        outcome = rc.NotDone(keys[-1], "failed", failed, BODY, held=kept) if failed else None
        act = P.REFUSE if failed else P.INFORM
        scene.ex(act, outcome or rc.Done(keys[-1], BODY, held=kept), number)
    scene.wires.run(lambda: scene.states()[-1] in ("Preempted", "Failed"), limit_s=100.0)
    return keys, scene.heard["co"][-1][2]


def test_one_that_fails_keeps_the_other_not_up():
    """The bowl finds no place, the jar is put down, the bowl is tried again under a key of its own:
    Preempted.
    """
    right = {Side.RIGHT: BOWL}
    keys, report = cancelled_while_holding_both((BOTH, NO_PLACE), (right, ()), ({}, ()), ({}, ()))
    assert keys == ["plan.1", "plan.2", "plan.1.2", "plan.2.2"]
    assert report.state is sw.WorkerState.PREEMPTED


def test_what_cannot_be_put_down_is_told():
    """After the second try the plan has failed, and the person hears what is held and why."""
    _, report = cancelled_while_holding_both(*(((BOTH, NO_PLACE), ({Side.RIGHT: BOWL}, ())) * 2))
    assert report.state is sw.WorkerState.FAILED
    assert report.why == (fact(Kind.STILL_HELD, "bowl_1", *NO_PLACE),)
