"""Quantiles are values that were measured, and told only where so few values have them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from operate.quantiles import enough, quantile, tail

VALUES = st.lists(st.floats(0.0, 1e6), min_size=1, max_size=300)
SHARES = st.sampled_from((0.5, 0.95, 0.99))


@pytest.mark.parametrize(
    ("values", "share", "wanted"), [([], 0.5, None), ([3], 0.95, 3), ([4, 1, 3, 2], 0.5, 2)]
)
def test_the_nearest_rank(values: list[float], share: float, wanted: float | None) -> None:
    """The smallest value that half of them do not exceed."""
    assert quantile(values, share) == wanted


@given(VALUES, SHARES)
def test_a_quantile_is_the_smallest_value_that_a_share_does_not_exceed(
    values: list[float], share: float
) -> None:
    """Of the values themselves: nothing is put between two of them."""
    told = quantile(values, share)
    assert told in values
    assert told is not None
    assert sum(one <= told for one in values) >= share * len(values)
    assert sum(one < told for one in values) < share * len(values)


@given(VALUES, st.sampled_from(((0.95, 20), (0.99, 100))))
def test_a_tail_needs_values_beyond_it(values: list[float], rule: tuple[float, int]) -> None:
    """With fewer than twenty, or a hundred, it would be just the largest."""
    share, least = rule
    assert (tail(values, share) is None) == (len(values) < least)
    assert (quantile(range(len(values)), share) == len(values) - 1) == (len(values) < least)


@pytest.mark.parametrize(("share", "least"), [(0.95, 20), (0.99, 100)])
def test_the_first_number_that_is_enough(share: float, least: int) -> None:
    """Sharp: one fewer is not."""
    assert (enough(least - 1, share), enough(least, share)) == (False, True)
