"""The toy fleet as a fixture; makes the modules beside the tests importable (tests have no packages)."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1] / "agent_runtime")]

from toy_fleet import Fleet  # noqa: E402  (after the path is set)


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[Fleet]:
    """Router, asker and server, all ready."""
    fleet = Fleet(tmp_path)
    fleet.start("router")
    fleet.ready("router")
    fleet.start("asker", "server")
    fleet.ready("asker", "server")
    yield fleet
    for name in list(fleet.processes):
        fleet.kill(name)
