"""Makes the scripted partners importable for the tests beside them (tests have no packages)."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def scene():
    """Co among hi, pl and ta, who do as the test says."""
    from partners_of_co import Scene

    return Scene()
