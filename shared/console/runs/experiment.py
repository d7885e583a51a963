"""`roco experiment run`: a fresh fleet for some seconds, repeated. By `repeated` a system repeats
its own job.

Interrupted, it says how to go on. Must not know: which statistics are made of the results
(operate.experiments).
"""

from datetime import datetime
from functools import partial
from pathlib import Path
from statistics import median
from typing import Annotated

import msgspec
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from console import interrupts
from console.errors import ConsoleError, UsageError
from console.fleet import running_fleets, starting
from console.fleet.up import Rate, SceneFile, Speed
from console.output import FirstSeed, Form, Format, option, problems, tell_problem
from console.runs import folders, machine, trials
from console.terminal.console import Console
from operate.experiments.run_figures import RESULTS_FILE

# a run before any was timed: a pour on two idle cores at --speed max (measured 2026-11-21)
FIRST_S = 75.0
DONE, GOOD = "done", "succeeded"
# for a quiet machine, before each run; estimate: longer than other work on it lasts
PATIENCE_S = 3600.0


class Progressing(msgspec.Struct, frozen=True, tag_field="kind", tag="run"):
    """`--format json`: a line for each run. `left_s`: estimate of what the others will take."""

    seed: int
    done: int
    of: int
    success: bool
    failure: str | None
    took_s: float
    left_s: float


class Watch:
    """Says how far the experiment is: a bar in a terminal, a line for each run elsewhere, JSON
    lines for programs.
    """

    def __init__(
        self,
        setting: trials.Setting,
        done: list[trials.Line],
        form: Form,
        console: Console,
        good: str = GOOD,
    ) -> None:
        self.setting, self.done, self.form = setting, done, form
        self.console, self.good = console, good
        of, say = MofNCompleteColumn(), TextColumn("{task.fields[say]}")
        columns = (TextColumn("{task.description}"), BarColumn(20), of, say)
        quiet = form is Format.JSON or not console.is_terminal
        self.bar = Progress(*columns, console=console, transient=True, disable=quiet)
        total, count = setting.runs, len(done)
        self._task = self.bar.add_task(setting.task, total=total, completed=count, say="")

    def tick(self, seed: int, since_s: float) -> None:
        """A run goes on."""
        left = span(max(0.0, self.left_s() - since_s))
        self.bar.update(self._task, say=f"seed {seed}: {since_s:3.0f} s   about {left} left")

    def waiting(self, load: float, since_s: float) -> None:
        """The machine has too much to do."""
        words = f"load {load:.1f}: waiting for a quiet machine, {span(since_s)} so far"
        self.bar.update(self._task, say=words)

    def left_s(self) -> float:
        """Remaining time [s], estimated from the duration of the finished runs."""
        each = median(line.took_s for line in self.done) if self.done else FIRST_S
        return each * (self.setting.runs - len(self.done))

    def ended(self, line: trials.Line) -> None:
        """A run is done."""
        self.done.append(line)
        count, of, seed = len(self.done), self.setting.runs, line.seed
        failure, took_s, left_s = line.failure, line.took_s, self.left_s()
        self.bar.update(self._task, completed=count)
        if self.form is Format.JSON:
            told = Progressing(seed, count, of, failure is None, failure, took_s, left_s)
            self.console.out(msgspec.json.encode(told).decode(), highlight=False)
            return
        words = self.good if failure is None else f"FAILED: {failure}"
        left = f"; about {span(left_s)} left" if count < of else ""
        words = f"run {count} of {of}, seed {seed}: {words}, {took_s:.0f} s{left}"
        self.console.out(words, highlight=False)


Count = Annotated[int, option("How many runs.", min=1)]
Place = Annotated[Path | None, option("The experiment's folder; else experiments/<time>.")]
Resume = Annotated[bool, option("Go on with the experiment in --out.", "--resume")]
Timeout = Annotated[float, option("A run that takes more seconds is ended: a failure.", min=1.0)]
MostLoad = Annotated[
    float, option("A run waits, at most an hour, until the load is not above this; 0: no.", min=0.0)
]


