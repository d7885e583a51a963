"""A cancelled plan is made safe: ta goes on where one thing goes wrong, tries twice, and says what is still held."""

from scripted_partner import Open, Say
from ta_alone import BODY, CANCELLED, HOME, Scene

from companion.languages import hfsm, rc, sw, wm
from companion.languages.facts import Facts, Kind, fact
from companion.languages.values import Pose, Side
from fipa_codec import languages
from fipa_codec.performatives import Performative as P

JAR = ("jar_1", "side", Pose((0.0, 0.0, 0.0)))
BOWL = ("bowl_1", "rim", Pose((0.0, 0.0, 0.0)))
NO_PLACE = (fact(Kind.NO_FREE_PLACE, Side.RIGHT, "bowl_1"),)
BOTH = {Side.LEFT: JAR, Side.RIGHT: BOWL}
GO_ON = tuple(hfsm.Arc(outcome, "put down jar_1") for outcome in (hfsm.Outcome.SUCCEEDED, hfsm.Outcome.FAILED))
SAFE = hfsm.Machine(
    "put everything down",
    "put down bowl_1",
    (
        hfsm.ActState("put down bowl_1", rc.Release("plan.1", Side.RIGHT, "bowl_1", "", None, ()), GO_ON),
        hfsm.ActState("put down jar_1", rc.Release("plan.2", Side.LEFT, "jar_1", "", None, ())),
    ),
)
ROOT = hfsm.Machine("test", "home", (hfsm.ActState("home", HOME),), safe=SAFE)
PLAN = hfsm.HierarchicalPlan("plan", "test", ROOT, 1.0, 0)


def cancelled_while_holding_both() -> Scene:
    """ta with a plan cancelled in its act; both hands are full, and the bowl is asked to be put down."""
    scene = Scene()
    scene.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))
    scene.hears("ex", 1)  # the look around
    scene.ex(P.INFORM, rc.Done(scene.heard["ex"][0][2].key, BODY))
    scene.wires.run(lambda: scene.wires.nodes["ta"].state.state == "idle")
    scene.start(PLAN)
    scene.hears("ex", 2)
    scene.ex(P.AGREE, rc.Accepted("plan/2", 4.0), number=1)
    scene.wires.post("co", Say(0, P.CANCEL))
    scene.wires.run(lambda: scene.heard["ex"][-1][1] == "cancel")
    stopped = rc.NotDone("plan/2", "cancelled", CANCELLED, BODY, held=BOTH)
    scene.wires.post("ex", Say(1, P.INFORM, stopped, languages.Kind.CANCEL))
    return scene


def acts(scene: Scene) -> list[str]:
    """Keys of the put-downs asked of ex."""
    return [content.key for _, _, content in scene.heard["ex"] if isinstance(content, rc.Release)]


def final(scene: Scene) -> sw.Report:
    """The last word to co."""
    scene.wires.run(lambda: scene.states()[-1] in ("Preempted", "Failed"), limit_s=100.0)
    return scene.heard["co"][-1][2]


def answer(scene: Scene, number: int, kept: dict[Side, tuple[str, str, Pose]], failed: Facts = ()) -> None:
    """The nth put-down ends with this in the hands."""
    scene.wires.run(lambda: len(acts(scene)) == number)
    key = acts(scene)[-1]
    if failed:
        scene.ex(P.REFUSE, rc.NotDone(key, "failed", failed, BODY, held=kept), number=number + 1)
    else:
        scene.ex(P.INFORM, rc.Done(key, BODY, held=kept), number=number + 1)


def test_one_that_fails_keeps_the_other_not_up() -> None:
    """The bowl finds no place, the jar is put down, the bowl is tried again under a key of its own: Preempted."""
    scene = cancelled_while_holding_both()
    answer(scene, 1, BOTH, failed=NO_PLACE)
    answer(scene, 2, {Side.RIGHT: BOWL})
    answer(scene, 3, {})
    answer(scene, 4, {})
    assert acts(scene) == ["plan.1", "plan.2", "plan.1.2", "plan.2.2"]
    assert final(scene).state is sw.WorkerState.PREEMPTED


def test_what_cannot_be_put_down_is_told() -> None:
    """After the second try the plan has failed, and the person hears what is held and why."""
    scene = cancelled_while_holding_both()
    for number in (1, 3):
        answer(scene, number, BOTH, failed=NO_PLACE)
        answer(scene, number + 1, {Side.RIGHT: BOWL})
    report = final(scene)
    assert report.state is sw.WorkerState.FAILED
    assert report.why == (fact(Kind.STILL_HELD, "bowl_1", *NO_PLACE),)
