"""Attacks on a real router and fleet; makes the modules of tests/zenoh importable (tests have no
packages).
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1] / "zenoh")]

import secured_fleet  # noqa: E402  (after the path is set)
from key_floods import Peer  # noqa: E402
from toy_fleet import Fleet, wait_for  # noqa: E402


@pytest.fixture
def router(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Fleet]:
    """A router in a process of its own, with keys and the rights of the companion."""
    fleet = secured_fleet.secured(tmp_path, monkeypatch)
    fleet.start("router")
    fleet.ready("router")
    yield fleet
    fleet.end()


@pytest.fixture
def peer(router: Fleet) -> Iterator[Peer]:
    """A peer that co answers."""
    secured_fleet.serve_linked(router, "co")
    one = Peer(router)
    wait_for(one.asks, "co answers")
    yield one
    one.close()
