"""A path made shorter and rounder: shortcuts of all joints or of one, then moving averages along the path.

A path is an array (n, m) of postures, neighbours at most `STEP` apart. Condition, cost and random generator are
arguments.
"""

from collections.abc import Callable, Iterator
from functools import lru_cache

import numpy as np

from velma import names
from velma.kinematics.timing import dense
from velma.names import Array

Allowed = Callable[
    [Array], bool
]  # of postures (n, m), in the order in which they are looked at: whether all are allowed
Cost = Callable[[Array], Array]  # of postures (n, m): what each of the n - 1 steps costs

STEP = 0.05  # rad between checked states
_TRIES, _PATIENCE = 200, 50  # shortcuts tried, and failures in a row after which to stop
_GAIN = 1e-3  # s: the least gain that counts
_ONE_JOINT = 0.5  # share of shortcuts that straighten a single joint, such as a torso that turns back and forth
_WINDOWS = (17, 9, 5)  # points of 0.05 rad averaged, widest first


@lru_cache(maxsize=512)
def halving(count: int) -> names.Columns:
    """Return 0 .. count - 1, the middle first, then those of the halves, so that a blocked path is found early."""
    ranges: list[tuple[int, int]] = [(0, count)]
    order: list[int] = []
    for low, high in ranges:
        if low < high:
            middle = (low + high) // 2
            order.append(middle)
            ranges += [(low, middle), (middle + 1, high)]
    return np.array(order, dtype=np.intp)


def clear(allowed: Allowed, states: Array) -> bool:
    """Whether all states (n, m) are allowed."""
    return allowed(states[halving(len(states))])


def shortened(path: Array, allowed: Allowed, cost: Cost, rng: np.random.Generator) -> Array:
    """Return the path with all random shortcuts that reduce its cost."""
    costs, vain = cost(path), 0
    for _ in range(_TRIES):
        if len(path) < 3 or vain >= _PATIENCE:
            break
        first, last = (int(k) for k in np.sort(rng.integers(len(path), size=2)))
        vain += 1
        if last - first < 2:
            continue
        piece = path[first : last + 1]
        straight = _one_joint(piece, rng) if rng.random() < _ONE_JOINT else dense(piece[[0, -1]], STEP)
        new = cost(straight)
        if new.sum() < costs[first:last].sum() - _GAIN and clear(allowed, straight[1:-1]):
            path = np.concatenate((path[:first], straight, path[last + 1 :]))
            costs, vain = np.concatenate((costs[:first], new, costs[last:])), 0
    return dense(path, STEP)


def _one_joint(piece: Array, rng: np.random.Generator) -> Array:
    """Return the piece with one joint moving evenly from first to last value: often the first joint, the slowest."""
    joint = 0 if rng.random() < 0.3 else int(rng.integers(piece.shape[1]))
    changed = piece.copy()
    changed[:, joint] = np.linspace(piece[0, joint], piece[-1, joint], len(piece))
    return changed


def rounder(path: Array) -> Iterator[Array]:
    """Yield the path with its corners rounded, less and less, at last unchanged; ends stay."""
    for window in _WINDOWS:
        half = window // 2
        ends = (np.tile(path[:1], (half, 1)), path, np.tile(path[-1:], (half, 1)))
        sums = np.cumsum(np.concatenate((np.zeros((1, path.shape[1])), *ends)), axis=0)
        averaged = (sums[window:] - sums[:-window]) / window
        averaged[0], averaged[-1] = path[0], path[-1]
        yield averaged
    yield path
