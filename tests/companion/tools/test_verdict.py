"""Table of runs that did the main job or not: one thing changed at a time."""

import math
from collections.abc import Callable

import msgspec
import pytest
import synthetic
from msgspec.structs import replace

from companion.languages import cmd, hfsm, rc, sw
from companion.languages.facts import Kind, fact
from companion.languages.values import Pose, Side
from companion.tasks.pour.command import PourInto
from companion.tasks.pour.verdict import _stands_on, poured
from companion.tasks.put_down.command import PutDown
from companion.tasks.take.command import Take
from companion.telemetry import TrueState
from companion.tools.report import events, page, plans, report, verdict
from companion.tools.system import SYSTEM
from companion.tools.telemetry import every
from fipa_codec.performatives import Performative as P
from operate.file_names import FLEET_FILE
from operate.fleet_file import Fleet, ProcessState, ProcessStatus
from operate.recording import history
from operate.recording.records import understood
from operate.recording.run import Run as RecordedRun

Change = Callable[[TrueState], TrueState]

NO_TRUTH = "the true state of the simulation was not recorded at the end of the task"


def changed(**fields):
    """The truth with other fields."""
    return lambda truth: replace(truth, **fields)


TRUTHS = [
    ("as it should be", changed(), None),
    ("nine tenths", changed(grains_in={"jar_1": 3, "bowl_1": 27}), None),
    ("less than nine tenths", changed(grains_in={"jar_1": 4, "bowl_1": 26}), "87% of the content"),
    ("tilted a little", changed(tilt_deg={"jar_1": 0.0, "bowl_1": 9.9}), None),
    ("tilted", changed(tilt_deg={"jar_1": 0.0, "bowl_1": 10.0}), "tilted by 10 degrees"),
    (
        "jar dropped",
        changed(fingers_on={"jar_1": {"left": 0, "right": 0}, "bowl_1": {}}),
        "no hand holds the jar",
    ),
    (
        "jar in the other hand",
        changed(fingers_on={"jar_1": {"left": 0, "right": 5}, "bowl_1": {}}),
        None,
    ),
    (
        "bowl held",
        changed(fingers_on={"jar_1": {"left": 4}, "bowl_1": {"right": 3}}),
        "touches the bowl",
    ),
    (
        "bowl on the floor",
        changed(at={"jar_1": (0.0, 0.0, 1.0), "bowl_1": (0.58, -0.52, 0.0)}),
        "not on a table",
    ),
    (
        "bowl beside",
        changed(at={"jar_1": (0.0, 0.0, 1.0), "bowl_1": (0.0, -0.1, 0.775)}),
        "not on a table",
    ),
    ("no grains", changed(grains=0), "how much is in the bowl"),
]


@pytest.mark.parametrize(
    ("change", "reason"), [case[1:] for case in TRUTHS], ids=[case[0] for case in TRUTHS]
)
def test_success_by_the_truth(pouring, change, reason):
    """Success is no reason against it; a failure names what was wrong."""
    past = _past(pouring)
    past = synthetic.with_truth(
        past, tuple((at, change(one)) for at, one in every(past, TrueState))
    )
    found = verdict.failure(past)
    assert found is None if reason is None else found is not None and reason in found


def test_without_the_truth_there_is_no_success(pouring):
    """Nothing is assumed."""
    past = synthetic.with_truth(_past(pouring), ())
    assert verdict.failure(past) == NO_TRUTH


@pytest.mark.parametrize("before_s", [0.9, 1.1])
def test_a_truth_from_before_the_end_of_the_task_is_none(pouring, before_s):
    """A monitor that slept while it was poured has seen a jar that was full."""
    past = _past(pouring)
    command = plans.task_command(past)
    end = command and plans.task_end(past, command)
    assert end
    past = synthetic.with_truth(past, ((end.received - before_s, every(past, TrueState)[-1][1]),))
    assert verdict.failure(past) == (None if before_s < 1.0 else f"{NO_TRUTH}, only at other times")
    assert (poured(past, command).fraction is None) == (before_s > 1.0)


def put_down(run):
    """The person has the jar put down after the pour, and the content is tipped out of the bowl
    meanwhile.
    """
    talk = run.name("hi")
    run.say("hi", "co", P.REQUEST, PutDown("jar"), talk=talk, protocol="request")
    asked = hfsm.GroundTaskNetwork(f"{talk}-plan1", (hfsm.Task("put_down", ("jar",)),))
    release = rc.Release("r2", Side.LEFT, "jar_1", "table_1", Pose(synthetic.BOWL_END), ())
    plan = run.planning(asked, 3, synthetic.put(release), 0.3)
    run.running(plan, sw.WorkerState.SUCCEEDED, {"Release": 4.0})
    run.say("co", "hi", P.INFORM, cmd.TaskReport(cmd.TaskState.DONE), talk=talk, protocol="request")
    run.inside = {"jar_1": 0, "bowl_1": 0}
    run.wait(2.0)


