"""What nobody has checked of a task that was done is said to the person, in the language of the page."""

import pytest

from companion.languages.cmd import TaskState
from companion.languages.evidence import Claim, Evidence, Sense
from companion.run_files import TaskLine
from services.page.view import LANGUAGES, Heard, view

pytestmark = pytest.mark.timeout(30)
PUT, HELD = Evidence(Claim.STANDS, "jar_1"), Evidence(Claim.HELD, "bowl_1", (Sense.WRIST,), 3.0)


def said(state: TaskState, evidence: tuple[Evidence, ...], language: str) -> str:
    """What the page says beside an ended task."""
    line = TaskLine("hi-1-1", state, "", "put the jar on the table", accepted=True, evidence=evidence)
    (task,) = view(Heard(hi=True, tasks=(line,)), language).ended
    return task.unchecked


def test_only_what_was_done_and_not_checked_is_said() -> None:
    """A task that failed says why; a claim with a sense behind it needs no words."""
    for language, thing in zip(LANGUAGES, ("jar", "słoik"), strict=True):
        assert thing in said(TaskState.DONE, (PUT, HELD), language)
        assert said(TaskState.DONE, (HELD,), language) == ""
        assert said(TaskState.FAILED, (PUT,), language) == ""
