"""For all tests: hypothesis looks for what is false, not for what is slow; machines with other work
run them, too.

In CI it draws the same examples each time, so that a commit is refused for what it changed;
elsewhere it draws others. Its profile `few` draws a quarter of the examples of `many`, which CI and
`scripts/test --all` take; a number that a test names is one of `many`. Tests that walk through many
cases take `some` of them likewise.

Fleets of tests show no pictures (ROCO_VIEW) but where a test is about them: they would only make
everything slower. Their robots see by rays (ROCO_EYES), which is faster, except where a pour as
shipped is tested. Output is buffered as it is for people, also where the environment says
otherwise. Every module is compiled once for all processes that tests start, also where the
environment says otherwise (BYTECODE). A fleet in containers on this machine is none of the tests'
(DOCKER_HOST). Whoever starts the tests in the background has them ignore SIGINT; what tests start
would inherit that, and is interrupted by some. A test of real processes that fails is tried once
more, no other; its name is added to the file ROCO_SECOND_TRIES, and why it failed at first is
printed, whatever became of it. Of the processes that it had then, the stacks and the run folders
are kept below KEPT: of those that it started, by the variable TESTS_STACKS, which they inherit. Why
a test is skipped is told in one form (NEEDS); the file ROCO_SKIPPED gets the name of each, a tab,
and the reason.
"""

import faulthandler
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import FrameType
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

from velma.errors import GlError
from velma.sim import gl

