"""Things are drawn where they truly were, else where they were seen; contacts as forces on what is
touched.
"""

import msgspec
import pytest
from noted import Noted, afterwards
from synthetic import POSES, Run, with_truth

from companion.telemetry import Contact, TrueState
from companion.tools.pictures.scene import CONTACTS, M_PER_N, THINGS, Contacts, Scene
from companion.tools.telemetry import every
from operate.recording import history


def changed(past: history.History, **fields: object) -> history.History:
    """The run's history with other fields in each true state."""
    states = tuple(
        (at, msgspec.structs.replace(state, **fields)) for at, state in every(past, TrueState)
    )
    return with_truth(past, states)


def poses(sheet: Noted, name: str) -> list[tuple[object, object]]:
    """The poses at which a thing was drawn."""
    return [value for _, value in sheet.of(f"{THINGS}/{name}")]


def test_true_poses_come_first(past: history.History, sheet: Noted) -> None:
    """Furniture stands still and is drawn once, vessels move, and all of it as the truth says."""
    assert poses(sheet, "cabinet_2") == [(POSES["cabinet_2"].xyz, POSES["cabinet_2"].quat_wxyz)]
    for name in ("jar_1", "bowl_1"):
        true = {
            (now.poses[name].xyz, now.poses[name].quat_wxyz) for _, now in every(past, TrueState)
        }
        drawn = poses(sheet, name)
        assert len(drawn) > 1
        assert set(drawn[1:]) <= true  # before the first truth there is what was seen


def test_without_true_poses_things_are_where_they_were_seen(
    past: history.History, pouring: Run
) -> None:
    """Vessels follow their true origins, furniture the observations; nothing is left out."""
    sheet = afterwards(changed(past, poses={}, models={}), Scene)
    assert poses(sheet, "table_1")[-1][0] == POSES["table_1"].xyz
    assert poses(sheet, "bowl_1")[-1][0] == pouring.at["bowl_1"]


def test_with_no_truth_at_all_observations_are_enough(past: history.History) -> None:
    """Every thing that was seen is drawn, with a look of its own."""
    sheet = afterwards(with_truth(past, ()), Scene)
    for name in (*POSES, "jar_1", "bowl_1"):
        assert poses(sheet, name)
        assert any(entity.startswith(f"{THINGS}/{name}/") for entity in sheet.looks)


def test_forces_are_arrows_and_their_end_is_drawn_once(past: history.History) -> None:
    """An arrow as long as the force, and nothing where the last one ended."""
    touched = Contact((0.1, 0.2, 0.3), (0.0, 0.0, 5.0))
    (first, now), (second, free), (third, still) = every(past, TrueState)[:3]
    felt = msgspec.structs.replace(now, contacts=(touched,))
    truths = ((first, felt), (second, free), (third, still))
    drawn = afterwards(with_truth(past, truths), Contacts).of(CONTACTS)
    arrow = [touched.at], [(0.0, 0.0, pytest.approx(5.0 * M_PER_N))]
    assert [value for _, value in drawn] == [arrow, ([], [])]
