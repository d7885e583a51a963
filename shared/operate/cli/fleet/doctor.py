"""`roco doctor`: what is wrong and what to do, check by check."""

from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec
import typer
from rich.text import Text

from operate.cli.errors import NO, ConsoleError
from operate.cli.fleet import targets
from operate.cli.fleet.checkup import FLEET, MACHINE, Check, Checks, Level
from operate.cli.fleet.targets import Target
from operate.cli.output import Form, Format, RunDir, problems, tell_json, waiting
from operate.cli.terminal.console import Console
from operate.cli.terminal.table import table
from operate.system import NoSystemError, UntrustedError, here

MARKS = {Level.FINE: ("✓", "green"), Level.NOTE: ("i", "yellow"), Level.WRONG: ("✗", "bold red")}


class Diagnosis(msgspec.Struct, frozen=True):
    """`roco doctor --format json`."""

    where: str
    wrong: int
    checks: tuple[Check, ...]


def doctor(target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Check machine, installation and fleet: what is wrong, why, and what to do. Exits with 1 where something is.

    Examples:
      roco doctor
      roco doctor --format json
      roco doctor --target compose
    """
    with problems(form):
        fleet, reason = found(target, run_dir)
        with waiting("checking", form) as say:
            checks = tuple(examined(fleet, reason, say))
        wrong = sum(check.level is Level.WRONG for check in checks)
        if form is Format.JSON:
            tell_json(Diagnosis(fleet.where if fleet else "", wrong, checks))
        else:
            show(checks, Console())
        if wrong:
            raise typer.Exit(NO)


def found(target: str, run_dir: Path | None) -> tuple[Target | None, str]:
    """The fleet that is meant; without one only machine and installation are checked, unless it was named."""
    try:
        return targets.find(target, run_dir), ""
    except ConsoleError as error:
        if target or run_dir is not None:
            raise
        return None, str(error)


def examined(fleet: Target | None, reason: str, say: Callable[[str], None]) -> Iterator[Check]:
    """The checks one after the other."""
    own = _own(fleet)
    for name, check in (MACHINE | own.machine).items():
        say(f"checking {name}")
        yield from check()
    if fleet is None:
        yield Check("fleet", Level.NOTE, reason)
        return
    now = fleet.look()
    for name, of_fleet in (FLEET | own.fleet).items():
        say(f"checking {name}")
        yield from of_fleet(fleet, now)


def _own(fleet: Target | None) -> Checks:
    """Return the checks added by the system of a fleet, or else of this folder; none if there is no system. Raise
    UntrustedError where the system is there, and others can change its code.
    """
    try:
        found: Checks | None = (fleet.system if fleet is not None else here()).addition("checks")
    except UntrustedError:
        raise
    except NoSystemError:
        return Checks()
    return found or Checks()


def show(checks: tuple[Check, ...], console: Console) -> None:
    """A row for each: what is, and below it what to do."""
    rows = []
    for check in checks:
        mark, style = MARKS[check.level]
        what = Text(check.what, style if check.level is Level.WRONG else "")
        if check.remedy:
            what.append(f"\n→ {check.remedy}", "not bold cyan")
        rows.append((Text(mark, style), Text(check.name, "bold"), what))
    console.print(table(("mark", "name", "what"), rows, fold=("what",), show_header=False))
    wrong = sum(check.level is Level.WRONG for check in checks)
    console.print(f"{wrong} of {len(checks)} checks found something wrong" if wrong else "nothing is wrong")
