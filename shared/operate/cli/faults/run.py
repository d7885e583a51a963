"""`roco fault run FILE --seed N`: a scenario, each fault of it a `roco fault` of its own, so that each heals itself."""

import contextlib
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Annotated

import typer

from operate.cli import interrupts
from operate.cli.errors import FleetError
from operate.cli.faults import inflict, moments, scenario
from operate.cli.faults.verbs import heal_left
from operate.cli.fleet import targets
from operate.cli.fleet.agent import named
from operate.cli.fleet.targets import Target
from operate.cli.output import Form, Format, RunDir, problems

HEAL_S = 100.0
"""Time to wait for the end of an interrupted fault [s]: a process may take 90 s to come back."""


def run(
    file: Annotated[Path, typer.Argument(exists=True, dir_okay=False, help="A scenario (TOML).")],
    seed: Annotated[int, typer.Option(min=0, help="Chooses what the scenario leaves open.")] = 1,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Do the faults of a scenario, and wait until all are over; the same seed does the same.

    Exits with 1 where one did not begin, or a process did not come back. JSON has a fault a line.

    Examples:
      roco fault run faults.toml
      roco fault run faults.toml --seed 7
    """
    with problems(form), interrupts.heard():
        fleet = targets.find(target, run_dir)
        inflict.refuse(fleet)
        chosen = scenario.choose(scenario.load(file), seed)
        _look(fleet, chosen)
        place = [*(["--target", target] if target else []), *(["--run-dir", str(run_dir)] if run_dir else [])]
        heal_left(fleet, form)
        codes = _done([[*words, *place, "--format", form.value] for words in _words(chosen)])
        if failed := sum(code != 0 for code in codes):
            raise FleetError(f"{failed} of {len(codes)} faults did not go as they should; `roco fault list` has them")


def _look(fleet: Target, chosen: tuple[scenario.Chosen, ...]) -> None:
    """Raise UsageError before anything is done: a process or a moment that is not there."""
    for one in chosen:
        named(fleet, inflict.ends(fleet, one.target)[0])
        if isinstance(one.at, str):
            moments.parse(one.at, fleet.system.design, one.target)


def _words(chosen: tuple[scenario.Chosen, ...]) -> list[list[str]]:
    began = time.time()
    return [scenario.words(one, began) for one in chosen]


def _done(calls: list[list[str]]) -> list[int]:
    """Call `roco fault` with each of these, side by side; their exit codes. Ctrl-C ends them, each heals."""
    with contextlib.ExitStack() as all_of_them:
        children = [all_of_them.enter_context(_child(words)) for words in calls]
        try:
            return [child.wait() for child in children]
        except KeyboardInterrupt:
            for child in children:
                child.send_signal(signal.SIGINT)
            for child in children:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    child.wait(HEAL_S)
            raise


def _child(words: list[str]) -> "subprocess.Popen[bytes]":
    return subprocess.Popen([sys.executable, "-P", "-m", "operate.cli", "fault", *words], stdin=subprocess.DEVNULL)
