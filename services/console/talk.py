"""`roco say`, `cancel`, `stop`, `release`: talking to the robot, and holding it."""

from pathlib import Path
from typing import Annotated

import typer

from companion.run_folder import TaskLine
from services.console import targets
from services.console.forms import Form, Format, Reply, RunDir, problems, tell, tell_json
from services.console.hi import Hi


def say(
    text: Annotated[str, typer.Argument(help="The sentence, in quotes.")],
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Say a sentence to the robot, such as "pour the jar into the bowl". Exits with 1 where it is refused.

    Examples:
      roco say "pour the content of the jar into the bowl"
      roco say "take the jar" --format json
      roco say status
    """
    with problems(form):
        task = Hi(targets.find(target, run_dir).hi()).say(text)
        tell_task(task, form)
        if task.state == "refused":
            raise typer.Exit(1)


def cancel(
    task: Annotated[str, typer.Argument(help="A task's name; else the oldest that has not ended.")] = "",
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
        tell_task(Hi(targets.find(target, run_dir).hi()).cancel(task), form)


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
        fleet.hold(held)
        tell(Reply(words, fleet.where), form)


def tell_task(task: TaskLine, form: Format) -> None:
    """Print a task."""
    if form is Format.JSON:
        tell_json(task)
    else:
        print(f"{task.task}  {task.state}  {task.text}" if task.task else task.text)