IN_CI = os.environ.get("CI") == "true"
MANY = 100
"""Examples of a test that names no number of its own."""
for profile, examples in (("few", MANY // 4), ("many", MANY)):
    settings.register_profile(
        profile,
        max_examples=examples,
        deadline=None,
        suppress_health_check=[HealthCheck.too_slow],
        derandomize=IN_CI,
    )
settings.load_profile("many" if IN_CI else "few")
os.environ.setdefault("ROCO_VIEW", "off")
os.environ.setdefault("ROCO_EYES", "rays")
BYTECODE = str(Path(__file__).parents[1] / ".venv/bytecode")
os.environ["PYTHONPYCACHEPREFIX"] = sys.pycache_prefix = BYTECODE
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
os.environ.pop("PYTHONUNBUFFERED", None)
sys.dont_write_bytecode = False
os.environ["DOCKER_HOST"] = "unix:///nowhere"
STACKS = f"{tempfile.gettempdir()}/roco-tests-{os.getpid()}.stacks"
os.environ["TESTS_STACKS"] = STACKS
AT_START = str(Path(__file__).with_name("at_start"))
if AT_START not in os.environ.get("PYTHONPATH", "").split(os.pathsep):
    os.environ["PYTHONPATH"] = AT_START + (
        os.pathsep + os.environ["PYTHONPATH"] if "PYTHONPATH" in os.environ else ""
    )
KEPT = Path(__file__).parents[1] / ".venv/failed-tests"
"""A folder for each test that failed while processes of it ran: its last failure."""
NEEDS = re.compile(r"needs .+ \((Debian: apt install|PyPI: pip install|as root|git clone).*\)")
"""What is missing, and the package, the right or the command by which it is there."""
STACKS_S = 1.0
"""Longest wait for the stacks of a process; estimate: they are written by a signal handler, within
milliseconds.
"""
LEFT_S = 5.0  # for the end of a test whose stacks were kept meanwhile (estimate)
LINES = 30
"""Of a first failure that are printed; estimate: the assertion and where it stands."""
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Real processes meet other work of the machine: a second try. A pure test that fails once is
    wrong.

    Files with such tests begin first: at the end, workers wait for each other only as long as a
    short file takes.
    """
    real = {item.path for item in items if is_real(item)}
    items.sort(key=lambda item: item.path not in real)
    for test in {inner for item in items if (inner := drawing(item)) is not None}:
        test._hypothesis_internal_use_settings = scaled(test._hypothesis_internal_use_settings)
    if config.pluginmanager.hasplugin("rerunfailures"):
        for item in filter(is_real, items):
            item.add_marker(pytest.mark.flaky(reruns=1))


def drawing(item: pytest.Item) -> Any:
    """The function of a test whose examples hypothesis draws, if it names their number; None of
    others.
    """
    test = getattr(item, "obj", None)
    test = getattr(test, "__func__", test)
    own = getattr(test, "_hypothesis_internal_use_settings", None)
    return test if own is not None and own.max_examples != settings().max_examples else None


def scaled(own: settings) -> settings:
    """The settings of a test with as many examples as the profile takes of them."""
    return settings(own, max_examples=max(1, own.max_examples * settings().max_examples // MANY))


@pytest.fixture(scope="session")
def some() -> Callable[[Sequence[Any], int], list[Any]]:
    """As many of the cases as given, spread evenly over them; all of them with the profile
    `many`.
    """

    def pick(cases: Sequence[Any], count: int) -> list[Any]:
        many = settings().max_examples >= MANY or len(cases) <= count
        return list(cases) if many else [cases[len(cases) * k // count] for k in range(count)]

    return pick


def is_real(item: pytest.Item) -> bool:
    """Whether a test starts processes."""
    return any(item.get_closest_marker(name) is not None for name in ("zenoh", "process"))


class Failing:
    """The test that runs now; of one whose time is over, or that failed, what its processes do is
    kept.
    """

    item: pytest.Item | None = None
    told = ""

    @classmethod
    def keep(cls) -> None:
        """Keep the stacks and run folders of all processes of the test, once for each try."""
        if cls.item is None or cls.told or not is_real(cls.item) or not (processes := started()):
            return
        folder = KEPT / re.sub(r"[^\w.-]+", "-", cls.item.nodeid)[-150:]
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        with Path(STACKS).open("a", encoding="utf-8") as out:
            for process in processes:
                write_stacks(process, out)
            faulthandler.dump_traceback(out)
        shutil.move(STACKS, folder / "stacks.txt")
        places = {run for process in processes if (run := variable(process, "ROCO_RUN_DIR"))}
        for number, run in enumerate(sorted(places)):
            with suppress(OSError, shutil.Error):  # files come and go, and sockets cannot be copied
                shutil.copytree(run, folder / f"run-{number}", symlinks=True)
        cls.told = (
            f"stacks of {len(processes)} processes and {len(places)} run folders as they were:"
            f" {folder}"
        )


def started() -> list[Path]:
    """Return the folders in /proc of all processes that this one's tests started."""
    found = [
        place for place in Path("/proc").glob("[0-9]*") if variable(place, "TESTS_STACKS") == STACKS
    ]
    return sorted(found, key=lambda place: int(place.name))


def variable(process: Path, name: str) -> str:
    """Return a variable with which a process was started; "" without it."""
    with suppress(OSError):
        for one in (process / "environ").read_bytes().split(b"\0"):
            if one.startswith(f"{name}=".encode()):
                return one.partition(b"=")[2].decode(errors="replace")
    return ""


def write_stacks(process: Path, out: Any) -> None:
    """Write what a process is, where its threads wait in the kernel, and have it add its stacks of
    Python.
    """
    with suppress(OSError):
        words = (process / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
        status = (process / "status").read_text()
        tasks = (process / "task").iterdir()
        waits = [
            f"{(task / 'comm').read_text().strip()}: {(task / 'wchan').read_text()}"
            for task in tasks
        ]
        state = re.search(r"^State:\s+(.*)", status, re.MULTILINE)
        out.write(f"\n=== {process.name} {words}\n{state and state[1]}; {', '.join(waits)}\n")
        out.flush()
        caught = re.search(r"^SigCgt:\s+(\w+)", status, re.MULTILINE)
        if caught is None or not int(caught[1], 16) >> (signal.SIGUSR2 - 1) & 1:
            return
        size, until = os.path.getsize(STACKS), time.monotonic() + STACKS_S
        os.kill(int(process.name), signal.SIGUSR2)
        while (now := os.path.getsize(STACKS)) == size and time.monotonic() < until:
            time.sleep(0.01)
        while now != size and time.monotonic() < until:
            time.sleep(0.01)
            size, now = now, os.path.getsize(STACKS)


def communicate(process: "subprocess.Popen[Any]", *arguments: Any, **options: Any) -> Any:
    """Popen.communicate; where the time is over, who calls it kills the process next."""
    try:
        return plainly(process, *arguments, **options)
    except subprocess.TimeoutExpired:
        Failing.keep()
        raise


plainly = subprocess.Popen.communicate
subprocess.Popen.communicate = communicate  # type: ignore[method-assign]


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Each try has its own failure; tests that draw are skipped where the product says that it
    cannot draw.
    """
    Failing.item, Failing.told = item, ""
    if item.get_closest_marker("needs_opengl") and opengl_lost():
        pytest.skip(f"needs OpenGL without a display (Debian: apt install {GlError.PACKAGES})")


@pytest.hookimpl(hookwrapper=True, optionalhook=True)
def pytest_timeout_set_timer() -> Iterator[None]:
    """Keep what the processes do before pytest-timeout ends the test, and with it them."""
    yield
    ends = signal.getsignal(signal.SIGALRM)

    def over(number: int, frame: FrameType | None) -> None:
        Failing.keep()
        if callable(ends):
            ends(number, frame)

    if callable(ends):
        signal.signal(signal.SIGALRM, over)


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    """Say where it is kept, and have no reason of a skip in another form."""
    report: pytest.TestReport = (yield).get_result()  # type: ignore[misc]
    if report.failed:
        left, _ = signal.setitimer(signal.ITIMER_REAL, 0.0)  # in a hook, its end would end pytest
        Failing.keep()
        if left:
            signal.setitimer(signal.ITIMER_REAL, max(left, LEFT_S))
    if report.failed and Failing.told:
        report.sections.append(("kept", Failing.told))
    if report.skipped and not hasattr(report, "wasxfail") and not NEEDS.search(reason(report)):
        report.outcome = "failed"
        report.longrepr = (
            f"skipped for {reason(report)!r}; write what it needs and how to get it:"
            f" {NEEDS.pattern}"
        )


def reason(report: Any) -> str:
    """Return why a test was skipped."""
    return (
        str(report.longrepr[2]).removeprefix("Skipped: ")
        if isinstance(report.longrepr, tuple)
        else ""
    )


def pytest_unconfigure() -> None:
    """Nobody asks for stacks any more."""
    Path(STACKS).unlink(missing_ok=True)


@cache
def opengl_lost() -> str:
    """Return why nothing can be drawn here; asked once in each process of the tests."""
    return gl.lost()


@pytest.fixture
def no_opengl(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Processes that are started now cannot load what draws: files of those names come first."""
    for library in gl.LIBRARIES.values():
        (tmp_path / library).touch()
    monkeypatch.setenv("LD_LIBRARY_PATH", str(tmp_path))
    monkeypatch.delenv("MUJOCO_GL", raising=False)


@pytest.fixture
def disk() -> Iterator[Callable[[Path, str], Path]]:
    """Makes folders that are file systems of their own, of a size as mount takes it: they can be
    filled.
    """
    made: list[Path] = []

    def make(folder: Path, size: str) -> Path:
        folder.mkdir()
        words = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)]
        if shutil.which("mount") is None:
            pytest.skip("needs mount (Debian: apt install mount)")
        if (
            os.geteuid() != 0
            or subprocess.run(words, capture_output=True, check=False).returncode != 0
        ):
            pytest.skip(
                "needs the right to mount (as root, in a container with CAP_SYS_ADMIN:"
                " scripts/test)"
            )
        made.append(folder)
        return folder

    yield make
    for folder in made:
        subprocess.run(["umount", "-l", str(folder)], check=True)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Name what was tried twice or skipped, and why: in the process that started the workers, not
    in them.
    """
    if "PYTEST_XDIST_WORKER" in os.environ:
        return
    failed = {
        report.nodeid
        for kind in ("failed", "error")
        for report in terminalreporter.stats.get(kind, ())
    }
    twice = {one.nodeid: one for one in terminalreporter.stats.get("rerun", ())}
    again = [name for name in twice if name not in failed]
    for name, first in twice.items():
        terminalreporter.section(
            f"{'passed' if name in again else 'failed'} at its second try: {name}"
        )
        terminalreporter.write_line("\n".join(first.longreprtext.splitlines()[-LINES:]))
        terminalreporter.write_line(dict(first.sections).get("kept", ""))
    if again and (file := os.environ.get("ROCO_SECOND_TRIES")):
        with Path(file).open("a", encoding="utf-8") as names:
            names.writelines(f"{name}\n" for name in again)
    if file := os.environ.get("ROCO_SKIPPED"):
        skipped = terminalreporter.stats.get("skipped", ())
        Path(file).write_text(
            "".join(f"{one.nodeid}\t{reason(one)}\n" for one in skipped), encoding="utf-8"
        )
