"""Quantiles by the nearest rank, and whether there are enough values for one. Pure."""

import math
from collections.abc import Sequence


def quantile(values: Sequence[float], share: float) -> float | None:
    """Return the smallest value that at least `share` of them do not exceed (the nearest rank);
    None of none.
    """
    return sorted(values)[_rank(len(values), share)] if values else None


def tail(values: Sequence[float], share: float) -> float | None:
    """Return a quantile above the half; None where there are too few values for it."""
    return quantile(values, share) if enough(len(values), share) else None


def enough(count: int, share: float) -> bool:
    """Whether the quantile of `count` values is below the largest: 20 are enough for 95 %, 100 for
    99 %.
    """
    return _rank(count, share) < count - 1


def _rank(count: int, share: float) -> int:
    return max(0, math.ceil(share * count) - 1)
