"""Pours that are possible, each worked out once; `tilts` is importable (tests have no packages)."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def _over_the_bowl(_jar_out):
    from tilts import in_view

    acting = _jar_out.copied()
    acting.things = {**acting.things, "box_1": "box1", "bowl_2": acting.things["bowl_1"]}
    return acting, in_view(acting)


@pytest.fixture
def over_the_bowl(_over_the_bowl):
    """The jar is in the left hand, the bowl in view on the nearest table, and this is a pour that
    is possible there.

    In the situation alone: in physics the robot has only taken the jar out.
    """
    acting, pour = _over_the_bowl
    return acting.copied(), pour
