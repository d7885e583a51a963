"""Tests against mutants, in forked processes: the parent has imported what is not ours, so that a
trial is short.

A mutant is compiled into the child only, by an import hook; no file is changed.
"""

import contextlib
import importlib
import importlib.abc
import importlib.util
import multiprocessing
import os
import resource
import signal
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from types import CodeType, FrameType
from typing import Any

import pytest
from mutations import ROOT, Mutant, path

FORK = multiprocessing.get_context("fork")
AT_ONCE = 2
MEMORY = 6 << 30
"""Bytes a trial may take: what grows without end fails instead of starving the machine;
estimate.
"""
LEAST_S, PATIENCE, TEST_S = 15.0, 2, 15
"""A trial may take LEAST_S and PATIENCE times what its tests take unchanged and traced, one test
TEST_S; estimates.
"""
ARGUMENTS = ["-q", "-x", "-m", "not long", "-p", "no:rerunfailures", "--hypothesis-seed=0"]
ARGUMENTS += ["-W", "ignore::pytest.PytestAssertRewriteWarning"]
ARGUMENTS += ["--hypothesis-profile=many"]  # all the examples of a test: tests/conftest.py


@dataclass
class Baseline:
    """The tests of a room without a change: seconds of each, the lines each has run, and what is to
    be imported.
    """

    seconds: dict[str, float] = field(default_factory=dict)
    lines: dict[str, dict[int, set[str]]] = field(default_factory=dict)
    imported: list[str] = field(default_factory=list)
    failed: str = ""

    def tests(self, mutant: Mutant) -> list[str]:
        """The tests that run the mutant's lines, fastest first; all of them where an import runs
        it.
        """
        lines = self.lines.get(str(path(mutant.module)), {})
        ran = set[str]().union(*(lines.get(line, ()) for line in mutant.lines))
        return sorted(
            self.seconds if "" in ran else ran & self.seconds.keys(), key=self.seconds.__getitem__
        )


@dataclass
class Verdict:
    """`killed`, `survived` or `timeout`; `by`: the test that failed first."""

    verdict: str
    by: str
    seconds: float


class _Watch:
    """A plugin of pytest: chosen tests in the order given; notes the first that fails, and the
    lines of files.
    """

    def __init__(self, chosen: list[str] | None, traced: list[str]) -> None:
        self.chosen, self.traced = chosen, {file: dict[int, set[str]]() for file in traced}
        self.test, self.failed, self.seconds = "", "", dict[str, float]()

    def pytest_sessionstart(self) -> None:
        """After the conftest of all tests has loaded its own: nothing is shrunk, nothing
        remembered.
        """
        from hypothesis import Phase, settings

        phases = (Phase.explicit, Phase.generate)
        settings.register_profile(
            "trial", settings.get_profile("many"), phases=phases, database=None
        )
        settings.load_profile("trial")

    def trace(self) -> None:
        """Note the lines of files from here on; before pytest, for a conftest may import them
        (defaults run then).
        """
        if self.traced:
            sys.settrace(self._call)
            threading.settrace(self._call)

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Keep the chosen ones."""
        if self.chosen is not None:
            place = {test: number for number, test in enumerate(self.chosen)}
            items[:] = sorted(
                (item for item in items if item.nodeid in place),
                key=lambda item: place[item.nodeid],
            )

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        """Lines are this test's from here on."""
        self.test = nodeid
        self.trace()  # an earlier test, or a library, may have ended it

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note seconds and the first failure."""
        self.seconds[report.nodeid] = self.seconds.get(report.nodeid, 0.0) + report.duration
        if report.failed and not self.failed:
            self.failed = report.nodeid

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """A module that cannot be imported is noticed, too."""
        if report.failed and not self.failed:
            self.failed = f"{report.nodeid} (import)"

    def _call(self, frame: FrameType, event: str, argument: Any) -> Any:
        return self._line if frame.f_code.co_filename in self.traced else None

    def _line(self, frame: FrameType, event: str, argument: Any) -> Any:
        self.traced[frame.f_code.co_filename].setdefault(frame.f_lineno, set()).add(self.test)
        return self._line


class _Changed(importlib.abc.MetaPathFinder, importlib.abc.InspectLoader):
    """Finds one module, and gives its mutant."""

    def __init__(self, mutant: Mutant) -> None:
        self.mutant = mutant

    def find_spec(self, name: str, path_: Any, target: Any = None) -> Any:
        """Only of the mutated module."""
        if name != self.mutant.module:
            return None
        return importlib.util.spec_from_loader(name, self, origin=str(path(name)))

    def get_code(self, name: str) -> CodeType:
        """The mutant."""
        return compile(self.mutant.code(), str(path(name)), "exec", dont_inherit=True)

    def get_source(self, name: str) -> str:
        """Of the module as it is, for tracebacks and `inspect`."""
        return path(name).read_text(encoding="utf-8")

    def exec_module(self, module: Any) -> None:
        """Its file's name is wanted by some."""
        module.__file__ = str(path(module.__name__))
        super().exec_module(module)


