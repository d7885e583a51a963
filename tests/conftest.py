"""For all tests: hypothesis looks for what is false, not for what is slow; machines with other work run them, too.

In CI it draws the same examples each time, so that a commit is refused for what it changed; elsewhere it draws others.

Fleets of tests show no pictures (ROCO_VIEW) but where a test is about them: they would only make everything slower.
Their robots see by rays (ROCO_EYES), which is faster, except where a pour as shipped is tested.
Every module is compiled once for all processes that tests start, also where the environment says otherwise (BYTECODE).
A fleet in containers on this machine is none of the tests' (DOCKER_HOST). Whoever starts the tests in the background
has them ignore SIGINT; what tests start would inherit that, and is interrupted by some.
A test of real processes that fails is tried once more, no other; its name is added to the file ROCO_SECOND_TRIES, and
why it failed at first is printed, whatever became of it.
"""

import os
import signal
import sys
from functools import cache
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from velma.errors import GlError
from velma.sim import gl

settings.register_profile(
    "any machine",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    derandomize=os.environ.get("CI") == "true",
)
settings.load_profile("any machine")
os.environ.setdefault("ROCO_VIEW", "off")
os.environ.setdefault("ROCO_EYES", "rays")
BYTECODE = str(Path(__file__).parents[1] / ".venv/bytecode")
os.environ["PYTHONPYCACHEPREFIX"] = sys.pycache_prefix = BYTECODE
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
os.environ["DOCKER_HOST"] = "unix:///nowhere"
LINES = 30
"""Of a first failure that are printed; estimate: the assertion and where it stands."""
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Real processes meet other work of the machine: a second try. A pure test that fails once is wrong.

    Files with such tests begin first: at the end, workers wait for each other only as long as a short file takes.
    """
    real = {item.path for item in items if item.get_closest_marker("zenoh") or item.get_closest_marker("process")}
    items.sort(key=lambda item: item.path not in real)
    if config.pluginmanager.hasplugin("rerunfailures"):
        for item in items:
            if item.get_closest_marker("zenoh") or item.get_closest_marker("process"):
                item.add_marker(pytest.mark.flaky(reruns=1))


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


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Tests that draw are skipped where the product says that it cannot draw."""
    if item.get_closest_marker("needs_opengl") and opengl_lost():
        pytest.skip(f"needs OpenGL without a display (Debian: apt install {GlError.PACKAGES})")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Name what was tried twice, and why; of the workers and the process that started them, only that one does."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        return
    failed = {report.nodeid for kind in ("failed", "error") for report in terminalreporter.stats.get(kind, ())}
    twice: dict[str, str] = {one.nodeid: one.longreprtext for one in terminalreporter.stats.get("rerun", ())}
    again = [name for name in twice if name not in failed]
    for name, why in twice.items():
        terminalreporter.section(f"{'passed' if name in again else 'failed'} at its second try: {name}")
        terminalreporter.write_line("\n".join(why.splitlines()[-LINES:]))
    if again and (file := os.environ.get("ROCO_SECOND_TRIES")):
        with Path(file).open("a", encoding="utf-8") as names:
            names.writelines(f"{name}\n" for name in again)
