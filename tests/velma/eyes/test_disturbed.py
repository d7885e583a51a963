"""Noise, blur and exposure: as much as asked, and nothing where nothing is asked."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from velma.eyes.pictures import disturbed, smaller

GREY = np.full((200, 300, 3), 120, np.uint8)


@given(noise=st.floats(1.0, 15.0), seed=st.integers(0, 1000))
def test_noise_has_the_deviation_that_was_asked(noise: float, seed: int) -> None:
    """About the level that was there, the same for the same seed, alike in three colours."""
    picture = disturbed(GREY, noise, 0.0, 1.0, np.random.default_rng(seed))
    assert picture.std() == pytest.approx(np.hypot(noise, 12**-0.5), rel=0.03)
    assert picture.mean() == pytest.approx(120.0, abs=0.3)
    assert (picture[..., 0] == picture[..., 2]).all()
    assert (picture == disturbed(GREY, noise, 0.0, 1.0, np.random.default_rng(seed))).all()


def test_exposure_multiplies_and_blur_smooths() -> None:
    """Up to the largest level; a step becomes a slope of the width asked."""
    rng = np.random.default_rng(0)
    assert disturbed(GREY, 0.0, 0.0, 1.5, rng)[0, 0, 0] == 180
    assert disturbed(GREY, 0.0, 0.0, 3.0, rng)[0, 0, 0] == 255
    step = GREY.copy()
    step[:, 150:] = 220
    row = disturbed(step, 0.0, 2.0, 1.0, rng)[100, :, 0].astype(float)
    rise = np.diff(row)
    places = np.arange(len(rise)) + 0.5
    middle = (places * rise).sum() / rise.sum()
    assert middle == pytest.approx(149.5, abs=0.1)
    assert np.sqrt((rise * (places - middle) ** 2).sum() / rise.sum()) == pytest.approx(
        2.0, rel=0.15
    )


def test_nothing_asked_changes_nothing() -> None:
    """Not a pixel."""
    assert (disturbed(GREY, 0.0, 0.0, 1.0, np.random.default_rng(0)) == GREY).all()


def test_a_smaller_picture_has_the_means() -> None:
    """Of the pixels each one covers."""
    checks = np.zeros((4, 6, 3), np.uint8)
    checks[::2, ::2] = 200
    assert smaller(checks, 2).shape == (2, 3, 3)
    assert (smaller(checks, 2) == 50).all()
