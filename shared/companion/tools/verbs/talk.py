"""`roco say`, `cancel`, `stop`, `release`: talking to the robot, and holding it."""

import http
import sys
import time
from pathlib import Path
from typing import Annotated

import typer

from companion.run_files import TaskLine
from companion.tools.verbs.hi import Hi, HiError, address
from companion.tools.verbs.human_interface_start import starting
from operate.cli.errors import ConsoleError
from operate.cli.fleet import living_names, targets
from operate.cli.output import Form, Format, Reply, RunDir, problems, tell, tell_json

STARTING_S = 90.0  # as long as `roco up` waits
PERIOD_S = 0.2  # estimate: nobody notices
EXECUTOR = "ex"
"""In its run folder the control loop has the stop flag mapped."""


def say(
    text: Annotated[str, typer.Argument(help="The sentence, in quotes.")],
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Say a sentence to the robot, such as "pour the jar into the bowl". Exits with 1 where it is refused.

    A fleet that is starting is waited for, at most 90 s.

    Examples:
      roco say "pour the content of the jar into the bowl"
      roco say "take the jar" --format json
      roco say status
    """
    with problems(form):
        task = _said_when_started(text, target, run_dir, form)
        tell_task(task, form)
        if task.state == "refused":
            raise typer.Exit(1)


def _said_when_started(text: str, target: str, run_dir: Path | None, form: Format) -> TaskLine:
    """The task that a sentence became, once there is somebody to say it to."""
    until = 0.0
    while True:
        said = _said(text, target, run_dir)
        if isinstance(said, TaskLine):
            return said
        if not (_without_coordinator(said) or starting(target, run_dir)):
            raise said
        if not until:
            until = time.monotonic() + STARTING_S
            if form is Format.TEXT:
                print(f"roco: the fleet is starting; waiting for it, at most {STARTING_S:.0f} s", file=sys.stderr)
        elif time.monotonic() > until:
            words = f"the fleet is still starting after {STARTING_S:.0f} s; see `roco status` ({said})"
            raise HiError(0, words) from said
        time.sleep(PERIOD_S)


def _said(text: str, target: str, run_dir: Path | None) -> TaskLine | ConsoleError:
    """The task, or why nobody heard the sentence. What may have been heard is never said again."""
    try:
        hi = Hi(address(targets.find(target, run_dir)))
        hi.tasks()
    except ConsoleError as nobody:
        return nobody
    try:
        return hi.say(text)
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
            help="A task's name; else the oldest that has not ended.", autocompletion=living_names.open_tasks
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
    """Stop the robot at once. It reaches the control loop directly and needs no agent, router or supervisor.

    Examples:
      roco stop
      roco stop --run-dir runs/latest
    """
    flag(target, run_dir, True, "stopped: the loop holds the robot until `roco release`", form)


def release(target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Let the robot move again after `roco stop`.

    Examples:
      roco release
    """
    flag(target, run_dir, False, "released: the loop leaves the stop by its own rules", form)


def flag(target: str, run_dir: Path | None, held: bool, words: str, form: Format) -> None:
    """Write the stop flag and say so."""
    with problems(form):
        fleet = targets.find(target, run_dir)
        fleet.hold(EXECUTOR, held)
        tell(Reply(words, fleet.where), form)


def tell_task(task: TaskLine, form: Format) -> None:
    """Print a task."""
    if form is Format.JSON:
        tell_json(task)
    else:
        print(f"{task.task}  {task.state}  {task.text}" if task.task else task.text)
