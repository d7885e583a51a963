"""The page asks a person for what only a person can do, while the robot waits for it and at no other time."""

from typing import Any

import pytest
from msgspec.structs import replace

from companion.languages.cmd import TaskState
from companion.languages.hfsm import Place, Step
from companion.run_files import InWords, TaskLine
from services.page.view import Heard, view

STEP = Step("hand-over", ("jar_1",))
LINE = TaskLine(
    "hi-1-1", TaskState.RUNNING, "", at=Place(("hand over jar_1", "give"), STEP, "HandOver"), steps=(STEP,), number=1,
    wish=InWords("hand over the jar", "podaj słoik"),
)  # fmt: skip
ASKED = {
    "en": "Please take the jar: pull gently, and I let go.",
    "pl": "Proszę wziąć słoik: wystarczy lekko pociągnąć, a puszczę.",
}


@pytest.mark.parametrize("language", ASKED)
@pytest.mark.parametrize(
    ("changes", "stands", "asked"),
    [
        ({}, {}, True),
        ({"at": replace(LINE.at, act="MoveJoint")}, {}, False),
        ({"at": None}, {}, False),
        ({"asks": "hand over jar_1/give"}, {}, False),
        ({"state": TaskState.DONE}, {}, False),
        ({}, {"held": True}, False),
        ({}, {"hi": False}, False),
    ],
    ids=["it waits for a pull", "on the way", "before", "the operator first", "over", "stopped", "away"],
)
def test_a_person_is_asked_while_the_robot_waits_for_a_pull(
    language: str, changes: dict[str, Any], stands: dict[str, Any], asked: bool
) -> None:
    """In the person's language, with the thing in it."""
    heard = Heard(**{"hi": True, "tasks": (replace(LINE, **changes),), **stands})
    assert view(heard, language).please == (ASKED[language] if asked else "")
