"""Corners of drawn markers: where they were drawn, whatever their size, turn, slant, noise and
light.
"""

import cv2
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from velma.eyes import detect
from velma.eyes.detect import Detector, refined

SIZE, FINE = 160, 8  # the picture and how many samples a pixel has each way


SQUARE = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])


def turned(angle: float) -> np.ndarray:
    """A rotation of rows."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s], [-s, c]])


def drawn(corners: np.ndarray, number: int, low: float, high: float) -> np.ndarray:
    """A picture (SIZE, SIZE) of a marker's plate on a dark ground, each pixel the mean of FINE x
    FINE samples.
    """
    plate = detect.plate(number, 12).astype(np.float32)
    side = plate.shape[0]
    near, far = side / 8, 7 * side / 8
    inner = np.array([(near, near), (far, near), (far, far), (near, far)])
    # Pixel k has its centre at k; its samples fill k - 0.5 to k + 0.5.
    ends = (inner - 0.5).astype(np.float32), (FINE * (corners + 0.5) - 0.5).astype(np.float32)
    place, size = cv2.getPerspectiveTransform(*ends), (SIZE * FINE,) * 2
    large = cv2.warpPerspective(plate, place, size, flags=cv2.INTER_LINEAR, borderValue=90.0)
    small = large.reshape(SIZE, FINE, SIZE, FINE).mean(axis=(1, 3))
    return np.asarray(low + (high - low) * small / 255.0)


def noisy(picture: np.ndarray, sigma: float, seed: int) -> np.ndarray:
    """With noise, as eight bits."""
    noise = np.random.default_rng(seed).normal(0.0, sigma, picture.shape)
    return np.clip(np.rint(picture + noise), 0, 255).astype(np.uint8)


@given(
    side=st.floats(16.0, 60.0), turn=st.floats(-3.1, 3.1), flat=st.floats(0.6, 1.0),
    slant=st.floats(-0.3, 0.3),
    number=st.integers(0, 49), x=st.floats(-0.5, 0.5), y=st.floats(-0.5, 0.5),
    seed=st.integers(0, 1000),
    low=st.floats(0.0, 60.0), high=st.floats(140.0, 250.0),
)  # fmt: skip
def test_corners_are_found_to_a_fraction_of_a_pixel(
    side: float, turn: float, flat: float, slant: float, number: int, x: float, y: float, seed: int,
    low: float,
    high: float,
) -> None:  # fmt: skip
    """Within 0.35 pixels all four, from the whole-pixel corners of the detector, with noise of 3
    grey levels.
    """
    square = side * SQUARE * (1.0, flat)
    square[:, 0] += slant * square[:, 1]
    corners = square @ turned(turn) + (SIZE / 2 + x, SIZE / 2 + y)
    picture = noisy(drawn(corners, number, low, high), 3.0, seed)
    found = Detector([number]).find(picture)
    assume(number in found)
    fine, good = refined(picture, found[number][None])
    assert good[0]
    assert np.abs(fine[0] - corners).max() < 0.35
    assert np.abs(fine[0] - corners).mean() < 0.15


def test_the_fit_is_better_than_the_detector() -> None:
    """Ten times on the mean of many: else it would not be worth its time."""
    rough, fine = [], []
    rng = np.random.default_rng(1)
    for number in range(40):
        turn = turned(rng.uniform(-3, 3))
        corners = 24.0 * SQUARE @ turn + SIZE / 2 + rng.uniform(-1, 1, 2)
        picture = noisy(drawn(corners, number, 20.0, 220.0), 3.0, number)
        found = Detector([number]).find(picture)[number]
        rough.append(np.abs(found - corners).mean())
        fine.append(np.abs(refined(picture, found[None])[0][0] - corners).mean())
    assert np.mean(rough) > 0.25
    assert np.mean(fine) < 0.05


def test_what_has_no_edges_is_refused() -> None:
    """A grey picture, a marker whose corner is covered by grey, and corners that belong
    elsewhere.
    """
    corners = np.array([(60.0, 60.0), (100.0, 60.0), (100.0, 100.0), (60.0, 100.0)])
    assert not refined(np.full((SIZE, SIZE), 128, np.uint8), corners[None])[1][0]
    picture = noisy(drawn(corners, 3, 20.0, 220.0), 0.0, 0)
    assert refined(picture, corners[None])[1][0]
    hidden = picture.copy()
    hidden[:, 94:] = 20
    assert not refined(hidden, corners[None])[1][0]


def test_several_markers_do_not_touch_each_other() -> None:
    """Together they give what each gives alone."""
    rng = np.random.default_rng(2)
    corners = np.array([(60.0, 60.0), (100.0, 61.0), (98.0, 101.0), (61.0, 100.0)])
    picture = noisy(drawn(corners, 5, 10.0, 230.0), 3.0, 5)
    some = corners + rng.uniform(-0.7, 0.7, (3, 4, 2))
    together = refined(picture, some)[0]
    for one, both in zip(some, together, strict=True):
        assert refined(picture, one[None])[0][0] == pytest.approx(both, abs=1e-9)
