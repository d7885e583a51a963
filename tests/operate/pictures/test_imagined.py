"""The end of a plan, drawn from when ta gets the plan until the plan has ended."""

import math

import msgspec
import pytest
from noted import Noted

from companion.design import HFSM, LANGUAGES
from companion.languages import hfsm, rc, sw
from companion.languages.values import Side
from companion.telemetry import RobotState, TrueState
from companion.tools.pictures import robot
from companion.tools.pictures.acts import ROBOT, THINGS, End, Imagined
from companion.tools.pictures.scene import Scene
from companion.tools.pictures.velma import entity
from companion.tools.telemetry import every
from fipa_codec.communicate import encode
from operate.pictures.sheet import HIDDEN, UNSEEN, transforms
from operate.recording.happenings import Happening
from operate.recording.history import History
from velma.model import tree
from velma.names import ARM, BODY, COLUMNS, START

LINKS = {link.joint: link for link in tree.links() if link.joint}


def plans(past: History) -> list[tuple[float, hfsm.HierarchicalPlan]]:
    """The plans that ta got, each with its time [s after the beginning]."""
    to_ta = [one for one in past.said if one.channel == "C1"]
    given = [one for one in to_ta if isinstance(one.content, hfsm.HierarchicalPlan)]
    return [(one.received - past.begin, one.content) for one in given]


def moves(machine: hfsm.Machine) -> list[rc.MoveJoint]:
    """The free motions of a plan, in order."""
    found: list[rc.MoveJoint] = []
    for state in machine.states:
        if isinstance(state, hfsm.Machine):
            found += moves(state)
        elif isinstance(command := getattr(state, "command", None), rc.MoveJoint):
            found.append(command)
    return found


def plan_of(state: hfsm.ActState) -> hfsm.HierarchicalPlan:
    """A plan of one act."""
    machine = hfsm.Machine("m", initial=state.name, states=(state,))
    return hfsm.HierarchicalPlan("p", "t", machine, 1.0, 0)


def test_the_ghost_has_the_last_free_motion_of_each_arm(
    true_past: History, true_sheet: Noted
) -> None:
    """Its joints stand where the last path of that side ends, from the time of the plan on."""
    (at, plan), *_ = plans(true_past)
    ends = {move.side: move.path[-1] for move in moves(plan.root)}
    assert set(ends) == set(ARM)
    for side, end in ends.items():
        # after the torso and the arm's own root
        for column, q in list(zip(COLUMNS[side], end, strict=True))[2:]:
            link = LINKS[BODY[column]]
            drawn = true_sheet.of(entity(link, ROBOT))
            shown = [value for when, value in drawn if when == pytest.approx(at)]
            assert shown[-1] == (link.at, pytest.approx(robot.turned(link, q)))


def test_the_ghost_is_gone_when_no_plan_is_carried_out(
    true_past: History, true_sheet: Noted
) -> None:
    """Before the first plan, and after each end of one: nothing of it is left."""
    reports = [one for one in true_past.said if isinstance(one.content, sw.Report)]
    final = [one for one in reports if one.content.state in sw.FINAL]
    ends = [one.received - true_past.begin for one in final]
    roots = [entity(LINKS[f"{side}_arm_0_joint"], ROBOT) for side in ARM]
    things = {name for name, _, _ in true_sheet.drawn if name.startswith(THINGS)}
    assert ends
    assert things == {f"{THINGS}/jar_1", f"{THINGS}/bowl_1"}
    for one in (*roots, *things):
        rows = true_sheet.of(one)
        assert rows[0] == (0.0, HIDDEN)
        for end in ends:
            assert [value for at, value in rows if at <= end][-1] == HIDDEN


@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_an_arm_that_stays_has_no_ghost(true_past: History, turn: float) -> None:
    """A plan that moves the left arm only; where it turns the torso, the right arm goes along."""
    sheet, start = Noted(0.0), tuple(START.tolist())
    drawer = Imagined(sheet, Scene(sheet))
    drawer.take(Happening(1.0, RobotState(1.0, start)))
    path = ((turn, *(q + 0.3 for q in start[8:])),)
    plan = plan_of(hfsm.ActState("move", rc.MoveJoint("key", Side.LEFT, path, 0.2)))
    given = next(
        one for one in true_past.said if isinstance(one.content, type(plan)) and one.channel == "C1"
    )
    wire = encode(msgspec.structs.replace(given.communicate, content=HFSM.encode(plan)))
    drawer.take(Happening(2.0, msgspec.structs.replace(given, wire=wire).read_in(LANGUAGES)))
    roots = {side: entity(LINKS[f"{side}_arm_0_joint"], ROBOT) for side in ARM}
    shown = {side: sheet.of(root)[-1][1] != HIDDEN for side, root in roots.items()}
    assert shown == {"left": True, "right": turn > 0.0}


def test_things_are_imagined_where_they_are_put_and_carried(true_past: History) -> None:
    """When the next plan is given, bowl and jar are within the errors of grasps of where the first
    one had them.
    """
    (_, first), (at, _) = plans(true_past)
    end = End(first, {})
    then = next(one for when, one in every(true_past, TrueState) if when >= true_past.begin + at)
    assert set(end.places) == {"bowl_1", "jar_1"}
    for name, pose in end.places.items():
        assert math.dist(pose.xyz, then.poses[name].xyz) < 0.03


def test_an_arm_that_goes_home_ends_in_its_start_posture() -> None:
    """All seven joints; the torso stays."""
    end = End(plan_of(hfsm.ActState("home", rc.Home("key", Side.LEFT))), dict.fromkeys(BODY, 0.5))
    assert [end.q[BODY[k]] for k in COLUMNS["left"]] == [0.5, *(START[k] for k in ARM["left"])]


def test_the_viewer_gets_places_that_it_takes() -> None:
    """Each rotation has a length of 1; what is hidden is shrunk, and shown again at its size."""
    shown = ((1.0, 2.0, 3.0), (0.0, 1.0, 0.0, 0.0))
    sent = [column.as_arrow_array().to_pylist() for column in transforms([shown, HIDDEN, shown])]
    places, turns, scales = ([row[0] for row in column] for column in sent)
    assert [math.hypot(*turn) for turn in turns] == pytest.approx([1.0, 1.0, 1.0])
    assert places[::2] == [[1.0, 2.0, 3.0]] * 2
    assert [max(scale) for scale in scales] == pytest.approx([1.0, UNSEEN, 1.0])
    assert UNSEEN < 1e-3
