"""Makes the modules beside it and in its folders importable (tests have no packages)."""

import sys
from pathlib import Path

import pytest

sys.path.extend(
    str(Path(__file__).parent / folder) for folder in ("", "experiments", "pictures", "supervisor")
)

from synthetic import Run, pour


@pytest.fixture(scope="session")
def pouring() -> Run:
    """A whole run of the main job, as it would go by a tap."""
    return pour(seed=1)
