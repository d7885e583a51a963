"""`roco experiment run`: a fresh fleet for some seconds, repeated. By `repeated` a system repeats
its own job.

Interrupted, it says how to go on. Must not know: which statistics are made of the results
(operate.experiments).
"""

import contextlib
import os
import platform
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from datetime import datetime
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median
from typing import Annotated, TypeVar

import msgspec
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from agent_runtime.io.run_files import make_run
from console import interrupts
from console.errors import ConsoleError, UsageError, last_line
from console.fleet import starting
from console.fleet.up import Rate, SceneFile, Speed
from console.output import FirstSeed, Form, Format, option, tell_problem
from console.runs import folders
from console.terminal.console import Console
from operate.experiments.run_figures import RESULTS_FILE, SETTING_FILE, ExperimentSetting
from operate.file_names import REPORT_FILE

# --- A verb of `roco` repeated, each time with a fresh fleet: one line of results.jsonl
# for each run. The file is what an interrupted experiment goes on from: a run counts once its line
# is there; one without is repeated.


LOG_FILE = "run.log"
# an interrupted run brings its fleet down first; estimate for what it needs besides
END_S = starting.STOP_S + 30.0
LOOK_S = 0.5  # estimate: how often a waiting person's picture is renewed
# runs in a row without a report: something is wrong with the machine, not with the robot (estimate)
HOPELESS = 3
FIXED = ("task", "seed", "speed", "scene")
"""What stays the same while an experiment goes on."""
T = TypeVar("T")


class Setting(ExperimentSetting, frozen=True):
    """experiment.json with its `command`: words of `roco`, to which seed, speed, scene and run
    folder are added.
    """

    command: tuple[str, ...] = ()

    @property
    def seeds(self) -> range:
        """One for each run."""
        return range(self.seed, self.seed + self.runs)


class Line(msgspec.Struct, frozen=True):
    """One run: `took_s` with start and end of the fleet, `load` of the machine before and after
    (one minute's mean).

    `figures`: its report.json, null where there is none; `failure`: why it does not count as a
    success, else null.
    """

    seed: int
    began: float
    took_s: float
    exit: int
    timed_out: bool
    load: tuple[float, float]
    failure: str | None
    figures: msgspec.Raw


class _Verdict(msgspec.Struct, frozen=True):
    """A report's statement about success."""

    success: bool
    failure: str | None = None


class Asked(msgspec.Struct, frozen=True):
    """A person's settings of an experiment, as in Setting."""

    runs: int
    seed: int
    speed: str
    scene: Path | None
    timeout_s: float
    most_load: float


def setting_here(task: str, command: tuple[str, ...], asked: Asked) -> Setting:
    """Return the setting of an experiment that starts now on this machine."""
    return Setting(
        task=task,
        command=command,
        runs=asked.runs,
        seed=asked.seed,
        speed=asked.speed,
        scene=str(asked.scene.resolve()) if asked.scene else "",
        timeout_s=asked.timeout_s,
        most_load=asked.most_load,
        began=time.time(),
        version=installed(),
        commit=commit(),
        machine=processor(),
        cores=os.cpu_count() or 0,
        python=platform.python_version(),
    )


def begun(out: Path, wanted: Setting, resume: bool) -> tuple[Setting, list[Line]]:
    """Make the folder of an experiment, or go on with it; what is done already. UsageError: it is
    another one's.
    """
    file = out / SETTING_FILE
    if not file.exists():
        out.mkdir(parents=True, exist_ok=True)
        file.write_bytes(msgspec.json.format(msgspec.json.encode(wanted)) + b"\n")
        return wanted, []
    if not resume:
        raise UsageError(
            f"{out} holds an experiment already; go on with it by --resume, or give another --out"
        )
    old, done = setting(out), lines(out)
    pairs = ((name, getattr(old, name), getattr(wanted, name)) for name in FIXED)
    if other := [f"{name} {was!r} (now {now!r})" for name, was, now in pairs if was != now]:
        has = ", ".join(other)
        raise UsageError(f"the experiment in {out} has {has}; give the same, or another --out")
    new = msgspec.structs.replace(
        old,
        command=wanted.command,
        runs=max(wanted.runs, old.runs),
        timeout_s=wanted.timeout_s,
        most_load=wanted.most_load,
    )
    file.write_bytes(msgspec.json.format(msgspec.json.encode(new)) + b"\n")
    return new, done


