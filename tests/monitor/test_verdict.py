"""When a run did the main job, as a table: one thing changed at a time."""

import math
from collections.abc import Callable

import msgspec
import pytest
from synthetic import Run

from companion.languages import cmd, sw
from companion.languages.values import Pose
from companion.telemetry import TrueState
from services.monitor import history, verdict
from services.monitor.records import Spoken, understood

Change = Callable[[TrueState], TrueState]


def changed(**fields: object) -> Change:
    """The truth with other fields."""
    return lambda truth: msgspec.structs.replace(truth, **fields)


TRUTHS = [
    ("as it should be", changed(), None),
    ("nine tenths", changed(grains_in={"jar_1": 3, "bowl_1": 27}), None),
    ("less than nine tenths", changed(grains_in={"jar_1": 4, "bowl_1": 26}), "87% of the content"),
    ("tilted a little", changed(tilt_deg={"jar_1": 0.0, "bowl_1": 9.9}), None),
    ("tilted", changed(tilt_deg={"jar_1": 0.0, "bowl_1": 10.0}), "tilted by 10 degrees"),
    ("jar dropped", changed(fingers_on={"jar_1": {"left": 0, "right": 0}, "bowl_1": {}}), "does not hold the jar"),
    (
        "jar in the other hand",
        changed(fingers_on={"jar_1": {"left": 0, "right": 5}, "bowl_1": {}}),
        "left hand does not",
    ),
    ("bowl held", changed(fingers_on={"jar_1": {"left": 4}, "bowl_1": {"right": 3}}), "touches the bowl"),
    ("bowl on the floor", changed(at={"jar_1": (0.0, 0.0, 1.0), "bowl_1": (0.58, -0.52, 0.0)}), "not on a table"),
    ("bowl beside", changed(at={"jar_1": (0.0, 0.0, 1.0), "bowl_1": (0.0, -0.1, 0.775)}), "not on a table"),
    ("no grains", changed(grains=0), "how much is in the bowl"),
]


@pytest.mark.parametrize(("truth", "reason"), [case[1:] for case in TRUTHS], ids=[case[0] for case in TRUTHS])
def test_success_by_the_truth(pouring: Run, truth: Change, reason: str | None) -> None:
    """Success is no reason against it; a failure names what was wrong."""
    past = _past(pouring)
    at, last = past.truth[-1]
    past = msgspec.structs.replace(past, truth=(*past.truth[:-1], (at, truth(last))))
    found = verdict.failure(past)
    assert found is None if reason is None else found is not None and reason in found


def test_without_the_truth_there_is_no_success(pouring: Run) -> None:
    """Nothing is assumed."""
    past = msgspec.structs.replace(_past(pouring), truth=())
    assert verdict.failure(past) == "the true state of the simulation was not recorded"


def test_tables_are_where_km_was_told_when_the_truth_does_not_say(pouring: Run) -> None:
    """A truth without poses is judged by observed tables."""
    past = _past(pouring)
    at, last = past.truth[-1]
    bare = msgspec.structs.replace(last, poses={}, models={})
    assert verdict.failure(msgspec.structs.replace(past, truth=((at, bare),))) is None


@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        (lambda one: isinstance(one.content, sw.Report) and one.content.state in sw.FINAL, "plan 1 did not end"),
        (lambda one: isinstance(one.content, cmd.TaskReport) and one.performative == "inform", "task did not end"),
        (lambda one: isinstance(one.content, cmd.Command), "no command"),
        (lambda one: one.channel == "C1", "no plan was carried out"),
        (lambda one: one.channel == "C3" and one.sender == "pl", "no answer came"),
    ],
)
def test_every_plan_and_the_task_must_end(pouring: Run, kind: Callable[[Spoken], bool], reason: str) -> None:
    """What was never said is missed."""
    past = _past(pouring)
    found = verdict.failure(msgspec.structs.replace(past, said=tuple(one for one in past.said if not kind(one))))
    assert found is not None
    assert reason in found


@pytest.mark.parametrize("yaw", [0.0, 0.5, math.pi / 2, -2.0])
def test_a_point_on_a_turned_table_is_on_it(yaw: float) -> None:
    """A corner of the top belongs to it, whichever way the table is turned; a point outside does not."""
    table = Pose((1.0, 2.0, 0.0), (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)))
    for reach, inside in ((0.45, True), (0.47, False)):
        x = 1.0 + reach * math.cos(yaw) - reach * math.sin(yaw)
        y = 2.0 + reach * math.sin(yaw) + reach * math.cos(yaw)
        assert verdict._stands_on(x, y, 0.775, table) is inside
        assert not verdict._stands_on(x, y, 0.9, table)


def _past(run: Run) -> history.History:
    return history.merged([understood(sample) for sample in run.samples], {})