def test_a_pour_is_judged_at_its_own_end():
    """What is asked for afterwards changes nothing: no hand holds the jar then, and the bowl is
    empty.
    """
    run = synthetic.pour(queries=5)
    put_down(run)
    past = _past(run)
    assert not every(past, TrueState)[-1][1].fingers_on["jar_1"]["left"]
    told = report.build(past)
    assert (told.success, told.failure) == (True, None)
    assert told.poured_fraction == pytest.approx(29 / 30)
    asked = [("pour into jar bowl", "done", True), ("put down jar", "done", True)]
    assert [(one.asked, one.outcome, one.success) for one in told.tasks] == asked


def test_each_pour_of_a_run_has_its_own_verdict():
    """A second one whose bowl is empty at its end fails, and the first one stays a success."""
    run = synthetic.pour(queries=5)
    put_down(run)
    talk = run.name("hi")
    run.say("hi", "co", P.REQUEST, PourInto("jar", "bowl"), talk=talk, protocol="request")
    run.say("co", "hi", P.INFORM, cmd.TaskReport(cmd.TaskState.DONE), talk=talk, protocol="request")
    run.wait(1.0)
    told = report.build(_past(run))
    assert told.success
    assert [one.success for one in told.tasks] == [True, True, False]
    assert "0% of the content is in the bowl" in str(told.tasks[2].failure)


def test_a_recorder_that_was_away_at_the_end_tells_what_it_heard_before_the_next_act():
    """The world stands still until the robot acts; after that the truth is of another moment."""
    run = synthetic.pour(queries=5)
    put_down(run)
    past = _past(run)
    command = plans.task_command(past)
    end = command and plans.task_end(past, command)
    assert end
    moved = next(act.start for act in plans.acts(past) if act.start > end.received)
    heard = tuple(one for one in every(past, TrueState) if one[0] > end.received)
    assert verdict.failure(synthetic.with_truth(past, heard)) is None
    late = tuple(one for one in heard if one[0] > moved)
    found = verdict.failure(synthetic.with_truth(past, late))
    assert found == f"{NO_TRUTH}, only at other times"


def test_tables_are_where_km_was_told_when_the_truth_does_not_say(pouring):
    """A truth without poses is judged by observed tables."""
    past = _past(pouring)
    at, last = every(past, TrueState)[-1]
    bare = replace(last, poses={}, models={})
    assert verdict.failure(synthetic.with_truth(past, ((at, bare),))) is None


@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        (
            lambda one: isinstance(one.content, sw.Report) and one.content.state in sw.FINAL,
            "plan 1 did not end",
        ),
        (
            lambda one: isinstance(one.content, cmd.TaskReport) and one.performative == "inform",
            "task did not end",
        ),
        (lambda one: isinstance(one.content, cmd.Command), "no command"),
        (lambda one: one.channel == "C1", "no plan was carried out"),
        (lambda one: one.channel == "C3" and one.sender == "pl", "no answer came"),
    ],
)
def test_every_plan_and_the_task_must_end(pouring, kind, reason):
    """A communicate that was never said is missed."""
    past = _past(pouring)
    found = verdict.failure(replace(past, said=tuple(one for one in past.said if not kind(one))))
    assert found is not None
    assert reason in found


def aside(run, command, *, agreed):
    """Say another command, which comes to nothing: co refuses it, or pl finds no plan for it. Its
    conversation.
    """
    talk, network = run.name("hi"), run.name("co")
    run.say("hi", "co", P.REQUEST, command, talk=talk, protocol="request")
    if agreed:
        waiting = cmd.TaskReport(cmd.TaskState.WAITING, (fact(Kind.IS_NEXT),))
        run.say("co", "hi", P.AGREE, waiting, talk=talk, protocol="request")
        asked = hfsm.GroundTaskNetwork(f"{talk}-plan1", (hfsm.Task("take", ("cup", "")),))
        run.say("co", "pl", P.REQUEST, asked, talk=network, protocol="request")
        refusal = hfsm.NoPlan(asked.id, (fact(Kind.NOT_SEEN, "cup"),))
        run.say("pl", "co", P.REFUSE, refusal, talk=network, protocol="request")
        failed = cmd.TaskReport(cmd.TaskState.FAILED, (fact(Kind.NOT_SEEN, "cup"),))
        run.say("co", "hi", P.INFORM, failed, talk=talk, protocol="request")
    else:
        busy = cmd.TaskReport(cmd.TaskState.FAILED, (fact(Kind.TASKS_OPEN, 1),))
        run.say("co", "hi", P.REFUSE, busy, talk=talk, protocol="request")
    return talk


