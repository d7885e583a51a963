"""The toy fleet as fixtures; makes the modules beside the tests importable (tests have no
packages).
"""

import sys
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import pytest

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1] / "agent_runtime")]

from toy_fleet import Fleet  # noqa: E402  (after the path is set)


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[Fleet]:
    """Router, asker and server, all ready; for a test that leaves them otherwise than it found
    them.
    """
    made = whole(tmp_path)
    yield made
    end(made)


def whole(run: Path) -> Fleet:
    """Start all three side by side."""
    made = Fleet(run)
    made.start("router", "asker", "server")
    made.ready("router", "asker", "server")
    return made


def end(made: Fleet) -> None:
    """Kill what still runs."""
    for name in list(made.processes):
        made.kill(name)


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
        end(one)


@pytest.fixture
def shared(_kept: list[Fleet], tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Fleet]:
    """Router, asker and server of all tests of a module; new ones after a test that failed or lost
    a process.
    """
    if not _kept:
        _kept.append(whole(tmp_path))
    (one,) = _kept
    yield one
    if request.node.stash.get(FAILED, False) or {
        name for name, p in one.processes.items() if p.poll() is None
    } != {
        "router",
        "asker",
        "server",
    }:
        end(_kept.pop())
