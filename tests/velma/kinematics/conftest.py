"""One robot for all tests, and a random source that shows its seed when a test fails."""

import numpy as np
import pytest

from velma.kinematics.robot import Robot


@pytest.fixture(scope="session")
def robot() -> Robot:
    """Torso and arms from the committed robot file."""
    return Robot()


@pytest.fixture
def rng(request: pytest.FixtureRequest) -> np.random.Generator:
    """Random numbers, the same in every run of one test."""
    seed = sum(map(ord, request.node.name))
    print(f"seed {seed}")
    return np.random.default_rng(seed)
