"""Search of a path between two postures by OMPL's RRTConnect, limited by iterations and repeatable by its seed.

Knows neither robot nor scene: only bounds, and whether a posture is allowed.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from velma.names import Array

ou.setLogLevel(ou.LOG_NONE)  # also silences "changing seed": samples after `setSeed` follow the new seed

RANGE = 0.6  # rad that one extension of the tree may go (trial runs)
CHECKED = 0.1  # rad between states that are checked on an edge; whole motions are checked more finely later


class _Counted:
    """Makes the planner stop after a number of calls."""

    def __init__(self, iterations: int) -> None:
        self.left = iterations

    def __call__(self) -> bool:
        self.left -= 1
        return self.left < 0


def grow(
    allowed: Callable[[Array], bool],
    start: Array,
    goal: Array,
    lower: Array,
    upper: Array,
    *,
    iterations: int,
    seed: int,
) -> list[Array] | None:
    """Return postures from `start` to `goal`, all (n,) within bounds, whose straight connections are allowed, or None.

    Equal arguments give equal results, whatever was planned before.
    """
    ou.RNG.setSeed(1 + seed % (2**31 - 2))  # 0 would mean a seed from the clock
    space = ob.RealVectorStateSpace(len(start))
    space.setBounds(_bounds(lower, upper))
    information = ob.SpaceInformation(space)
    dimensions = range(len(start))
    information.setStateValidityChecker(lambda state: bool(allowed(np.array([state[i] for i in dimensions]))))
    information.setStateValidityCheckingResolution(CHECKED / space.getMaximumExtent())
    information.setup()
    problem = ob.ProblemDefinition(information)
    problem.setStartAndGoalStates(_state(space, start), _state(space, goal))
    planner = og.RRTConnect(information)
    planner.setRange(RANGE)
    planner.setProblemDefinition(problem)
    planner.setup()
    planner.solve(ob.PlannerTerminationCondition(_Counted(iterations)))
    if not problem.hasExactSolution():
        return None
    path = problem.getSolutionPath()
    states = [path.getState(k) for k in range(path.getStateCount())]
    return [np.array([state[i] for i in dimensions]) for state in states]


def _bounds(lower: Array, upper: Array) -> Any:
    bounds = ob.RealVectorBounds(len(lower))
    for k, (low, high) in enumerate(zip(lower, upper, strict=True)):
        bounds.setLow(k, float(low))
        bounds.setHigh(k, float(high))
    return bounds


def _state(space: Any, values: Array) -> Any:
    state = space.allocState()
    for k, value in enumerate(values):
        state[k] = float(value)
    return state