def setting(out: Path) -> Setting:
    """Return what experiment.json says. Raise UsageError where it cannot be read."""
    try:
        return msgspec.json.decode((out / SETTING_FILE).read_bytes(), type=Setting)
    except (OSError, msgspec.DecodeError) as error:
        raise UsageError(
            f"{out / SETTING_FILE} is not an experiment's setting ({error}); give another --out"
        ) from error


def lines(out: Path) -> list[Line]:
    """The runs that are done, each seed once."""
    found: dict[int, Line] = {}
    for line in read_lines(out / RESULTS_FILE, Line):
        found.setdefault(line.seed, line)
    return list(found.values())


def read_lines(path: Path, kind: type[T]) -> list[T]:
    """Return the lines of a file of results; one cut off by a kill is left out."""
    found = []
    with contextlib.suppress(FileNotFoundError):
        for raw in path.read_bytes().splitlines():
            with contextlib.suppress(msgspec.MsgspecError):
                found.append(msgspec.json.decode(raw, type=kind))
    return found


def append_line(path: Path, line: object) -> None:
    """Append a result to a file; on a line of its own, too, where a kill cut the one before."""
    with path.open("ab+") as file:
        if file.tell():
            file.seek(-1, os.SEEK_END)
            if file.read(1) != b"\n":
                file.write(b"\n")
        file.write(msgspec.json.encode(line) + b"\n")
        file.flush()
        os.fsync(file.fileno())


def folder(out: Path, seed: int) -> Path:
    """Return the folder in which the run of a seed is recorded."""
    return out / "runs" / f"seed-{seed}"


def one_run(out: Path, setting: Setting, seed: int, tick: Callable[[float], None]) -> Line:
    """One run from start to end, in a fresh folder; `tick` gets the seconds it takes so far.

    A run that takes longer than the setting allows is ended and counts as a failure. Its fleet is
    down afterwards, whatever happens.
    """
    place = folder(out, seed)
    _clear(place)
    began, load = time.time(), machine_load()
    process = _start(place, setting, seed)
    try:
        code = _waited(process, setting.timeout_s, tick)
    finally:
        _end(process, place)
    took_s, late = round(time.time() - began, 1), code is None
    loads, code = (round(load, 2), round(machine_load(), 2)), process.returncode
    failure, figures = _outcome(place, code, f"`roco {' '.join(setting.command[:1])}`")
    failure = f"not ended after {setting.timeout_s:.0f} s" if late else failure
    return Line(seed, began, took_s, code, late, loads, failure, figures)


def _clear(place: Path) -> None:
    """Remove an interrupted run's leftovers: its fleet, if it still lives, and its files."""
    if place.exists():
        starting.down(place)
        shutil.rmtree(place)
    make_run(place)


def _start(place: Path, setting: Setting, seed: int) -> "subprocess.Popen[bytes]":
    words = [*setting.command, "--seed", str(seed), "--speed", setting.speed, "--out", str(place)]
    words += ["--scene", setting.scene] if setting.scene else []
    return starting.in_background(["console", *words, "--format", "json"], place / LOG_FILE)


def _waited(
    process: subprocess.Popen[bytes], timeout_s: float, tick: Callable[[float], None]
) -> int | None:
    """Its exit code; None: it takes too long."""
    began = time.monotonic()
    while (since := time.monotonic() - began) < timeout_s:
        tick(since)
        with contextlib.suppress(subprocess.TimeoutExpired):
            return process.wait(LOOK_S)
    return None


def _end(process: subprocess.Popen[bytes], place: Path) -> None:
    """End a run in order, as Ctrl-C does, and its fleet if it does not; nothing where it has ended
    by itself.
    """
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(END_S)
    if process.poll() is None:
        process.kill()
        process.wait()
    starting.down(place)


def _outcome(place: Path, code: int, verb: str) -> tuple[str | None, msgspec.Raw]:
    """Return the reason a run failed, None if it succeeded; and its report, null if it has none."""
    ended = f"{verb} ended with {code}"
    try:
        raw = (place / REPORT_FILE).read_bytes()
        verdict = msgspec.json.decode(raw, type=_Verdict)
        figures = msgspec.Raw(msgspec.json.format(raw, indent=-1))
    except (OSError, msgspec.DecodeError):
        log = last_line((place / LOG_FILE).read_bytes()) or "it said nothing"
        return f"no report; {ended}: {log[-300:]}", msgspec.Raw(b"null")
    return (None if verdict.success and not code else verdict.failure or ended), figures


# --- The machine on which something is measured, and the sources it is measured with: what a result
# must name.


