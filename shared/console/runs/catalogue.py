"""`roco runs`: the runs that were kept in a folder, with begin, duration, size on disk, system and
result.

A run is a folder with one of the files that only a fleet or its recorder writes; other folders are
nobody's business here, so that `roco runs --remove` cannot take them.
"""

import os
import re
import shutil
import socket
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Annotated

import msgspec
from rich.padding import Padding
from rich.segment import Segment, Segments
from rich.text import Text

from console import completion
from console.errors import ConsoleError, NoRunError, UsageError
from console.output import Form, Format, argument, option, tell
from console.runs import folders
from console.terminal.console import Cell, Console, table
from operate.file_names import FLEET_FILE, LATEST, REPORT_FILE, STEPS, TRAFFIC_FILE
from operate.fleet_file import Fleet, ProcessState
from operate.wording import bytes_in_words

MARKS = (FLEET_FILE, TRAFFIC_FILE, REPORT_FILE, STEPS)
"""A folder with one of these is a run."""
UP, SUCCESS, FAILED, ENDED, UNKNOWN = "up", "success", "failed", "ended", "unknown"
COLOURS = {UP: "green", SUCCESS: "green", FAILED: "red"}
BLOCK = 512
"""Bytes of a unit of st_blocks (man 2 stat)."""
HEADS = ("run", "begin", "took", "on disk", "system", "result")
RIGHT = ("took", "on disk")
WIDE = 100
"""Columns that all heads need (counted)."""
BELOW = (0, 0, 0, 4)
"""Blanks around what stands below a run: top, right, bottom, left."""
ENDS = ("done", "failed", "cancelled", "refused", "not ended")
"""What may become of a task, in the order in which it is told."""
ANSWER_S = 0.5
In = Annotated[Path, option("Folder of the runs.", "--in", file_okay=False)]


class Task(msgspec.Struct, frozen=True):
    """A task of a run, as its report has it: what was `asked` for, and whether it was done;
    `failure`: why not; `outcome`: what the system itself said of its end, "" if it did not end.
    """

    asked: str
    success: bool
    failure: str | None = None
    outcome: str = "failed"

    @property
    def became(self) -> str:
        """One of ENDS. What was not done failed, whatever was said of it, unless a person or the
        system had it not done.
        """
        if self.success:
            return "done"
        if not self.outcome:
            return "not ended"
        return self.outcome if self.outcome in ("cancelled", "refused") else "failed"


class Run(msgspec.Struct, frozen=True):
    """A run. `begin` [unix s]; `duration_s` None: no fleet tells; `bytes` on disk; `why` it failed,
    or what is up.

    `tasks`: those that its report has; a report is made when the fleet ends.
    """

    name: str
    begin: float
    duration_s: float | None
    bytes: int
    system: str
    result: str
    why: str = ""
    latest: bool = False
    tasks: tuple[Task, ...] = ()

    @property
    def up(self) -> bool:
        """Whether something of it runs, so that its folder must stay."""
        return self.result == UP

    @property
    def failed(self) -> bool:
        """Whether its result is a failure."""
        return self.result == FAILED


class _Report(msgspec.Struct, frozen=True):
    """The fields used of report.json."""

    success: bool | None = None
    failure: str | None = ""
    tasks: tuple[Task, ...] = ()

    @property
    def done(self) -> bool:
        """Whether the run did what was asked of it: the system's own job, or each task where that
        job was not asked.
        """
        return bool(self.success or (self.tasks and all(one.success for one in self.tasks)))


def runs(
    names: Annotated[
        list[str] | None,
        argument("Names of runs.", complete=completion.run_names, metavar="[NAME]..."),
    ] = None,
    older_than: Annotated[
        str, option("Runs that began longer ago, such as 12h, 7d, 2w.", complete=completion.ages)
    ] = "",
    keep: Annotated[int | None, option("All runs but the newest N.", min=0)] = None,
    failed: Annotated[bool, option("Runs that failed.", "--failed")] = False,
    remove: Annotated[
        bool, option("Remove these runs, but never one that is up.", "--remove")
    ] = False,
    within: In = folders.RUNS,
    form: Form = Format.TEXT,
) -> None:
    """List the runs that were kept: begin, duration, size on disk, system, result.

    A run `failed` if its report says so, if a process of it was given up, or if its processes died
    before an orderly end. A system without a verdict of its own has `ended`. Below a run stand the
    reason, the number of tasks by outcome, and each task with its outcome. Exits with 3 if there
    is no run.

    If you combine names and rules, only runs that match all of them are listed. --keep counts all
    runs, also those that are up. --remove removes the runs that would be listed, but never one
    that is up.

    Examples:
      roco runs
      roco runs --in experiments/pour/runs --format json
      roco runs --older-than 7d --keep 10
      roco runs --failed --remove
      roco runs 2026-01-31_12-00-00 --remove
    """
    found, age_s = catalogue(within), age(older_than) if older_than else None
    rule = Rule(_named(names or [], found, within, remove), age_s, keep, failed)
    if remove:
        _remove(rule, found, within, form)
        return
    chosen = rule.chosen(found, time.time()) if rule else found
    if chosen or form is Format.JSON:
        tell(chosen, form, lambda: _show(chosen, Console()))
    elif found:
        print("no run fits")
    if not found:
        none = f"no run is in {within}; `roco up` starts one, --in names another folder"
        raise NoRunError(str(within), none)


