"""The jar is taken, held out, and given or put down: planner, km's store, skills and physics, as in
the benchmark.
"""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[4] / "benchmarks"))

from hand_over import measured


@pytest.mark.process
@pytest.mark.needs_opengl
@pytest.mark.timeout(600)
@pytest.mark.parametrize("person", ["pulls", "nobody"])  # a knock: test_performed.py
def test_it_is_given_to_whom_pulls_and_else_put_down(person):
    """Canonical scene, seed 4: the robot's words are true, nothing falls, all content stays in the
    jar.
    """
    line = measured("canonical", person, 4, verbose=False)
    assert (line["good"], line["drop"], line["given"]) == (True, False, person == "pulls"), line
