"""km's scene after the survey of several scenes, and after each step of the first plan; `planned`
is importable.
"""

import sys
from functools import cache
from pathlib import Path

import pytest
from msgspec.structs import replace

from companion.languages import hfsm
from velma.model import scene as model

sys.path.insert(0, str(Path(__file__).parent))

from planned import Km, acts, surveyed

First = tuple[Km, hfsm.HierarchicalPlan]


@pytest.fixture(scope="session")
def beginning():
    """The canonical scene after the survey."""
    return surveyed(model.load())


@pytest.fixture(scope="session")
def env2():
    """The second recorded scene after the survey: a box is beside the jar in the cabinet, another
    before the bowl.
    """
    return surveyed(model.load(model.CANONICAL.parent / "env2.toml"))


@pytest.fixture(scope="session")
def doors():
    """Makes the scene with doors after the survey, the left and the right one open so far [rad]."""

    @cache
    def made(*angles):
        whole = model.load(model.CANONICAL.with_stem("doors"))
        open_by = dict(zip(("door_1", "door_2"), angles, strict=True))
        hung = (
            replace(t, xyz=model.NOWHERE, open=open_by[t.id]) if t.of else t for t in whole.things
        )
        return surveyed(model.hung(replace(whole, things=tuple(hung))))

    return made


@pytest.fixture(scope="session")
def first(beginning):
    """The first plan, and km as it was asked for it."""
    km = Km(beginning)
    plan = km.plan("pour", "jar", "bowl")
    assert acts(plan)
    return km, plan


@pytest.fixture(scope="session")
def jar_carried(first):
    """The left hand carries the jar, the bowl is still in the cabinet."""
    return first[0].believed(2)


@pytest.fixture(scope="session")
def bowl_out(first):
    """Both hands are full."""
    return first[0].believed(3)


@pytest.fixture(scope="session")
def bowl_placed(first):
    """The bowl was put down and looked at, the right arm is home: the first plan has ended."""
    return first[0].believed(-1)


@pytest.fixture(scope="session")
def second(bowl_placed):
    """The second plan, and km as it was asked for it."""
    km = Km(bowl_placed)
    plan = km.plan("pour", "jar", "bowl", request="p2")
    assert acts(plan)
    return km, plan
