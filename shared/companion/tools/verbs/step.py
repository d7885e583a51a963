"""`roco step`: let the act that waits for the operator begin, have another plan made, set the level
of autonomy.
"""

import time
from typing import Annotated

import typer

from agent_runtime.core.control import SetParameter
from companion.autonomy import LEVEL, STEP, Level, Permission, Verb
from companion.design import AgentName
from companion.languages.cmd import TaskState
from companion.run_files import TaskLine
from companion.tools.verbs.hi import Hi, address
from companion.tools.verbs.talk import tell_task
from console.errors import NO, ConsoleError, UsageError
from console.fleet import operator, targets
from console.fleet.targets import Target
from console.output import Form, Format, Reply, RunDir, problems, tell

TAKEN_S = 5.0  # estimate: ta, co and hi take a step each, in milliseconds
PERIOD_S = 0.1
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

    By default nothing waits. With --autonomy confirm the running plan waits before each act, and
    those after it, until --autonomy auto; looking around at a start, and putting down what a
    cancelled plan holds, wait for nobody. A plan for which nobody comes within ten minutes fails,
    and the robot stands still.

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
    until, now = time.monotonic() + TAKEN_S, line
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