def run(
    seconds: Annotated[
        float, option("Seconds that each fleet runs once it is ready.", "--for", min=1.0)
    ],
    runs: Count = 10,
    seed: FirstSeed = 1,
    speed: Rate = Speed.REAL,
    scene: SceneFile = None,
    out: Place = None,
    resume: Resume = False,
    timeout: Timeout = 360.0,
    most_load: MostLoad = 0.0,
    form: Form = Format.TEXT,
) -> None:
    """Bring a fresh fleet up for some seconds, again and again; report.html, .json and .md say how
    runs differ.

    A run succeeds when all that was said is as designed, and nobody is down at its end. Exits with
    0 when all runs are done, whether they succeeded or not; interrupted, it goes on with --resume.

    Examples:
      roco experiment run --for 20 --runs 10
      roco experiment run --for 20 --runs 30 --out experiments/mine --resume
    """
    asked = trials.Asked(runs, seed, speed.value, scene, timeout, most_load)
    lasting = ("--for", f"{seconds:g}")
    repeated(("run", *lasting), ("up", *lasting), asked, out, resume, form)


def repeated(
    words: tuple[str, ...],
    command: tuple[str, ...],
    asked: trials.Asked,
    out: Path | None,
    resume: bool,
    form: Format,
    good: str = GOOD,
) -> None:
    """Repeat a verb of `roco` that starts a fleet and ends it.

    `words`: what was said behind `roco experiment`, by which it goes on; `command`: the verb;
    `good`: what a successful run did, one word.
    """
    with problems(form), interrupts.heard():
        if resume and out is None:
            raise UsageError(
                "--resume needs the experiment to go on with; name its folder with --out"
            )
        scene = ["--scene", str(asked.scene)] if asked.scene else []
        starting.check(["--seed", str(asked.seed), *scene])
        running_fleets.refuse("beside it the figures would not be those of the robot alone")
        new = running_fleets.EXPERIMENTS / datetime.now().strftime(folders.NAME)
        place = (out or new).resolve()
        setting, done = trials.begun(place, trials.here(words[0], command, asked), resume)
        console = Console()
        try:
            _all(place, setting, Watch(setting, done, form, console, good))
        except KeyboardInterrupt:
            again = _again(words, setting, place)
            tell_problem(f"what is done stays in {place}; to go on: {again}", form)
            raise
        _finish(place, form, console)


def _again(words: tuple[str, ...], setting: trials.Setting, place: Path) -> str:
    """Return the command by which an experiment goes on."""
    same = f"--runs {setting.runs} --seed {setting.seed} --speed {setting.speed}"
    more = f"--timeout {setting.timeout_s:g} --most-load {setting.most_load:g}"
    return " ".join(("roco experiment", *words, same, more, f"--out {place} --resume"))


def _all(place: Path, setting: trials.Setting, watch: Watch) -> None:
    """The runs that are not done yet. ConsoleError where nothing works at all."""
    known, without = {line.seed for line in watch.done}, 0
    with watch.bar:
        for seed in setting.seeds:
            if seed in known:
                continue
            machine.quiet(setting.most_load or float("inf"), PATIENCE_S, watch.waiting)
            line = trials.run(place, setting, seed, partial(watch.tick, seed))
            trials.append_line(place / RESULTS_FILE, line)
            watch.ended(line)
            without = without + 1 if bytes(line.figures) == b"null" else 0
            if without >= trials.HOPELESS:
                log = trials.folder(place, seed) / trials.LOG_FILE
                last = f"the last one: {line.failure}; see {log}, then --resume"
                raise ConsoleError(f"{without} runs in a row left no report, {last}")


def _finish(place: Path, form: Form, console: Console) -> None:
    """Make the report of what is there, and say what it says."""
    say = partial(console.out, highlight=False)
    if form is Format.TEXT:
        say("making the report …")
    from operate.experiments import page

    told = page.everything(place)
    if form is Format.JSON:
        say(msgspec.json.encode({"kind": DONE, **msgspec.structs.asdict(told)}).decode())
        return
    for line in (*told.lines, f"report: {place / 'report.html'}"):
        say(line)


def span(seconds: float) -> str:
    """A duration for people."""
    return f"{seconds / 60:.0f} min" if seconds >= 90 else f"{seconds:.0f} s"
