"""Makes the synthetic run of tests/operate importable (tests have no packages)."""

import sys
from functools import cache
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "operate"))

from synthetic import pour

from companion.tools.system import SYSTEM
from companion.tools.verbs import ask
from operate.recording import run
from services.knowledge import asked

_open = run.opened
_opened = cache(lambda place: _open(place, SYSTEM))


@pytest.fixture
def answered_here(monkeypatch):
    """Questions are answered in this process."""
    monkeypatch.setattr(asked, "bound", lambda seconds: None)
    monkeypatch.setattr(ask, "answered", asked.answer)
    monkeypatch.setattr(run, "opened", lambda place, system=None: _opened(place))


@pytest.fixture(scope="session")
def pouring():
    """A whole run of the main job, as it would go by a tap."""
    return pour(seed=1)
