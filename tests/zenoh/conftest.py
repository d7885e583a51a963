"""The toy fleet as fixtures; makes the modules beside the tests importable (tests have no
packages).
"""

import sys
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import pytest

TESTS = Path(__file__).parents[1]
sys.path[:0] = [str(Path(__file__).parent), str(TESTS / "agent_runtime")]
sys.path += [str(TESTS / "operate/fipa"), str(TESTS / "fipa_codec")]

from secured_fleet import secured  # noqa: E402  (after the path is set)
from toy_fleet import Fleet  # noqa: E402

ALL = ("router", "asker", "server")


@pytest.fixture
def router(tmp_path: Path) -> Iterator[Fleet]:
    """A router in a process of its own."""
    made = Fleet(tmp_path)
    made.start("router")
    made.ready("router")
    yield made
    made.end()


@pytest.fixture
def secured_router(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Fleet]:
    """A router with keys, for agents of the companion."""
    made = secured(tmp_path, monkeypatch)
    made.start("router")
    made.ready("router")
    yield made
    made.end()


@pytest.fixture
def toys(tmp_path: Path) -> Iterator[Fleet]:
    """Router, asker and server, all ready; for a test that leaves them otherwise than it found
    them.
    """
    made = whole(tmp_path)
    yield made
    made.end()


def whole(run: Path) -> Fleet:
    """Start all three side by side."""
    made = Fleet(run)
    made.start(*ALL)
    made.ready(*ALL)
    return made


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[Any]:
    """The whole companion, of this test's own."""
    yield from whole_companion(tmp_path)


@pytest.fixture(scope="module")
def one_fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """The whole companion, for all tests of a module: each leaves the next one what it needs."""
    yield from whole_companion(tmp_path_factory.mktemp("fleet"))


def whole_companion(folder: Path) -> Iterator[Any]:
    """All that `roco up` starts; down at the end."""
    from roco_fleet import RocoFleet  # loads the robot's models, which most tests do not need

    made = RocoFleet(folder / "run")
    yield made
    made.down()


FAILED = pytest.StashKey[bool]()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, Any, Any]:
    """Note for `shared` that a test failed."""
    report = yield
    item.stash[FAILED] = item.stash.get(FAILED, False) or report.failed or report.outcome == "rerun"
    return report


@pytest.fixture(scope="module")
def _kept() -> Iterator[list[Fleet]]:
    kept: list[Fleet] = []
    yield kept
    for one in kept:
        one.end()


@pytest.fixture
def shared(_kept: list[Fleet], tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Fleet]:
    """Router, asker and server of all tests of a module; new ones after a test that failed or lost
    a process.
    """
    if not _kept:
        _kept.append(whole(tmp_path))
    (one,) = _kept
    yield one
    alive = {name for name, process in one.processes.items() if process.poll() is None}
    if request.node.stash.get(FAILED, False) or alive != {*ALL}:
        _kept.pop().end()
