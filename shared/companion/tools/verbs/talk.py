"""`roco say`, `cancel`, `stop`, `release`, `step`: talking to the robot, holding it, and letting
acts begin that wait for the operator.
"""

import http
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime, timedelta
from pathlib import Path
from typing import Annotated

import typer
from msgspec.structs import replace

from agent_runtime.core.control import SetParameter
from agent_runtime.io import fleet_processes
from agent_runtime.io.run_files import STOP_FILE, LinkedError
from companion.autonomy import LEVEL, STEP, Level, Permission, Verb
from companion.design import AgentName
from companion.languages.cmd import TaskState
from companion.run_files import (
    HELD,
    LET_GO,
    LONGEST_WITHIN_S,
    QUESTION,
    REFUSED,
    SLOTS_FILE,
    STOPPED,
    Say,
    TaskLine,
)
from companion.stop_words import calls_for_help, may_answer, stop_words
from companion.tools.verbs.hi import (
    HUMAN_INTERFACE,
    PERIOD_S,
    Hi,
    HiError,
    address,
    starting,
    terminal,
    when_started,
)
from console.errors import NO, ConsoleError, FleetError, NoRunError, UsageError
from console.fleet import operator, targets
from console.fleet.local import Local
from console.fleet.process_status import ENDED
from console.fleet.targets import Target
from console.output import Form, Format, Reply, RunDir, problems, tell, tell_json, tell_problem

TAKEN_S = 15.0  # estimate: co agrees within milliseconds; one that hangs is killed after 6 s
AWAY_S = 60.0  # estimate: a killed hi is back in seconds, a hung one in ten
EXECUTOR = "ex"
"""In its run folder the control loop has the stop flag mapped."""
NOT_HERE = (
    "nothing was stopped: no control loop has run at {where}; one that starts there will rest."
    " `roco stop` on the robot's own machine; from here `roco say stop` has its tasks cancelled"
)
NO_FLEET = (
    "nothing was stopped: no fleet of yours runs on this machine; stop the robot on its own"
    " machine, as the user that started it"
)


