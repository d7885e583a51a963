"""Makes the pretended world and devices importable for the tests beside them (tests have no
packages).
"""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def fleet():
    """Six agents in memory; the search is scripted, the robot pretended."""
    from pretended_fleet import Fleet

    with Fleet() as made:
        yield made
