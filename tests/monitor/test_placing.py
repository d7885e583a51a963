"""Things are drawn where they truly were, else where they were seen."""

import msgspec
from synthetic import POSES, Run

from services.monitor import history
from services.monitor.placing import placed
from services.monitor.records import understood


def past(run: Run, **truth: object) -> history.History:
    """The run's history with other fields in each true state."""
    whole = history.merged([understood(sample) for sample in run.samples], {})
    states = tuple((at, msgspec.structs.replace(state, **truth)) for at, state in whole.truth)
    return msgspec.structs.replace(whole, truth=states)


def test_true_poses_come_first(pouring: Run) -> None:
    """Furniture stands still, vessels move, and all of it as the truth says."""
    things = {thing.name: thing for thing in placed(past(pouring))}
    assert things["cabinet_2"].poses[0] == POSES["cabinet_2"]
    assert {name for name, thing in things.items() if thing.moves} == {"jar_1", "bowl_1"}


def test_without_true_poses_things_are_where_they_were_seen(pouring: Run) -> None:
    """Vessels follow their true origins, furniture the observations; nothing is left out."""
    things = {thing.name: thing for thing in placed(past(pouring, poses={}, models={}))}
    assert set(things) == {*POSES, "jar_1", "bowl_1"}
    assert things["table_1"].poses[-1] == POSES["table_1"]
    assert things["bowl_1"].poses[-1].xyz == pouring.at["bowl_1"]


def test_with_no_truth_at_all_observations_are_enough(pouring: Run) -> None:
    """Every thing that was seen has a pose for each sight."""
    whole = msgspec.structs.replace(past(pouring), truth=())
    assert all(thing.poses and len(thing.poses) == len(thing.times) for thing in placed(whole))
