"""Every number of every command: what is not finite, out of its range or endless is refused by its
field, before anything moves. Fields are read from the types, so that a new one is drawn as well.
"""

import itertools
import math
import re
from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

import msgspec
import numpy as np
import pytest
from doubles import RobotDouble, all_finite
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.languages import rc
from companion.languages.facts import Kind, fact
from companion.languages.values import Pose, Within
from companion.skills.loop_messages import (
    Close,
    HandCommand,
    HeadGoal,
    Motion,
    Move,
    Phase,
    Until,
    motion,
)
from services.executor import outgoing_messages
from services.executor.loop import act
from services.executor.loop.core import LoopCore
from services.executor.loop.link import LoopCommand
from velma import ranges
from velma.control.cartesian import CartesianGains
from velma.control.dynamics import Dynamics
from velma.control.joint import JointGains
from velma.errors import MotionError
from velma.kinematics import ik, timing
from velma.kinematics import motion as planning
from velma.kinematics.collision import World
from velma.kinematics.robot import Robot
from velma.model.tree import ROBOT_XML
from velma.names import BODY, COLUMNS, LOWER, SIDES, START, UPPER
from velma.sim.mock_backend import MockBackend

DYNAMICS, ROBOT = Dynamics(ROBOT_XML), Robot()
ODD = (math.nan, math.inf, -math.inf, -0.0, 0.0, -1.0, 1e-6, -1e-300, 5e-324, 1e6, 1e308, -1e308)
# the others have a test below
QUICK = {ranges.Seconds: st.floats(0.0, 0.5), ranges.JointSpeed: st.floats(1.0, 10.0)}
KNOTS = (START, np.array(START) + np.linspace(0.0, 0.02, 20)[:, None])
UNIT_QUAT = st.just((1.0, 0.0, 0.0, 0.0))


@lru_cache(maxsize=256)
def right(kind: Any) -> st.SearchStrategy[Any]:
    """Values of a type that are all right, by its ranges."""
    parts, origin = get_args(kind), get_origin(kind)
    if origin is Annotated:
        return QUICK[kind] if kind in QUICK else _within(parts)
    if origin is Literal:
        return st.sampled_from(parts)
    if origin is tuple:
        many = parts[-1] is ...
        some = st.lists(right(parts[0]), min_size=1, max_size=3).map(tuple)
        return some if many else st.tuples(*map(right, parts))
    if parts:  # a union
        return st.one_of(*map(right, parts))
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        hints = get_type_hints(kind, include_extras=True)
        fields = {name: _field(kind, name, hint) for name, hint in hints.items()}
        return st.fixed_dictionaries(fields).map(lambda values: kind(**values))
    plain = {float: st.floats(-1.0, 1.0), str: st.just("jar_1"), bool: st.booleans()}
    plain[type(None)] = st.none()
    return plain[kind] if kind in plain else st.sampled_from(kind)


def _within(parts: tuple[Any, ...]) -> st.SearchStrategy[Any]:
    base, *notes = parts
    for note in notes:
        if isinstance(note, Within):
            return st.floats(*note)
        if isinstance(note, msgspec.Meta) and note.ge is not None:
            return st.integers(note.ge, note.le) if base is int else st.floats(note.ge, note.le)
    return st.just("jar_1")  # a name


def _field(kind: type, name: str, hint: Any) -> st.SearchStrategy[Any]:
    """Fields whose values mean more than their types say."""
    special = {
        (Motion, "knots"): st.sampled_from([np.atleast_2d(knots).tobytes() for knots in KNOTS]),
        (Motion, "until"): st.sampled_from([Until.END, Until.CONTACT]),
        (rc.MoveJoint, "path"): st.just((tuple(START[COLUMNS["left"]].tolist()),) * 2),
        (rc.MoveJoint, "side"): st.just(rc.Side.LEFT),
        (Pose, "quat_wxyz"): UNIT_QUAT,
    }
    return special[kind, name] if (kind, name) in special else right(hint)