def catalogue(within: Path) -> list[Run]:
    """Return the runs of a folder, newest first; a run is what a fleet or its recorder wrote to."""
    here = (path for path in within.glob("*") if path.is_dir() and not path.is_symlink())
    places = [path for path in here if any((path / name).exists() for name in MARKS)]
    return sorted(map(described, places), key=lambda one: (one.begin, one.name), reverse=True)


def described(folder: Path) -> Run:
    """Return what is known of a run."""
    told = folders.fleet(folder)
    report = folders.read(folder / REPORT_FILE, _Report) or _Report()
    result, why = outcome(folder, told, report)
    end = time.time() if result == UP else (folder / FLEET_FILE).stat().st_mtime if told else None
    latest = folder.parent / LATEST
    return Run(
        name=folder.name,
        begin=told.started if told else _named_time(folder),
        duration_s=round(max(0.0, end - told.started), 1) if told and end else None,
        bytes=size(folder),
        system=told.system if told else "",
        result=result,
        why=why,
        latest=latest.is_symlink() and latest.resolve() == folder.resolve(),
        tasks=report.tasks,
    )


def outcome(folder: Path, told: Fleet | None, report: _Report) -> tuple[str, str]:
    """Return the result of a run, and why it failed or what of it is up."""
    if up := living(folder, told):
        return UP, up
    if report.success is not None:
        return (SUCCESS, "") if report.done else (FAILED, report.failure or "")
    if told is None:
        return UNKNOWN, ""
    if broken := [one.name for one in told.processes if one.state is ProcessState.GIVEN_UP]:
        return FAILED, f"given up: {', '.join(broken)}"
    left = any(one.state is not ProcessState.STOPPED for one in told.processes)
    return (FAILED, "its processes died without an end in order") if left else (ENDED, "")


def living(folder: Path, told: Fleet | None) -> str:
    """Return what of a run is up, in words; "" where nothing is."""
    for one in folders.living_among(folder):
        kept = "" if one.fleet.supervisor else ", and no supervisor"
        return f"{len(one.names)} process{'es' * (len(one.names) != 1)}{kept}"
    replayed = told is not None and not told.supervisor and not told.processes
    return "a replay" if told and replayed and answers(told.connect) else ""


def answers(endpoint: str) -> bool:
    """Whether somebody listens at a router's endpoint, such as tcp/127.0.0.1:7447."""
    host, _, port = endpoint.rpartition("/")[2].rpartition(":")
    try:
        socket.create_connection((host.strip("[]"), int(port)), ANSWER_S).close()
    except (OSError, ValueError):
        return False
    return True


def size(folder: Path) -> int:
    """Return the bytes that a folder takes on disk; links are not followed, what vanishes meanwhile
    counts nothing.
    """
    taken = 0
    for path, _, files in os.walk(folder):
        for name in (*files, "."):
            with suppress(OSError):
                taken += os.lstat(os.path.join(path, name)).st_blocks * BLOCK
    return taken


def _show(found: list[Run], console: Console) -> None:
    """Print a line for each run, and below it in the full width why it failed and its tasks. A
    narrow terminal has no room for the begin, which most names tell, and for the system.
    """
    heads = [one for one in HEADS if console.width >= WIDE or one not in ("begin", "system")]
    drawn = table(heads, ([_cell(one, head) for head in heads] for one in found), right=RIGHT)
    head, *lines = console.render_lines(drawn, pad=False)
    console.print(Segments([*head, Segment.line()]))
    for one, line in zip(found, lines, strict=True):
        console.print(Segments([*line, Segment.line()]))
        for text in _below(one):
            console.print(Padding(text, BELOW))
    console.print(f"{len(found)} run{'s' * (len(found) != 1)}, {words_of(found)}", style="dim")


def _cell(one: Run, head: str) -> Cell:
    """What stands below a head of the table."""
    match head:
        case "run":
            latest = " (latest)" if one.latest else ""
            return Text.assemble((one.name, "bold"), (latest, "dim"))
        case "begin":
            return datetime.fromtimestamp(one.begin).strftime("%Y-%m-%d %H:%M:%S")
        case "took":
            return span(one.duration_s)
        case "on disk":
            return bytes_in_words(one.bytes)
        case "system":
            return one.system
    return Text(one.result, COLOURS.get(one.result, ""))


def _below(one: Run) -> Iterator[Text]:
    """Why a run failed or what of it is up, how many tasks came to which end, and each task."""
    if one.why:
        yield Text(one.why, COLOURS.get(one.result, ""))
    if one.tasks:
        yield Text(counted(one.tasks))
    for task in one.tasks:
        became = "done" if task.success else task.failure
        yield Text(f"{task.asked}: {became}", "" if task.success else COLOURS[FAILED])


