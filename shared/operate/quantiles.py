"""The value that a share of some values does not exceed, and whether so few values have one. Pure."""

import math
from collections.abc import Sequence


def quantile(values: Sequence[float], share: float) -> float | None:
    """Return the smallest value that at least `share` of them do not exceed (the nearest rank); None of none."""
    return sorted(values)[_rank(len(values), share)] if values else None


def tail(values: Sequence[float], share: float) -> float | None:
    """Return a quantile above the half; None where there are too few values for it."""
    return quantile(values, share) if enough(len(values), share) else None


def enough(count: int, share: float) -> bool:
    """Whether a quantile of so many values is not just the largest: from 20 on for 95 %, from 100 on for 99 %."""
    return _rank(count, share) < count - 1


def _rank(count: int, share: float) -> int:
    return max(0, math.ceil(share * count) - 1)
