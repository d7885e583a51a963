"""Makes the synthetic run beside it importable (tests have no packages)."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from synthetic import Run, pour


@pytest.fixture(scope="session")
def pouring() -> Run:
    """A whole run of the main job, as it would go by a tap."""
    return pour(seed=1)
