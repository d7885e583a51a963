"""`roco runs remove`: runs taken away by name or by rule, with what that frees. Never one that is up."""

import re
import shutil
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from operate.cli import completion
from operate.cli.errors import ConsoleError, UsageError
from operate.cli.output import Form, Format, problems, tell_json
from operate.cli.runs import catalogue, folders
from operate.cli.runs.catalogue import In, Run
from operate.run_folder import LATEST

UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0, "w": 7 * 86400.0}


class Rule(msgspec.Struct, frozen=True):
    """Rule that chooses runs to remove. All conditions given must hold; `keep`: the newest of those stay. `age_s`:
    since their begin.
    """

    names: frozenset[str] = frozenset()
    age_s: float | None = None
    keep: int | None = None
    failed: bool = False

    def __bool__(self) -> bool:
        """Whether anything is given: nothing goes without a rule."""
        return self != Rule()

    def chosen(self, found: Iterable[Run], now: float) -> list[Run]:
        """Return those that go, newest first; one that is up never does."""
        newest = sorted(found, key=lambda one: one.begin, reverse=True)
        return [one for one in newest[self.keep or 0 :] if not one.up and self._meets(one, now)]

    def _meets(self, one: Run, now: float) -> bool:
        return (
            (not self.names or one.name in self.names)
            and (self.age_s is None or now - one.begin > self.age_s)
            and (one.failed or not self.failed)
        )


class Removed(msgspec.Struct, frozen=True):
    """`--format json`: the runs that went, or with `dry_run` would go, and the bytes that this frees."""

    removed: tuple[Run, ...]
    bytes: int
    dry_run: bool


def remove(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="[NAME]...", help="Runs.", autocompletion=completion.run_names)
    ] = None,
    older_than: Annotated[
        str, typer.Option(help="Those that began longer ago: 12h, 7d, 2w.", autocompletion=completion.ages)
    ] = "",
    keep: Annotated[int | None, typer.Option(min=0, help="Let the newest N stay.")] = None,
    failed: Annotated[bool, typer.Option("--failed", help="Those that failed.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would go, and remove nothing.")] = False,
    within: In = folders.RUNS,
    form: Form = Format.TEXT,
) -> None:
    """Remove runs by name or by rule, never one that is up.

    Names and rules given together narrow each other: a run goes if all of them fit. --keep counts all runs, those that
    are up, too. Where runs/latest pointed to a run that went, the link goes with it.

    Examples:
      roco runs remove --older-than 7d --keep 10 --dry-run
      roco runs remove --failed
      roco runs remove 2026-01-31_12-00-00
    """
    with problems(form):
        found = catalogue.catalogue(within)
        rule = Rule(_named(names or [], found, within), age(older_than) if older_than else None, keep, failed)
        if not rule:
            raise UsageError("name runs, or give a rule: --older-than 7d, --keep N, --failed")
        chosen = rule.chosen(found, time.time())
        gone = tuple(one for one in chosen if dry_run or _removed(within / one.name))
        done = Removed(gone, sum(one.bytes for one in gone), dry_run)
        if form is Format.JSON:
            tell_json(done)
        else:
            print(sentence(done))


def age(text: str) -> float:
    """Return a duration such as 90s, 30min, 12h, 7d, 2w in seconds. Raise UsageError for another text."""
    found = re.fullmatch(r"(\d+(?:\.\d+)?)([a-z]+)", text)
    if found is None or found[2] not in UNITS:
        raise UsageError(f"--older-than {text} is not a duration; write a number and one of {', '.join(UNITS)}: 7d")
    return float(found[1]) * UNITS[found[2]]


def sentence(done: Removed) -> str:
    """Return which runs go and what that frees, for people."""
    if not done.removed:
        return "no run is removed: none fits, or those that do are up"
    count, frees = len(done.removed), catalogue.words_of(list(done.removed))
    what = f"{count} run{'s' * (count != 1)}"
    lines = [f"{'would remove' if done.dry_run else 'removed'} {one.name}" for one in done.removed]
    return "\n".join([*lines, f"{what}; {'would free' if done.dry_run else 'freed'} {frees}"])


def _named(names: list[str], found: list[Run], within: Path) -> frozenset[str]:
    """Return names of runs, `latest` and paths resolved. Raise UsageError for one that is not there or is up."""
    known, meant = {one.name: one for one in found}, set()
    for text in names:
        name = (within / LATEST).resolve().name if text == LATEST else Path(text).name
        if name not in known:
            there = f"; there are {', '.join(known)}" if known else ""
            raise UsageError(f"{within} has no run {text!r}{there}")
        if known[name].up:
            raise UsageError(f"{name} is up ({known[name].why}); `roco down --run-dir {within / name}` ends it first")
        meant.add(name)
    return frozenset(meant)


def _removed(folder: Path) -> bool:
    """Remove a run; whether it went: one that came up meanwhile stays. Raise ConsoleError where it cannot be."""
    if catalogue.living(folder, folders.fleet(folder)):
        return False
    link = folder.parent / LATEST
    pointed = link.is_symlink() and link.resolve() == folder.resolve()
    try:
        shutil.rmtree(folder)
        if pointed:
            link.unlink()
    except OSError as error:
        raise ConsoleError(
            f"{folder} cannot be removed ({error}); look at its rights, or remove it yourself"
        ) from error
    return True