PROJECT = "robot-companion"
LOAD_S = 5.0
"""Linux renews its load that often."""


def machine_load() -> float:
    """Processes that want to run, mean of the last minute."""
    return os.getloadavg()[0]


def quiet(most: float, patience_s: float, tick: Callable[[float, float], None]) -> bool:
    """Wait until the load is at most this, but not for ever; `tick` gets the load and the seconds
    waited so far.

    False: it never was.
    """
    began = time.monotonic()
    while (now := machine_load()) > most:
        waited = time.monotonic() - began
        if waited > patience_s:
            return False
        tick(now, waited)
        time.sleep(min(LOAD_S, patience_s))
    return True


def installed() -> str:
    """The version of the project that is installed."""
    try:
        return version(PROJECT)
    except PackageNotFoundError:
        return "not installed"


def commit() -> str:
    """The commit of the sources, with "+" where they were changed since; "" outside of a
    checkout.
    """
    root = Path(__file__).parents[4]
    # installed; git would find a repository around the environment
    if not (root / ".git").exists():
        return ""
    describe = ("describe", "--always", "--dirty=+", "--abbrev=12", "--exclude=*")
    try:
        asked = ["git", "-C", str(root), *describe]
        done = subprocess.run(asked, capture_output=True, text=True, timeout=10.0)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip()


def processor() -> str:
    """Return the machine's name of its processor."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


# --- `roco experiment run` ---


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
        setting: Setting,
        done: list[Line],
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

    def ended(self, line: Line) -> None:
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
    """Repeat runs of a fresh fleet, and write report.html, .json and .md: how the runs differ.

    A run succeeds if every communicate is as designed and no process is down at its end. The verb
    exits with 0 when all runs are done, whether they succeeded or not. --resume continues after an
    interruption.

    Examples:
      roco experiment run --for 20 --runs 10
      roco experiment run --for 20 --runs 30 --out experiments/mine --resume
    """
    asked = Asked(runs, seed, speed.value, scene, timeout, most_load)
    lasting = ("--for", f"{seconds:g}")
    repeated(("run", *lasting), ("up", *lasting), asked, out, resume, form)


def repeated(
    words: tuple[str, ...],
    command: tuple[str, ...],
    asked: Asked,
    out: Path | None,
    resume: bool,
    form: Format,
    good: str = GOOD,
) -> None:
    """Repeat a verb of `roco` that starts a fleet and ends it.

    `words`: what was said behind `roco experiment`, by which it goes on; `command`: the verb;
    `good`: what a successful run did, one word.
    """
    with interrupts.heard():
        if resume and out is None:
            raise UsageError(
                "--resume needs the experiment to go on with; name its folder with --out"
            )
        scene = ["--scene", str(asked.scene)] if asked.scene else []
        starting.check(["--seed", str(asked.seed), *scene])
        folders.refuse_beside("beside it the figures would not be those of the robot alone")
        new = folders.EXPERIMENTS / datetime.now().strftime(folders.NAME)
        place = (out or new).resolve()
        setting, done = begun(place, setting_here(words[0], command, asked), resume)
        console = Console()
        try:
            _all(place, setting, Watch(setting, done, form, console, good))
        except KeyboardInterrupt:
            again = _again(words, setting, place)
            tell_problem(f"what is done stays in {place}; to go on: {again}", form)
            raise
        _finish(place, form, console)


def _again(words: tuple[str, ...], setting: Setting, place: Path) -> str:
    """Return the command by which an experiment goes on."""
    same = f"--runs {setting.runs} --seed {setting.seed} --speed {setting.speed}"
    more = f"--timeout {setting.timeout_s:g} --most-load {setting.most_load:g}"
    return " ".join(("roco experiment", *words, same, more, f"--out {place} --resume"))


def _all(place: Path, setting: Setting, watch: Watch) -> None:
    """The runs that are not done yet. ConsoleError where nothing works at all."""
    known, without = {line.seed for line in watch.done}, 0
    with watch.bar:
        for seed in setting.seeds:
            if seed in known:
                continue
            quiet(setting.most_load or float("inf"), PATIENCE_S, watch.waiting)
            line = one_run(place, setting, seed, partial(watch.tick, seed))
            append_line(place / RESULTS_FILE, line)
            watch.ended(line)
            without = without + 1 if bytes(line.figures) == b"null" else 0
            if without >= HOPELESS:
                log = folder(place, seed) / LOG_FILE
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