def say(
    text: Annotated[str, typer.Argument(help="The sentence, in quotes.")],
    wait: Annotated[
        bool,
        typer.Option("--wait", help="Follow it to its end; exits with 1 where it is not done."),
    ] = False,
    first: Annotated[
        bool,
        typer.Option(
            "--first", help="Before all others; the task under way is left for it, and resumed."
        ),
    ] = False,
    within: Annotated[
        float,
        typer.Option(
            help="Seconds until it should be done: earlier ones come first.",
            min=0.0,
            max=LONGEST_WITHIN_S,
        ),
    ] = 0.0,
    later: Annotated[
        float,
        typer.Option("--in", help="Seconds until it may begin.", min=0.0, max=LONGEST_WITHIN_S),
    ] = 0.0,
    at: Annotated[
        str, typer.Option(help="Time of day when it may begin, such as 15:30: the next one.")
    ] = "",
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Say a sentence to the robot, such as "pour the jar into the bowl". Exits with 1 where it is
    refused.

    It returns when the coordinator has taken the task or refused it; with --wait, when the task has
    ended. A question back exits with 1, too: answer within 30 s with `roco say yes`, `no` or the
    name of the thing.

    A word such as stop, halt, freeze or careful stops the robot at once, as `roco stop` does. A
    fleet that is starting is waited for, at most 90 s.

    Tasks run in the order in which they were said, unless you use --within or --first. With --first
    the robot leaves the task under way: it puts down what it holds, and continues that task
    afterwards. A task that begins later (--in, --at) lets others go first.

    Examples:
      roco say "pour the content of the jar into the bowl"
      roco say "take the jar" --format json
      roco say "take the jar and put it down" --wait
      roco say "look around" --first
      roco say "take the jar" --at 15:30
      roco say status
    """
    with problems(form):
        wish = Say(text, int(first), within, later or seconds_until(at, datetime.now()))
        stops = stop_words(text, _answers(text, target, run_dir))
        if stops:
            task = _stopped(text, target, run_dir, form)
        else:
            task = _said_when_started(wish, target, run_dir, form)
        if task.task:
            task = followed(lambda: Hi(address(targets.find(target, run_dir))), task, wait, form)
        tell_task(task, form)
        if task.state in (REFUSED, QUESTION, TaskState.FAILED) or (
            wait and task.state == TaskState.CANCELLED
        ):
            raise typer.Exit(NO)


def seconds_until(clock: str, now: datetime) -> float:
    """The seconds until the next such time of day, HH:MM; 0 for "". Raise UsageError for anything
    else.
    """
    if not clock:
        return 0.0
    try:
        wanted = datetime.strptime(clock, "%H:%M")
    except ValueError as error:
        raise UsageError(f"--at {clock!r} is not a time of day; write it as 15:30") from error
    return ((wanted - now.replace(year=1900, month=1, day=1)) % timedelta(days=1)).total_seconds()


def followed(hi: Callable[[], Hi], said: TaskLine, wait: bool, form: Format) -> TaskLine:
    """The task of a sentence once co has taken or refused it; with `wait` once all of the sentence
    has ended.

    Then it is the first one that was not done, or the last one. Raise HiError where co says
    nothing, or hi stays away.
    """
    task = said
    for name in (said.task, *said.then):
        task = _until(hi, name, wait, form)
        if task.state in ENDED and task.state != TaskState.DONE:
            return task
    if wait or task.state in ENDED:
        return task
    return replace(said, state=said.state if said.then else task.state)


def _until(hi: Callable[[], Hi], name: str, wait: bool, form: Format) -> TaskLine:
    """The task once it was taken or refused, or has ended; its states are told meanwhile."""
    asked = heard = time.monotonic()
    before, taken = "", False
    while True:
        try:
            task = next((line for line in hi().tasks() if line.task == name), None)
            heard = time.monotonic()
        except HiError as error:
            if error.status or time.monotonic() - heard > AWAY_S:
                raise
            task = None
        taken = taken or (task is not None and task.accepted)
        if task is not None and (task.state in ENDED or (taken and not wait)):
            return task
        if (
            task is not None
            and wait
            and form is Format.TEXT
            and (now := f"{name}  {task.state}  {task.text}") != before
        ):
            print(before := now, file=sys.stderr)
        if not taken and time.monotonic() - asked > TAKEN_S:
            late = f"the coordinator has not taken {name} within {TAKEN_S:g} s"
            words = f"{late}; it goes on when it does, or `roco cancel`"
            raise HiError(http.HTTPStatus.SERVICE_UNAVAILABLE, words)
        time.sleep(PERIOD_S)


def _answers(text: str, target: str, run_dir: Path | None) -> tuple[str, ...]:
    """The answers to what was asked in this terminal, if the text may be one, and hi says so at
    once.
    """
    if not may_answer(text):
        return ()
    try:
        return Hi(address(targets.find(target, run_dir))).answers(terminal())
    except ConsoleError:
        return ()


def _stopped(text: str, target: str, run_dir: Path | None, form: Format) -> TaskLine:
    """Stop the robot as `roco stop` does, with nobody's help; a robot elsewhere is left to its
    human interface.

    Who calls for help is told what can be said, too, if the human interface answers.
    """
    try:
        fleets = held(target, run_dir, form)
    except (ConsoleError, LinkedError) as failed:
        try:
            return Hi(address(targets.find(target, run_dir))).say(text)
        except ConsoleError:
            raise failed from None
    if calls_for_help(text):
        with suppress(ConsoleError):
            return Hi(address(fleets[0])).say(text)
    words = "\n".join(_held_words(fleets, target, run_dir).values())
    return TaskLine("", STOPPED, words, text, time.time())


def _loop_here(fleet: Target) -> bool:
    """Whether a control loop has had the stop flag of this fleet mapped, on this machine or in its
    containers.
    """
    if not isinstance(fleet, Local) or (fleet.run / SLOTS_FILE).exists():
        return True
    return bool(fleet_processes.deleted_files(fleet.run, STOP_FILE))


def _said_when_started(wish: Say, target: str, run_dir: Path | None, form: Format) -> TaskLine:
    """The task that a sentence became, once there is somebody to say it to."""

    def coming(said: ConsoleError) -> bool:
        return _without_coordinator(said) or starting(HUMAN_INTERFACE, target, run_dir)

    return when_started(lambda: _sent(wish, target, run_dir), coming, form)


def _sent(wish: Say, target: str, run_dir: Path | None) -> TaskLine | ConsoleError:
    """The task, or why nobody heard the sentence. What may have been heard is never said again."""
    try:
        hi = Hi(address(targets.find(target, run_dir)))
        hi.tasks()
    except ConsoleError as nobody:
        return nobody
    try:
        return hi.say(wish.text, wish.urgency, wish.within_s, wish.later_s)
    except HiError as error:
        if not _without_coordinator(error):
            raise
        return error


def _without_coordinator(error: ConsoleError) -> bool:
    """Whether the human interface listens, but has nobody to ask yet."""
    return isinstance(error, HiError) and error.status == http.HTTPStatus.SERVICE_UNAVAILABLE


def cancel(
    task: Annotated[
        str,
        typer.Argument(
            help="A task's name; else the oldest that has not ended.",
            autocompletion=targets.open_tasks,
        ),
    ] = "",
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Cancel a task: what is held is put down safely, then the next command is served.

    Examples:
      roco cancel
      roco cancel hi-1-3
    """
    with problems(form):
        tell_task(Hi(address(targets.find(target, run_dir))).cancel(task), form)


def stop(target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Stop the robot at once. It reaches the control loop directly and needs no agent, router or
    supervisor.

    Without --target and --run-dir it stops the robots of all fleets that run in runs/ here, or, if
    none runs here, of all your fleets on this machine. It never asks, and names your other fleets,
    which go on. It exits with 1 if no control loop runs on this machine (stop a robot of
    another machine there), and with 3 if no fleet of yours runs.

    Examples:
      roco stop
      roco stop --target second
      roco stop --run-dir runs/latest
    """
    with problems(form):
        fleets = held(target, run_dir, form)
        for where, words in _held_words(fleets, target, run_dir).items():
            tell(Reply(words, where), form)
        if not target and run_dir is None:
            for one in targets.not_held(fleets):
                go_on = f"not stopped: {one.where}; `roco stop --target {one.name}` stops it, too"
                tell_problem(go_on, form)


def release(target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Let the robot move again after `roco stop`.

    Examples:
      roco release
    """
    with problems(form):
        fleet = targets.find(target, run_dir)
        fleet.hold(EXECUTOR, False)
        tell(Reply(LET_GO, fleet.where), form)


def held(target: str, run_dir: Path | None, form: Format) -> list[Target]:
    """Hold the robots that a stop means; return their fleets. What failed is told; raise it where
    none was stopped.
    """
    stopped: list[Target] = []
    failed: list[Exception] = []
    fleets: list[Target] = []
    for fleet in targets.to_hold(target, run_dir):
        fleets.append(fleet)
        try:
            fleet.hold(EXECUTOR, True)
        except (ConsoleError, LinkedError) as error:  # the others are stopped all the same
            failed.append(error)
        except OSError as error:
            failed.append(FleetError(f"the robot of {fleet.where} was not stopped: {error}"))
        else:
            stopped += [fleet] if _loop_here(fleet) else []
    named = bool(target) or run_dir is not None
    if not named and not any(map(targets.lives, fleets)):
        raise failed[0] if failed else NoRunError("", NO_FLEET)
    if not stopped:
        where = " or ".join(one.where for one in fleets)
        raise failed[0] if failed else FleetError(NOT_HERE.format(where=where))
    for one in failed:
        tell_problem(one, form)
    return stopped


def _held_words(fleets: list[Target], target: str, run_dir: Path | None) -> dict[str, str]:
    """Say of each fleet that its robot is held, and what releases it: one that was not meant by
    name or place must be named.
    """
    meant = ""
    with suppress(ConsoleError):
        meant = targets.find(target, run_dir).where
    named = {
        one.where: HELD.replace("roco release", f"roco release --target {one.name}")
        for one in fleets
    }
    return {where: HELD if where == meant else words for where, words in named.items()}


def tell_task(task: TaskLine, form: Format) -> None:
    """Print a task."""
    if form is Format.JSON:
        tell_json(task)
    else:
        print(f"{task.task}  {task.state}  {task.text}" if task.task else task.text)


WORD_S = 5.0  # estimate: ta, co and hi take a step each, in milliseconds
ASKS = {
    Level.AUTO: "no act waits for you",
    Level.HANDLING: "acts that handle a thing wait for you",
    Level.CONFIRM: "every act waits for you",
}


class NothingWaitsError(ConsoleError):
    """No plan waits, or none runs."""

    code = NO


def step(
    autonomy: Annotated[
        Level | None,
        typer.Option(help="From now on: no act waits, those that handle a thing do, or all."),
    ] = None,
    replan: Annotated[
        bool,
        typer.Option(
            "--replan", help="End the act under way, or give up the one that waits; plan again."
        ),
    ] = False,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Let the act that waits for you begin, and no other one. Exits with 1 where none waits.

    By default no act waits. With --autonomy confirm the running plan and later ones wait before
    each act, until --autonomy auto. The first look around, and putting down what a cancelled plan
    holds, wait for nobody. If nobody comes within ten minutes, the plan fails and the robot stands
    still.

    Examples:
      roco step --autonomy confirm
      roco step
      roco step --replan
    """
    with problems(form):
        fleet = targets.find(target, run_dir)
        if autonomy is not None and replan:
            raise UsageError("--autonomy and --replan are two orders; give one after the other")
        if autonomy is not None:
            operator.order(fleet, AgentName.TA, SetParameter(LEVEL, autonomy.value))
            tell(Reply(f"autonomy {autonomy.value}: {ASKS[autonomy]}", fleet.where), form)
        else:
            tell_task(let(fleet, Verb.REPLAN if replan else Verb.GO), form)


def let(fleet: Target, verb: Verb) -> TaskLine:
    """Give the word about what waits, or is under way; the task as it is a moment later. Raise
    NothingWaitsError.
    """
    line = _running(fleet)
    at = line.asks or (line.at.id if verb is Verb.REPLAN and line.at is not None else "")
    if not at:
        beat = operator.heartbeat(fleet, AgentName.TA)
        level = Level(
            str(beat.parameters.get(LEVEL, Level.AUTO.value)) if beat is not None else Level.AUTO
        )
        raise NothingWaitsError(
            f"no act waits for you now; autonomy is {level.value}: {ASKS[level]}"
        )
    operator.order(fleet, AgentName.TA, SetParameter(STEP, str(Permission(verb, at))))
    until, now = time.monotonic() + WORD_S, line
    while (
        (now.at, now.asks) == (line.at, line.asks)
        and now.state == line.state
        and time.monotonic() < until
    ):
        time.sleep(PERIOD_S)
        now = next((one for one in Hi(address(fleet)).tasks() if one.task == line.task), now)
    return now


def _running(fleet: Target) -> TaskLine:
    """The task whose plan runs. Raise NothingWaitsError where none does."""
    tasks = Hi(address(fleet)).tasks()
    line = next((one for one in tasks if one.state == TaskState.RUNNING), None)
    if line is None:
        raise NothingWaitsError("no plan runs now; `roco status` shows the tasks")
    return line
