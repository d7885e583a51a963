"""Robots in the states that tests of skills begin with, each made once and copied; `robot` is
importable.

It is imported by the first test that needs it: no other test here needs the simulator.
"""

import sys
from pathlib import Path

import pytest

from companion.languages.values import Side

sys.path.insert(0, str(Path(__file__).parent / "skills"))


@pytest.fixture(scope="session")
def _knowing():
    from robot import Acting

    acting = Acting()
    acting.done(acting.look())
    return acting


@pytest.fixture(scope="session")
def _before_the_jar(_knowing):
    acting = _knowing.copied()
    acting.plan_to_take("jar_1", Side.LEFT)
    acting.done(acting.taking[0])
    return acting


@pytest.fixture(scope="session")
def _holding(_before_the_jar):
    acting = _before_the_jar.copied()
    acting.done(acting.taking[1])
    return acting


@pytest.fixture(scope="session")
def _jar_out(_holding):
    acting = _holding.copied()
    acting.done(acting.taking[2])
    return acting


@pytest.fixture
def before_the_jar(_before_the_jar):
    """The left hand is in front of the jar; `taking[1]` grasps it, `taking[2]` pulls it out."""
    return _before_the_jar.copied()


@pytest.fixture
def holding(_holding):
    """The left hand has closed on the jar, which stands on its shelf."""
    return _holding.copied()


@pytest.fixture
def jar_out(_jar_out):
    """The left hand holds the jar in front of the cabinet."""
    return _jar_out.copied()