@pytest.mark.parametrize("agreed", [False, True])
@pytest.mark.parametrize("command", [Take("cup"), PourInto("cup", "bowl")])
def test_another_command_that_comes_to_nothing_is_no_failure(command, agreed):
    """The content is in the bowl; what else was asked for is told beside it, by its own name."""
    run = synthetic.pour(queries=5)
    aside(run, command, agreed=agreed)
    past = _past(run)
    assert verdict.failure(past) is None
    told = {event.name: event.text for event in events.events(past)}
    name = ("ended", "failed") if agreed else ("refused",)
    assert told[" ".join((*name, *plans.asked_of(plans.commands(past)[-1])))]
    assert told["finished"]
    assert [bar.end >= bar.start for bar in page.bars(past)].count(False) == 0
    assert sum("refused" in text for bar in page.bars(past) for text in bar.texts) == 0


def test_a_plan_of_the_job_that_is_refused_stays_a_failure():
    """Also while other commands are refused."""
    run = synthetic.pour(queries=5)
    aside(run, Take("cup"), agreed=False)
    past = _past(run)
    kept = tuple(one for one in past.said if not (one.channel == "C3" and one.sender == "pl"))
    assert "no answer came" in str(verdict.failure(replace(past, said=kept)))


def test_a_plan_that_was_put_off_is_no_plan():
    """The robot looked around first: the request that came to a plan is the first one, and the pour
    is a success.
    """
    run = synthetic.pour(queries=5)
    before = _past(run)
    first = next(one for one in before.said if isinstance(one.content, hfsm.GroundTaskNetwork))
    talk = run.name("co")
    run.say("co", "pl", P.REQUEST, first.content, talk=talk, protocol="request")
    off = hfsm.NoPlan(first.content.id, (fact(Kind.LOOK_NOT_OVER),), later=True)
    run.say("pl", "co", P.FAILURE, off, talk=talk, protocol="request")
    past = _past(run)
    assert verdict.failure(past) is None
    assert [plan.number for plan in plans.made(past)] == [
        plan.number for plan in plans.made(before)
    ]


def test_a_refused_pour_before_the_one_that_was_done_is_not_the_job():
    """The report is of the command that was taken."""
    run = synthetic.pour(queries=5)
    talk = aside(run, PourInto("jar", "bowl"), agreed=False)
    past = _past(run)
    first = tuple(one for one in past.said if one.conversation == talk)
    past = replace(past, said=(*first, *(one for one in past.said if one not in first)))
    assert verdict.failure(past) is None
    alone = replace(past, said=first)
    assert str(verdict.failure(alone)).startswith("the task ended, refused: busy")


def test_a_fleet_that_did_not_come_up_names_who_is_to_blame(tmp_path):
    """Of processes that were needed; instead of what follows from it."""
    state = ProcessState
    why = "ended with code 2: loop: scene: file is none"
    processes = (
        ProcessStatus("router", state.STOPPED),
        ProcessStatus("loop", state.GIVEN_UP, note=why),
        ProcessStatus("monitor", state.GIVEN_UP, note="no room", optional=True),
    )
    whole = Fleet("roco", "", 7, 0.0, processes)
    (tmp_path / FLEET_FILE).write_bytes(msgspec.json.encode(whole))
    blamed = "loop did not run (given-up: ended with code 2: loop: scene: file is none)"
    assert verdict.failure(RecordedRun(tmp_path, SYSTEM).history) == blamed
    (tmp_path / FLEET_FILE).unlink()
    failure = verdict.failure(RecordedRun(tmp_path, SYSTEM).history)
    assert failure == "no command of a person was heard"


def test_a_job_that_was_done_is_done_whoever_died_then(pouring):
    """A process that is away in the end is a cause only where something failed."""
    dead = (ProcessStatus("km", ProcessState.BACKING_OFF, note="killed by signal 9"),)
    past = replace(_past(pouring), down=dead)
    assert verdict.failure(past) is None
    past = synthetic.with_truth(past, ())
    assert str(verdict.failure(past)).startswith(
        "km did not run (backing-off: killed by signal 9); "
    )


def _past(run):
    return history.of_records([understood(sample, SYSTEM) for sample in run.samples], SYSTEM)


# --- Parts of the verdict on a pour; that of whole runs is tested with the report
# (tests/companion/tools)


@pytest.mark.parametrize("yaw", [0.0, 0.5, math.pi / 2, -2.0])
def test_a_point_on_a_turned_table_is_on_it(yaw):
    """A corner of the top belongs to it, whichever way the table is turned; a point outside does
    not.
    """
    table = Pose((1.0, 2.0, 0.0), (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)))
    for reach, inside in ((0.45, True), (0.47, False)):
        x = 1.0 + reach * math.cos(yaw) - reach * math.sin(yaw)
        y = 2.0 + reach * math.sin(yaw) + reach * math.cos(yaw)
        assert _stands_on(x, y, 0.775, "table", table) is inside
        assert not _stands_on(x, y, 0.9, "table", table)
