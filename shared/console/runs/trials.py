"""One verb of `roco` repeated, each time with a fresh fleet: one line of results.jsonl for each
run.

The file is what an interrupted experiment goes on from: a run counts once its line is there; one
without is repeated. Must not know: which statistics are made of the results (operate.experiments).
"""

import contextlib
import os
import platform
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import msgspec

from agent_runtime.io.run_files import make_run
from console.errors import UsageError, last_line
from console.fleet import starting
from console.runs import machine
from operate.experiments.run_figures import RESULTS_FILE, SETTING_FILE, ExperimentSetting
from operate.file_names import REPORT_FILE

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


def here(task: str, command: tuple[str, ...], asked: Asked) -> Setting:
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
        version=machine.installed(),
        commit=machine.commit(),
        machine=machine.processor(),
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


def run(out: Path, setting: Setting, seed: int, tick: Callable[[float], None]) -> Line:
    """One run from start to end, in a fresh folder; `tick` gets the seconds it takes so far.

    A run that takes longer than the setting allows is ended and counts as a failure. Its fleet is
    down afterwards, whatever happens.
    """
    place = folder(out, seed)
    _clear(place)
    began, load = time.time(), machine.load()
    process = _start(place, setting, seed)
    try:
        code = _waited(process, setting.timeout_s, tick)
    finally:
        _end(process, place)
    took_s, late = round(time.time() - began, 1), code is None
    loads, code = (round(load, 2), round(machine.load(), 2)), process.returncode
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
