"""Makes the scripted partners importable (tests have no packages)."""

import sys
from pathlib import Path

import pytest

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1] / "fleet")]


@pytest.fixture
def scene():
    """Co among hi, pl and ta, who do as the test says."""
    from partners_of_co import Scene

    return Scene()