def counted(tasks: Iterable[Task]) -> str:
    """How many tasks came to which end: 7 done, 2 failed."""
    ends = Counter(one.became for one in tasks)
    return ", ".join(f"{ends[end]} {end}" for end in ENDS if ends[end])


def words_of(found: list[Run]) -> str:
    """Return the size of these runs together."""
    return bytes_in_words(sum(one.bytes for one in found))


def span(seconds: float | None) -> str:
    """Return a duration in few characters: 42 s, 3 min 05 s, 2 h 10 min; "-" for None."""
    if seconds is None:
        return "-"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02} min"
    return f"{minutes} min {rest:02} s" if minutes else f"{rest} s"


def _named_time(folder: Path) -> float:
    """Return when a run began that no fleet tells of: by its name, else when its folder was written
    last [unix s].
    """
    try:
        return datetime.strptime(folder.name, folders.NAME).timestamp()
    except ValueError:
        return folder.stat().st_mtime


# --- Runs chosen by name or by rule, and removed, with what that frees. Never one that is up ------


UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0, "w": 7 * 86400.0}


class Rule(msgspec.Struct, frozen=True):
    """Rule that chooses runs. All conditions given must hold; `keep`: the newest of those stay.
    `age_s`: since their begin.
    """

    names: frozenset[str] = frozenset()
    age_s: float | None = None
    keep: int | None = None
    failed: bool = False

    def __bool__(self) -> bool:
        """Whether anything is given: nothing is removed without a rule."""
        return self != Rule()

    def chosen(self, found: Iterable[Run], now: float) -> list[Run]:
        """Those that are meant, newest first."""
        newest = sorted(found, key=lambda one: one.begin, reverse=True)
        return [one for one in newest[self.keep or 0 :] if self._meets(one, now)]

    def _meets(self, one: Run, now: float) -> bool:
        return (
            (not self.names or one.name in self.names)
            and (self.age_s is None or now - one.begin > self.age_s)
            and (one.failed or not self.failed)
        )


class Removed(msgspec.Struct, frozen=True):
    """`--remove --format json`: the runs that went, and the bytes that this freed."""

    removed: tuple[Run, ...]
    bytes: int


def _remove(rule: Rule, found: list[Run], within: Path, form: Format) -> None:
    """Remove what a rule means, and tell it. Raise UsageError where nothing is meant, rather than
    all.
    """
    if not rule:
        raise UsageError("name runs, or give a rule: --older-than 7d, --keep N, --failed")
    gone = tuple(one for one in rule.chosen(found, time.time()) if _removed(within / one.name))
    done = Removed(gone, sum(one.bytes for one in gone))
    tell(done, form, sentence(done))


def age(text: str) -> float:
    """Return a duration such as 90s, 30min, 12h, 7d, 2w in seconds. Raise UsageError for another
    text.
    """
    found = re.fullmatch(r"(\d+(?:\.\d+)?)([a-z]+)", text)
    if found is None or found[2] not in UNITS:
        write = f"write a number and one of {', '.join(UNITS)}: 7d"
        raise UsageError(f"--older-than {text} is not a duration; {write}")
    return float(found[1]) * UNITS[found[2]]


def sentence(done: Removed) -> str:
    """Which runs went and what that freed, for people."""
    if not done.removed:
        return "no run is removed: none fits, or those that do are up"
    count, frees = len(done.removed), words_of(list(done.removed))
    what = f"{count} run{'s' * (count != 1)}"
    return "\n".join([*(f"removed {one.name}" for one in done.removed), f"{what}; freed {frees}"])


def _named(names: list[str], found: list[Run], within: Path, remove: bool) -> frozenset[str]:
    """Names of runs, `latest` and paths resolved. Raise UsageError for one that is not there, or is
    up and shall go.
    """
    known, meant = {one.name: one for one in found}, set()
    for text in names:
        name = (within / LATEST).resolve().name if text == LATEST else Path(text).name
        if name not in known:
            there = f"; there are {', '.join(known)}" if known else ""
            raise UsageError(f"{within} has no run {text!r}{there}")
        if remove and known[name].up:
            ends = f"`roco down --run-dir {within / name}` ends it first"
            raise UsageError(f"{name} is up ({known[name].why}); {ends}")
        meant.add(name)
    return frozenset(meant)


def _removed(folder: Path) -> bool:
    """Remove a run; whether it went: one that came up meanwhile stays. Raise ConsoleError where it
    cannot be.
    """
    if living(folder, folders.fleet(folder)):
        return False
    link = folder.parent / LATEST
    pointed = link.is_symlink() and link.resolve() == folder.resolve()
    try:
        shutil.rmtree(folder)
        if pointed:
            link.unlink()
    except OSError as error:
        remedy = "look at its rights, or remove it yourself"
        raise ConsoleError(f"{folder} cannot be removed ({error}); {remedy}") from error
    return True