def leaves(value: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Ways to every number in a value, and to every tuple."""
    if isinstance(value, msgspec.Struct):
        for name in value.__struct_fields__:
            yield from leaves(getattr(value, name), (*path, name))
    elif isinstance(value, tuple):
        yield path
        for k, one in enumerate(value):
            yield from leaves(one, (*path, k))
    elif isinstance(value, float) or type(value) is int:
        yield path


def at(value: Any, path: Iterable[str | int]) -> Any:
    """What is at the end of a way."""
    for part in path:
        value = value[part] if isinstance(part, int) else getattr(value, part)
    return value


def changed(value: Any, path: tuple[str | int, ...], new: Any) -> Any:
    """The value with another one at the end of the way."""
    if not path:
        return new
    first, *rest = path
    if isinstance(value, tuple):
        return (*value[:first], changed(value[first], tuple(rest), new), *value[first + 1 :])
    inner = changed(getattr(value, first), tuple(rest), new)
    return msgspec.structs.replace(value, **{first: inner})


@st.composite
def almost(draw: st.DrawFn, kind: Any) -> tuple[Any, str]:
    """A value of a type, perhaps with one field that is odd, and the name of that field."""
    value = draw(right(kind))
    ways = list(leaves(value))
    if not ways or draw(st.integers(0, 5)) == 0:
        return value, ""
    way = draw(st.sampled_from(ways))
    whole = at(value, way)
    odd = draw(st.sampled_from([(), (*whole, math.nan)] if isinstance(whole, tuple) else ODD))
    return changed(value, way, odd), [part for part in way if isinstance(part, str)][-1]


def numbers(value: Any) -> list[float]:
    """All numbers in a value."""
    found = (at(value, way) for way in leaves(value))
    return [one for one in found if not isinstance(one, tuple)]


def complaint(error: type[Exception], call: Callable[[], object]) -> str:
    """What an exception of this kind says, "" if none is raised."""
    try:
        call()
    except error as raised:
        return str(raised)
    return ""


def listened(**options: Any) -> LoopCore:
    """A loop whose every command is looked at."""
    return LoopCore(RobotDouble(asked=all_finite), dynamics=DYNAMICS, **options)


@settings(max_examples=60, deadline=None)
@given(almost(Motion))
def test_a_motion_is_refused_by_its_field_or_ends(drawn: tuple[Motion, str]) -> None:
    """By slot and loop alike. One that is taken ends, with finite commands and without a fault."""
    asked, field = drawn
    core = listened()
    refused = core.begin(asked)
    read = complaint(
        msgspec.ValidationError, lambda: msgspec.convert(msgspec.to_builtins(asked), LoopCommand)
    )
    assert not read or (refused and field in read)
    if refused:
        assert field
        assert field in refused.text
        assert "expected" in refused.text
        (why,) = refused.why
        assert why.kind is Kind.MOTION_REFUSED
        assert field.replace(" ", "_") in why.words[0]
        assert core.command.tau.tolist() == [0.0] * 15
        return
    assert all(map(math.isfinite, numbers(asked)))
    while core.report.phase is Phase.RUNNING and core.state.time < 300.0:
        core.cycle()
    assert core.report.phase in (Phase.DONE, Phase.BLOCKED)  # the tolerance may be 0
    assert core.faults == 0


@settings(max_examples=150, deadline=None)
@given(almost(HandCommand), st.sampled_from(SIDES))
def test_a_hand_command_is_refused_by_its_field(drawn: tuple[Any, str], side: str) -> None:
    """By the maker of motions; -0 is 0, which some fields may be."""
    command, field = drawn
    why = complaint(MotionError, lambda: motion("key", START, **{side: command}))
    if why:
        assert why.startswith(f"motion: {side}.{field}")
    else:
        assert all(math.isfinite(one) and one >= 0.0 for one in numbers(command))


@settings(max_examples=300, deadline=None)
@given(almost(rc.Command))
def test_a_command_of_the_language_is_refused_by_its_field(drawn: tuple[Any, str]) -> None:
    """What is right is not refused."""
    command, field = drawn
    wrong = outgoing_messages.wrong(command)
    if wrong:
        assert field
        assert field in wrong.text
        assert field in wrong.field
    else:
        assert all(math.isfinite(one) and abs(one) <= 100.0 for one in numbers(command))


@settings(max_examples=60, deadline=None)
@given(almost(CartesianGains | JointGains))
def test_gains_are_refused_by_their_field(drawn: tuple[Any, str]) -> None:
    """A loop with those that are taken has no fault."""
    gains, field = drawn
    chosen = {"gains" if isinstance(gains, CartesianGains) else "hold": gains}
    made: list[LoopCore] = []
    why = complaint(MotionError, lambda: made.append(listened(**chosen)))
    if why:
        assert why.startswith(f"motion: {field}")
        assert field
        return
    made[0].hold(0.01)
    made[0].stop()
    made[0].hold(0.01)
    assert made[0].faults == 0


@settings(max_examples=60, deadline=None)
@given(
    st.sampled_from(ODD),
    st.sampled_from(["tool_speed", "path"]),
    st.integers(0, 14),
)
def test_a_timed_path_is_refused_by_what_is_wrong(odd: float, what: str, joint: int) -> None:
    """Else it ends in time, and no number is lost on the way."""
    goal = np.array(START)
    goal[joint] = odd if what == "path" else goal[joint] + 0.1
    tool_speed = 0.3 if what == "path" else odd
    found: list[timing.Trajectory] = []
    why = complaint(
        MotionError,
        lambda: found.append(timing.timed(ROBOT, [np.array(START), goal], tool_speed=tool_speed)),
    )
    if why:
        of = f": {BODY[joint]}" if what == "path" else ""
        assert why.startswith(f"motion: {what}{of}")
    else:
        assert what == "path"
        assert LOWER[joint] <= odd <= UPPER[joint]
        assert found[0].duration <= ranges.LONGEST_S


@pytest.mark.timeout(300)  # 18 s of a processor
def test_the_slowest_motion_that_may_be_asked_for_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before the loop gives up hands or head; with a goal that none can reach it does."""
    slow = Close(ranges.FINGER_UPPER, ranges.FINGER_UPPER, ranges.SLOWEST_JOINT, settle_s=60.0)
    head = HeadGoal(1.57, 1.3, ranges.SLOWEST_JOINT)
    core = listened()
    core.backend.grasped[0] = 2.3
    assert core.run(motion("slow", START, right=slow, head=head, settle_s=60.0)).phase is Phase.DONE
    monkeypatch.setattr(act, "HANDS_S", 1.0)
    core.begin(motion("never", START, left=Move((1.0, 1.0, 1.0))))
    core.fingers._goal[1] = 3.0
    while core.report.phase is Phase.RUNNING:
        core.cycle()
    assert core.report.phase is Phase.FAILED
    assert core.report.why == (fact(Kind.NOT_ARRIVED, "hand", 1.0),)
    assert core.run(motion("next", START, left=Move((1.0, 1.0, 1.0)))).phase is Phase.DONE


PATHS: tuple[tuple[list[Any], float, str], ...] = (
    ([], 0.3, "path"),
    ([START[:14]], 0.3, "path"),
    ([START, START[:3]], 0.3, "path"),
    ([START, -np.array(START)] * 200, 0.3, "path"),
    ([START, -np.array(START)], ranges.SLOWEST_TOOL, "path"),
    ([START, START], 0.0, "tool_speed"),
)


def test_a_path_that_is_none_or_takes_too_long_is_refused() -> None:
    """Before memory is taken for it."""
    for path, tool_speed, field in PATHS:
        with pytest.raises(MotionError, match=re.escape(f"motion: {field}")):
            timing.timed(ROBOT, path, tool_speed=tool_speed)


@pytest.mark.parametrize("side", SIDES)
def test_no_goal_beyond_a_joint_is_planned(side: str) -> None:
    """Of any joint, at either end, named with what is allowed; nor from a start that is none."""
    world, ends = World(ROBOT), ((LOWER, -1.0), (UPPER, 1.0))
    far = (1e-6, 0.05, 0.3, 10.0, math.nan, math.inf)
    for joint, (end, way), beyond in itertools.product(COLUMNS[side], ends, far):
        goal = np.array(START)
        goal[joint] = end[joint] + way * beyond
        words = rf"goal: {BODY[joint]} is .* rad, expected from -.* to "
        with pytest.raises(MotionError, match=words):
            planning.plan(ROBOT, world, side, np.array(START), goal)
    with pytest.raises(MotionError, match="start: torso_0_joint is nan"):
        planning.plan(ROBOT, world, side, np.full(15, math.nan), np.array(START))


def test_a_joint_beyond_its_limit_may_come_back() -> None:
    """It is planned, timed and followed; a path farther out is refused."""
    start, out = np.array(START), np.array(START)
    start[8 + 1] = UPPER[9] + 0.1
    out[8 + 1] = UPPER[9] + 0.15
    backend = MockBackend()
    backend.observe().q[:] = start
    core = LoopCore(backend, dynamics=DYNAMICS)
    found = timing.timed(ROBOT, [start, np.array(START)], tool_speed=0.3)
    for _ in range(2):  # each within what is blended, and farther beyond than the set-point
        refused = core.begin(motion("out", start + 0.04 * np.eye(15)[9]))
        assert refused is not None
        assert refused.why == (fact(Kind.MOTION_REFUSED, "knots:_left_arm_1_joint"),)
    assert core.run(motion("back", found.q)).phase is Phase.DONE
    with pytest.raises(MotionError, match="path: left_arm_1_joint"):
        timing.timed(ROBOT, [start, out], tool_speed=0.3)


def test_a_posture_that_is_none_is_neither_free_nor_reached() -> None:
    """Of collision checks and inverse kinematics, with all or one joint not finite."""
    for joint, odd in ((slice(None), math.nan), (9, math.nan), (0, math.inf)):
        q = np.array(START)
        q[joint] = odd
        assert not World(ROBOT).free(q)
        assert ik.solve(ROBOT, "left", ROBOT.grip(np.array(START), "left"), q) is None


def test_the_language_has_the_ranges_of_the_robot() -> None:
    """Its module may not import them."""
    kinds = (
        (rc.Bend, ranges.Bend),
        (rc.FingerSpeed, ranges.JointSpeed),
        (rc.Kilograms, ranges.Kilograms),
    )
    for theirs, ours in (*kinds, (rc.Rest, ranges.Seconds)):
        meta = get_args(ours)[1]
        assert tuple(get_args(theirs)[1]) == (meta.ge, meta.le)
    assert tuple(get_args(rc.ToolSpeed)[1]) == (ranges.SLOWEST_TOOL, ranges.FASTEST_TOOL)
