"""Markers on things: each number once, on the outside of its thing, and more than there are is
refused.
"""

import numpy as np
import pytest
from msgspec.structs import replace

from velma.errors import SceneError
from velma.model.kinds import Model, objects
from velma.model.markers import MOST, PLATE, Marker, of_scene
from velma.model.scene import Scene, SceneObject, load

EVERY = Scene(
    "every",
    tuple(SceneObject(f"thing_{k}", model, (0.0, 0.0, 0.0)) for k, model in enumerate(Model)),
)


def frame(marker: Marker) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Middle, direction upwards, direction towards who looks, side."""
    upper_left, upper_right, _, lower_left = marker.corners
    across, up = upper_right - upper_left, upper_left - lower_left
    side = float(np.linalg.norm(across))
    return marker.corners.mean(axis=0), up / side, np.cross(across, up) / side**2, side


def test_the_first_things_have_the_numbers_of_the_trial() -> None:
    """The jar 16 from 0 on, the bowl 18, the cabinet 4, two tables 4 each: all of a dictionary of
    50.
    """
    numbers = {name: [one.number for one in markers] for name, markers in of_scene(load()).items()}
    assert numbers["jar_1"] == list(range(16))
    assert numbers["bowl_1"] == [*range(16, 26), *range(38, 46)]
    assert numbers["cabinet_2"] == list(range(26, 30))
    assert {tuple(numbers["table_1"]), tuple(numbers["table_2"])} == {
        (30, 31, 32, 33),
        (34, 35, 36, 37),
    }


def test_a_number_stands_once_also_with_two_of_a_kind() -> None:
    """Every model twice: nobody's marker is another's."""
    twice = Scene(
        "twice", (*EVERY.things, *(replace(t, id=f"other_{k}") for k, t in enumerate(EVERY.things)))
    )
    numbers = [one.number for markers in of_scene(twice).values() for one in markers]
    assert len(numbers) == len(set(numbers))
    assert max(numbers) < MOST


def test_more_than_there_are_is_refused() -> None:
    """With the thing for which nothing is left."""
    many = Scene(
        "many", tuple(SceneObject(f"jar_{k}", Model.JAR, (0.0, 0.0, 0.0)) for k in range(20))
    )
    with pytest.raises(SceneError, match=r"thing jar_13 .*at most 250") as refused:
        of_scene(many)
    assert refused.value.field == "thing jar_13"


def test_a_marker_is_a_square_that_looks_outwards() -> None:
    """Right angles and equal sides; it looks away from the middle of its thing, or into the open
    bowl.
    """
    markers = of_scene(EVERY)
    for thing, marker in ((one, each) for one in EVERY.things for each in markers[one.id]):
        middle, up, towards, side = frame(marker)
        assert np.linalg.norm(
            np.roll(marker.corners, -1, axis=0) - marker.corners, axis=1
        ) == pytest.approx([side] * 4)
        assert up @ (marker.corners[1] - marker.corners[0]) == pytest.approx(0.0, abs=1e-12)
        assert np.linalg.norm(towards) == pytest.approx(1.0)
        inside_bowl = thing.model is Model.BOWL and middle[2] > 0.05
        flat = np.array([*middle[:2], 0.0]) / np.linalg.norm(middle[:2]) if inside_bowl else middle
        assert (towards @ flat < 0.0) == inside_bowl
        assert np.ptp(marker.plate(), axis=0).max() == pytest.approx(
            PLATE * np.ptp(marker.corners, axis=0).max()
        )


def test_plates_stay_within_what_the_hand_leaves_free() -> None:
    """On the jar beyond 60 mm from its middle; the bowl's skirt below the fingers; on tables."""
    for marker in of_scene(EVERY)["thing_0"]:
        assert (np.abs(marker.plate()[:, 2]) > 0.06).all()
        assert (np.abs(marker.plate()[:, 2]) < objects()["jar"]["height"] / 2).all()
    for marker in of_scene(EVERY)["thing_1"][:10]:
        assert np.linalg.norm(marker.plate()[:, :2], axis=1).max() < 0.1035
        assert marker.plate()[:, 2].max() < 0.031
        assert marker.plate()[:, 2].min() > 0.0
    top = np.array(objects()["table"]["parts"]["top"]["box"]) / 2
    for marker in of_scene(EVERY)["thing_3"]:
        assert (np.abs(marker.plate()[:, :2]) < top[:2]).all()