def baseline(tests: list[str], modules: list[str]) -> Baseline:
    """Run the tests of a room unchanged and import here what they have imported that is not
    ours.
    """
    traced = [str(path(module)) for module in modules]
    process, answer = _start(None, tests, None, traced)
    code, watch, imported = answer.recv()
    process.join()
    if code != 0:
        return Baseline(failed=watch[2] or f"exit code {code}")
    for name in imported:
        with contextlib.suppress(Exception):
            importlib.import_module(name)
    return Baseline(watch[0], watch[1], imported)


def judged(
    trials: Iterator[tuple[Mutant, list[str], list[str] | None, float]],
) -> Iterator[tuple[Mutant, Verdict]]:
    """Verdicts as they come; a trial: mutant, files of tests, those chosen of them, seconds they
    take unchanged.
    """
    running: dict[Connection, tuple[Any, Mutant, float, float]] = {}
    left = True
    while left or running:
        while left and len(running) < AT_ONCE:
            one = next(trials, None)
            if one is None:
                left = False
                break
            mutant, files, chosen, seconds = one
            process, answer = _start(mutant, files, chosen, [])
            now = time.monotonic()
            running[answer] = (process, mutant, now, now + LEAST_S + PATIENCE * seconds)
        soonest = min((row[3] for row in running.values()), default=time.monotonic())
        ready = wait(list(running), max(0.0, soonest - time.monotonic()))
        for answer, (process, mutant, begun, until) in list(running.items()):
            if answer in ready or time.monotonic() >= until:
                del running[answer]
                yield (
                    mutant,
                    Verdict(*_outcome(answer, process), round(time.monotonic() - begun, 1)),
                )


def _outcome(answer: Connection, process: Any) -> tuple[str, str]:
    try:
        code, watch, _ = answer.recv() if answer.poll() else (None, None, None)
    except EOFError:  # it died, or ended itself: as a failed test does
        code, watch = 1, (None, None, "the process of the tests died")
    with contextlib.suppress(ProcessLookupError):  # what its tests have started, too
        os.killpg(process.pid, signal.SIGKILL)
    process.join()
    if code is None:
        return "timeout", ""
    # the test meant is gone
    if code in (0, pytest.ExitCode.USAGE_ERROR, pytest.ExitCode.NO_TESTS_COLLECTED):
        return "survived", ""
    if code in (1, 2) and watch[2]:
        return "killed", watch[2]
    raise RuntimeError(
        f"pytest ended with exit code {code}, expected 0, 1, 2, 4 or 5; run its tests by hand"
    )


def _start(
    mutant: Mutant | None, files: list[str], chosen: list[str] | None, traced: list[str]
) -> tuple[Any, Connection]:
    ours, theirs = FORK.Pipe(duplex=False)
    process = FORK.Process(target=_trial, args=(theirs, mutant, files, chosen, traced))
    process.start()
    theirs.close()
    # Parent and child both do this: the child may be killed before it gets there.
    with contextlib.suppress(OSError):
        os.setpgid(process.pid, process.pid)
    return process, ours


def _trial(
    answer: Connection,
    mutant: Mutant | None,
    files: list[str],
    chosen: list[str] | None,
    traced: list[str],
) -> None:
    with contextlib.suppress(OSError):
        os.setpgid(0, 0)
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    nothing = os.open(os.devnull, os.O_RDWR)
    for standard in (0, 1, 2):
        os.dup2(nothing, standard)
    os.chdir(ROOT)
    if mutant:
        sys.meta_path.insert(0, _Changed(mutant))
    watch = _Watch(chosen, traced)
    watch.trace()
    code = pytest.main(
        [*ARGUMENTS, "-o", f"timeout={TEST_S if mutant else 0}", *files], plugins=[watch]
    )
    sys.settrace(None)
    ours = (
        str(ROOT / folder)
        for folder in ("services", "shared", "tests", "velma", "examples", "scripts")
    )
    home = tuple(ours)
    files_of = {
        name: getattr(module, "__file__", None) or "" for name, module in list(sys.modules.items())
    }
    imported = (
        [name for name, file in files_of.items() if file and not file.startswith(home)]
        if traced
        else []
    )
    answer.send((int(code), (watch.seconds, watch.traced, watch.failed), imported))
    answer.close()
    os._exit(0)
