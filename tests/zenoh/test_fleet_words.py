"""Sentences of a person, and impossible ones, over Zenoh with the simulated robot: each ends in a
clear word.
"""

from pathlib import Path

import pytest
from roco_fleet import RocoFleet, safely_down

from companion.languages.facts import Kind
from velma.model.scene import CANONICAL

pytestmark = [pytest.mark.zenoh, pytest.mark.long, pytest.mark.timeout(300)]

POUR = "pour the content of the jar into the bowl"


def test_look_around(one_fleet: RocoFleet) -> None:
    """It tells what was seen."""
    line = one_fleet.do("look around")
    assert line.state == "done", line
    assert {"bowl_1", "jar_1"} <= {
        name for one in line.why if one.kind is Kind.SEEN for name in one.things
    }, line


def test_dance(one_fleet: RocoFleet) -> None:
    """A sentence that is not a command is refused with examples of commands; exit code 1, and no
    task comes of it.
    """
    before = one_fleet.hi.tasks()
    said = one_fleet.roco("say", "dance", code=1)
    assert "look around" in said
    assert one_fleet.hi.tasks() == before


def test_tasks_are_done_one_after_the_other(one_fleet: RocoFleet) -> None:
    """Said in one breath: each is done, none before the one in front of it has ended."""
    tasks = [one_fleet.say(text) for text in ("take the jar", "put down the jar", "look around")]
    lines = [one_fleet.ended(task) for task in tasks]
    assert [line.state for line in lines] == ["done"] * 3, lines
    assert [line.since for line in lines] == sorted(line.since for line in lines)
    safely_down(one_fleet.truth())


def test_take_the_bowl_with_the_right_hand(one_fleet: RocoFleet) -> None:
    """It is then in that hand, upright."""
    line = one_fleet.do("take the bowl with the right hand")
    assert line.state == "done", line
    truth = one_fleet.truth()
    assert truth.fingers_on["bowl_1"]["right"] >= 3
    assert truth.tilt_deg["bowl_1"] < 10.0


@pytest.mark.parametrize(
    ("file", "why"), [("jar_out_of_reach", Kind.NO_GRASP), ("no_jar", Kind.NOT_SEEN)]
)
def test_what_cannot_be_done(tmp_path: Path, file: str, why: Kind) -> None:
    """The task fails with a reason a person understands, and the next command is served."""
    fleet = RocoFleet(tmp_path / "run", scene=CANONICAL.with_name(f"{file}.toml"))
    try:
        line = fleet.do(POUR)
        assert line.state == "failed", line
        assert why in [one.kind for one in line.why], line
        assert fleet.do("look around").state == "done"
    finally:
        fleet.down()
